// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Values to bytes and back, bit for bit: little-endian, with a mark in front and a sum behind.
///
/// One function template says what a type is made of, and serves both ways:
///   void parts(auto& archive, Loop& loop) { archive(loop.first, loop.last, loop.T_first_last, ...); }
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se2.hpp>

namespace grid_slam {

static_assert(std::endian::native == std::endian::little, "map files are little-endian");

template <class T>
concept PlainNumber = std::is_arithmetic_v<T> || std::is_enum_v<T>;

/// FNV-1a over words of 8 bytes: it is to notice damage, not malice.
[[nodiscard]] inline std::uint64_t sum_of(std::string_view bytes) noexcept {
  std::uint64_t sum = 0xcbf29ce484222325U;
  for (std::size_t i = 0; i < bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, std::min<std::size_t>(8, bytes.size() - i));
    sum = (sum ^ word) * 0x100000001b3U;
    sum ^= sum >> 29U;
  }
  return sum ^ bytes.size();
}

class Writer {
public:
  static constexpr bool reads = false;

  template <class... T>
  void operator()(T&... values) {
    (put(values), ...);
  }
  [[nodiscard]] const std::string& bytes() const noexcept { return bytes_; }

private:
  template <PlainNumber T>
  void put(const T& number) {
    bytes_.append(reinterpret_cast<const char*>(&number), sizeof number);
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

  std::string bytes_;
};

/// Throws cairn::Error, naming the file, where the bytes end before the values do.
class Reader {
public:
  static constexpr bool reads = true;

  Reader(std::string_view bytes, std::string name) : rest_(bytes), name_(std::move(name)) {}

  template <class... T>
  void operator()(T&... values) {
    (take(values), ...);
  }
  [[nodiscard]] bool at_end() const noexcept { return rest_.empty(); }
  [[noreturn]] void refuse(const std::string& why) const { cairn::raise(name_ + ": " + why); }

private:
  template <PlainNumber T>
  void take(T& number) {
    if (rest_.size() < sizeof number) refuse("the map ends too early");
    std::memcpy(&number, rest_.data(), sizeof number);
    rest_.remove_prefix(sizeof number);
  }
  template <class T>
  void take(std::vector<T>& values) {
    std::uint64_t size = 0;
    take(size);
    if (size > rest_.size()) refuse("the map ends too early");  // nothing is smaller than a byte
    values.clear();
    for (std::uint64_t i = 0; i < size; ++i) take(values.emplace_back());
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

  std::string_view rest_;
  std::string name_;
};

template <class Archive>
void parts(Archive& archive, cairn::Gaussian<cairn::SE2>& belief) {
  archive(belief.mean, belief.covariance);
}

}  // namespace grid_slam
