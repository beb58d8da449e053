// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Numbers as the bytes of a file that knows its kind, its version and whether it is whole.
///
///   bytes 0-7    eight letters that name the kind of file
///   8-15         version of the format                            all numbers little-endian
///   16-23        bytes that follow from 32 on
///   24-31        FNV-1a checksum (64 bits) of bytes 8-23 and of all from 32 on
///   32-          numbers, as they were put
///
/// ```cpp
/// cairn::BinaryWriter out;
/// out.put(std::uint32_t{2});
/// for (const double x : {1.5, 2.5}) out.put(x);
/// const std::string bytes = out.file("example ", 1);
///
/// cairn::BinaryReader in(bytes, "example ", 1, "an example");  // throws where anything is wrong
/// double sum = 0;
/// std::size_t left = in.count<std::uint32_t>(sizeof(double));
/// for (; left > 0; --left) sum += in.get<double>();
/// in.expect_end();
/// ```
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What can be put into a file: a number whose bytes are its value.
template <class T>
concept FileNumber =
    (std::is_integral_v<T> || std::is_floating_point_v<T>) && !std::is_same_v<T, bool> && sizeof(T) <= 8;

namespace detail {

static_assert(std::endian::native == std::endian::little,
              "binary files are written as memory on little-endian machines");

inline constexpr std::size_t binary_header_bytes = 32;

[[nodiscard]] inline std::uint64_t binary_checksum(std::string_view sizes,
                                                   std::string_view numbers) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325ULL;  // FNV-1a
  for (const std::string_view part : {sizes, numbers})
    for (const char byte : part) hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3ULL;
  return hash;
}

}  // namespace detail

/// Gathers numbers.
class BinaryWriter {
public:
  template <FileNumber T>
  void put(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    numbers_.append(bytes, sizeof(T));
  }

  /// The whole file. `kind` has eight letters.
  [[nodiscard]] std::string file(std::string_view kind, std::uint64_t version) const& {
    return BinaryWriter(*this).file(kind, version);
  }
  /// The same of a writer that is not needed any more: the numbers are there but once.
  [[nodiscard]] std::string file(std::string_view kind, std::uint64_t version) && {
    CAIRN_EXPECTS(kind.size() == 8, "BinaryWriter: a kind of file is named by eight letters");
    BinaryWriter head;
    head.put(version);
    head.put(std::uint64_t{numbers_.size()});
    head.put(detail::binary_checksum(head.numbers_, numbers_));
    numbers_.insert(0, std::string(kind) + head.numbers_);
    return std::move(numbers_);
  }

private:
  std::string numbers_;
};

/// Takes them out again in the same order. `bytes` must live on; `name` is the source's, for messages.
class BinaryReader {
public:
  /// Throws Error for bytes of another kind, a version that is not `version`, and what is cut, longer or
  /// damaged.
  BinaryReader(std::string_view bytes, std::string_view kind, std::uint64_t version, std::string name)
      : rest_(bytes), name_(std::move(name)) {
    CAIRN_EXPECTS(kind.size() == 8, "BinaryReader: a kind of file is named by eight letters");
    if (!bytes.starts_with(kind)) raise(name_ + ": no file of the kind '" + std::string(kind) + "'");
    if (bytes.size() < detail::binary_header_bytes) raise(name_ + ": the file ends within its head");
    rest_.remove_prefix(kind.size());
    const std::string_view sizes = rest_.substr(0, 16);
    const auto found = get<std::uint64_t>(), size = get<std::uint64_t>(), checksum = get<std::uint64_t>();
    if (found != version)
      raise(name_ + ": version " + std::to_string(found) + " of the format, expected " +
            std::to_string(version));
    if (size != rest_.size())
      raise(name_ + ": " + std::to_string(rest_.size()) + " bytes after the head, expected " +
            std::to_string(size));
    if (detail::binary_checksum(sizes, rest_) != checksum)
      raise(name_ + ": the checksum is wrong, the file is damaged");
  }

  /// The next number. Throws Error where there is none.
  template <FileNumber T>
  [[nodiscard]] T get() {
    if (rest_.size() < sizeof(T)) raise(name_ + ": the file has fewer numbers than it says");
    T value;
    rest_.copy(reinterpret_cast<char*>(&value), sizeof(T));
    rest_.remove_prefix(sizeof(T));
    return value;
  }
  /// The next number, which must be finite. Throws Error where it is not.
  [[nodiscard]] double finite() {
    const auto value = get<double>();
    if (!std::isfinite(value)) raise(name_ + ": a number is not finite");
    return value;
  }
  /// The next number, of things that take at least `bytes_each`: no more than the rest of the file can hold,
  /// so that memory may be set aside for them.
  template <FileNumber T>
  [[nodiscard]] std::size_t count(std::size_t bytes_each) {
    const auto value = get<T>();
    if (std::cmp_less(value, 0) || std::cmp_greater(value, rest_.size() / bytes_each))
      raise(name_ + ": the file promises more than it holds");
    return static_cast<std::size_t>(value);
  }
  /// Throws Error where numbers are left.
  void expect_end() const {
    if (!rest_.empty()) raise(name_ + ": the file has more numbers than it says");
  }
  /// Bytes not yet taken.
  [[nodiscard]] std::size_t left() const noexcept { return rest_.size(); }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

private:
  std::string_view rest_;
  std::string name_;
};

}}  // namespace cairn::CAIRN_ABI
