// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The arrays of real numbers of a MATLAB file of level 5 (MathWorks, "MAT-File Format", ch. 1): elements of
/// a type, a size and so many bytes, rounded up to eight; an array is an element of elements, for its flags,
/// sizes, name and numbers, and may be deflated, which needs zlib (EXAMPLES_HAVE_ZLIB).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#ifdef EXAMPLES_HAVE_ZLIB
#include <zlib.h>
#endif

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>

namespace example {

/// Numbers column by column; a cell array is the numbers of its cells, one after the other.
struct MatArray {
  std::vector<std::size_t> sizes;
  std::vector<double> numbers;
  [[nodiscard]] double operator()(std::size_t row, std::size_t column) const {
    return numbers.at(column * sizes.at(0) + row);
  }
};

/// Texts, structures, sparse and complex arrays are passed over.
class MatFile {
public:
  /// Throws cairn::Error naming the file and what was expected of it.
  explicit MatFile(const std::filesystem::path& path) : name_(path.string()) {
    const std::string bytes = cairn::read_file(path, "a MATLAB file");
    constexpr std::size_t header = 128;
    if (bytes.size() < header || bytes.substr(124, 4) != std::string_view("\0\1IM", 4))
      fail("a MATLAB file of level 5, little-endian");
    for (std::string_view rest = std::string_view(bytes).substr(header); !rest.empty();) {
      const Element element = next(rest);
      if (element.type == deflated) {
        const std::string plain = inflated(element.bytes);
        std::string_view inside = plain;
        read_array(next(inside));
      } else {
        read_array(element);
      }
    }
  }

  [[nodiscard]] const MatArray& operator[](const std::string& name) const {
    const auto found = arrays_.find(name);
    if (found == arrays_.end()) fail("an array " + name + " of real numbers");
    return found->second;
  }
  /// The numbers of an array, all of them finite.
  [[nodiscard]] const std::vector<double>& finite(const std::string& name) const {
    const std::vector<double>& numbers = (*this)[name].numbers;
    if (!std::ranges::all_of(numbers, [](double v) { return std::isfinite(v); }))
      fail("finite numbers in " + name);
    return numbers;
  }
  [[noreturn]] void fail(const std::string& expected) const {
    cairn::raise(name_ + ": expected " + expected);
  }

private:
  enum Type : std::uint32_t { array_type = 14, deflated = 15 };
  struct Element {
    std::uint32_t type = 0;
    std::string_view bytes{};
  };

  template <class T>
  static T read(std::string_view bytes, std::size_t at) {
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  }
  /// The element at the beginning of `rest`, which begins behind it afterwards.
  Element next(std::string_view& rest) const {
    constexpr std::size_t head = 8, small = 4;
    if (rest.size() < head) fail("elements that end where their array does");
    const auto word = read<std::uint32_t>(rest, 0);
    if (word >> 16U != 0) {  // type and size in one word, the bytes in the next
      if (word >> 16U > small) fail("small elements of up to four bytes");
      const Element found{word & 0xffffU, rest.substr(small, word >> 16U)};
      rest.remove_prefix(head);
      return found;
    }
    const std::size_t size = read<std::uint32_t>(rest, small);
    if (size > rest.size() - head) fail("elements that end where their array does");
    const Element found{word, rest.substr(head, size)};
    rest.remove_prefix(std::min(rest.size(), head + (word == deflated ? size : (size + 7) / 8 * 8)));
    return found;
  }

  void read_array(const Element& element) {
    MatArray array;
    if (const auto name = append_array(element, array)) arrays_[*name] = std::move(array);
  }
  /// Appends an array's numbers; its name, or nothing where they are no real numbers.
  std::optional<std::string> append_array(const Element& element, MatArray& array, int depth = 0) const {
    constexpr std::uint32_t cell = 1, first_number = 6, last_number = 15, complex = 0x800;
    constexpr int deepest = 8;
    if (element.type != array_type) fail("arrays and nothing else");
    std::string_view rest = element.bytes;
    const Element flags = next(rest);
    if (flags.bytes.size() < sizeof(std::uint32_t)) fail("flags of an array");
    const auto word = read<std::uint32_t>(flags.bytes, 0);
    const std::uint32_t kind = word & 0xffU;
    if (kind != cell && (kind < first_number || kind > last_number || (word & complex) != 0)) return {};
    const Element sizes = next(rest), name = next(rest);
    if (sizes.bytes.size() % sizeof(std::int32_t) != 0) fail("whole sizes of an array");
    double count = 1;
    for (std::size_t at = 0; at < sizes.bytes.size(); at += sizeof(std::int32_t)) {
      const auto size = read<std::int32_t>(sizes.bytes, at);
      if (size < 0) fail("sizes of an array that are not negative");
      array.sizes.push_back(static_cast<std::size_t>(size));
      count *= size;
    }
    if (kind != cell) {
      append(next(rest), array.numbers);
      if (static_cast<double>(array.numbers.size()) != count) fail("as many numbers as an array's sizes say");
    }
    for (; kind == cell && !rest.empty();) {
      if (depth == deepest) fail("cells within cells no more than eight deep");
      MatArray part;
      if (!append_array(next(rest), part, depth + 1)) return {};
      array.numbers.insert(array.numbers.end(), part.numbers.begin(), part.numbers.end());
    }
    return std::string(name.bytes);
  }

  template <class T>
  void append_as(std::string_view bytes, std::vector<double>& all) const {
    if (bytes.size() % sizeof(T) != 0) fail("whole numbers of bytes");
    for (std::size_t at = 0; at < bytes.size(); at += sizeof(T))
      all.push_back(static_cast<double>(read<T>(bytes, at)));
  }
  void append(const Element& e, std::vector<double>& all) const {
    switch (e.type) {
      case 1:
        return append_as<std::int8_t>(e.bytes, all);
      case 2:
        return append_as<std::uint8_t>(e.bytes, all);
      case 3:
        return append_as<std::int16_t>(e.bytes, all);
      case 4:
        return append_as<std::uint16_t>(e.bytes, all);
      case 5:
        return append_as<std::int32_t>(e.bytes, all);
      case 6:
        return append_as<std::uint32_t>(e.bytes, all);
      case 7:
        return append_as<float>(e.bytes, all);
      case 9:
        return append_as<double>(e.bytes, all);
      case 12:
        return append_as<std::int64_t>(e.bytes, all);
      case 13:
        return append_as<std::uint64_t>(e.bytes, all);
      default:
        fail("numbers of a type that MATLAB 5 writes");
    }
  }

#ifdef EXAMPLES_HAVE_ZLIB
  [[nodiscard]] std::string inflated(std::string_view bytes) const {
    const std::size_t most = 1100 * bytes.size() + 1024;  // nothing is deflated to less than a thousandth
    for (std::size_t room = 8 * bytes.size() + 1024;; room *= 2) {
      std::string plain(room, '\0');
      uLongf size = room;
      const int code = uncompress(reinterpret_cast<Bytef*>(plain.data()), &size,
                                  reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
      if (code == Z_OK) {
        plain.resize(size);
        return plain;
      }
      if (code != Z_BUF_ERROR || room > most) fail("deflated arrays that can be inflated");
    }
  }
#else
  [[nodiscard]] std::string inflated(std::string_view) const {
    fail("no deflated arrays: this was built without zlib (Debian: zlib1g-dev)");
  }
#endif

  std::string name_;
  std::map<std::string, MatArray> arrays_;
};

}  // namespace example
