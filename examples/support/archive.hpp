// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Values to the numbers of a file and back (cairn/io/binary_file.hpp), bit for bit.
///
/// One function template says what a type is made of, and serves both ways:
///   void parts(auto& archive, Loop& loop) { archive(loop.first, loop.last, loop.T_first_last, ...); }
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/io/binary_file.hpp>
#include <cairn/manifold/se2.hpp>

namespace example {

template <class T>
concept PlainNumber = std::is_arithmetic_v<T> || std::is_enum_v<T>;

namespace detail {
template <class T>
struct InFile {
  using type = T;
};
template <class T>
  requires std::is_enum_v<T>
struct InFile<T> {
  using type = std::underlying_type_t<T>;
};
template <>
struct InFile<bool> {
  using type = std::uint8_t;
};
}  // namespace detail

/// The number that stands in a file for one of this type.
template <PlainNumber T>
using InFile = typename detail::InFile<T>::type;

class Writer {
public:
  static constexpr bool reads = false;

  template <class... T>
  void operator()(T&... values) {
    (put(values), ...);
  }
  [[nodiscard]] std::string file(std::string_view kind, std::uint64_t version) && {
    return std::move(out_).file(kind, version);
  }

private:
  template <PlainNumber T>
  void put(const T& number) {
    out_.put(static_cast<InFile<T>>(number));
  }
  template <class T>
  void put(std::vector<T>& values) {
    const std::uint64_t size = values.size();
    put(size);
    for (T& each : values) put(each);
  }
  template <class T>
  void put(std::optional<T>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  template <int Rows, int Columns>
  void put(cairn::Matrix<Rows, Columns>& m) {
    for (Eigen::Index i = 0; i < m.size(); ++i) put(m.data()[i]);
  }
  void put(cairn::SE2& pose) {
    for (const double n : {pose.x(), pose.y(), pose.angle()}) put(n);
  }
  template <class T>
    requires(!PlainNumber<T>)
  void put(T& value) {
    parts(*this, value);
  }

  cairn::BinaryWriter out_;
};

/// Throws cairn::Error, naming the file, for what is no such file, is damaged, ends before the values do, or
/// has a double that is not finite.
class Reader {
public:
  static constexpr bool reads = true;

  Reader(std::string_view bytes, std::string_view kind, std::uint64_t version, std::string name)
      : in_(bytes, kind, version, std::move(name)) {}

  template <class... T>
  void operator()(T&... values) {
    (take(values), ...);
  }
  void expect_end() const { in_.expect_end(); }
  [[noreturn]] void refuse(const std::string& why) const { cairn::raise(in_.name() + ": " + why); }

private:
  template <PlainNumber T>
  void take(T& number) {
    number = static_cast<T>(in_.get<InFile<T>>());
  }
  void take(double& number) { number = in_.finite(); }
  template <class T>
  void take(std::vector<T>& values) {
    constexpr std::size_t least_bytes = 1;
    const auto size = in_.count<std::uint64_t>(least_bytes);
    values.clear();
    for (std::size_t i = 0; i < size; ++i) take(values.emplace_back());
  }
  template <class T>
  void take(std::optional<T>& value) {
    bool there = false;
    take(there);
    value.reset();
    if (there) take(value.emplace());
  }
  template <int Rows, int Columns>
  void take(cairn::Matrix<Rows, Columns>& m) {
    for (Eigen::Index i = 0; i < m.size(); ++i) take(m.data()[i]);
  }
  void take(cairn::SE2& pose) {
    double x = 0, y = 0, angle = 0;
    (*this)(x, y, angle);
    pose = cairn::SE2(x, y, angle);
  }
  template <class T>
    requires(!PlainNumber<T>)
  void take(T& value) {
    parts(*this, value);
  }

  cairn::BinaryReader in_;
};

}  // namespace example
