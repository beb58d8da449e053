// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Reads the real arrays of a MATLAB level 5 file (MathWorks, "MAT-File Format", version 5). Needs zlib.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <zlib.h>

namespace cairn_test {

/// Numbers column by column; a cell array is the numbers of its cells, one after the other.
struct MatArray {
  std::vector<int> sizes;
  std::vector<double> numbers;
  [[nodiscard]] double operator()(std::size_t row, std::size_t column) const {
    return numbers.at(column * static_cast<std::size_t>(sizes.at(0)) + row);
  }
};

namespace mat_detail {

using Bytes = std::span<const char>;

struct Element {
  std::uint32_t type;
  Bytes data;
};

template <class T>
T read_as(Bytes bytes, std::size_t at) {
  T value;
  if (at + sizeof(T) > bytes.size()) throw std::runtime_error("mat file: truncated");
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

/// The element at the beginning of `bytes`, which then begin after it.
inline Element next_element(Bytes& bytes) {
  const auto word = read_as<std::uint32_t>(bytes, 0);
  const bool is_small = (word >> 16U) != 0;
  const std::size_t size = is_small ? word >> 16U : read_as<std::uint32_t>(bytes, 4);
  const std::uint32_t type = is_small ? word & 0xffffU : word;
  const std::size_t start = is_small ? 4 : 8;
  if (start + size > bytes.size()) throw std::runtime_error("mat file: truncated");
  const Element element{type, bytes.subspan(start, size)};
  const std::size_t padded = type == 15 ? size : (size + 7) / 8 * 8;
  bytes = bytes.subspan(std::min(bytes.size(), is_small ? std::size_t{8} : 8 + padded));
  return element;
}

template <class T>
void append(Bytes data, std::vector<double>& out) {
  for (std::size_t at = 0; at + sizeof(T) <= data.size(); at += sizeof(T))
    out.push_back(static_cast<double>(read_as<T>(data, at)));
}

inline std::string read_matrix(Bytes bytes, MatArray& out) {
  const Element flags = next_element(bytes);
  const Element sizes = next_element(bytes);
  const Element name = next_element(bytes);
  for (std::size_t at = 0; at < sizes.data.size(); at += 4)
    out.sizes.push_back(read_as<std::int32_t>(sizes.data, at));
  constexpr std::uint32_t cell = 1;
  if ((read_as<std::uint32_t>(flags.data, 0) & 0xffU) == cell) {
    while (!bytes.empty()) {
      MatArray part;
      read_matrix(next_element(bytes).data, part);
      out.numbers.insert(out.numbers.end(), part.numbers.begin(), part.numbers.end());
    }
  } else {
    const Element numbers = next_element(bytes);
    if (numbers.type == 1) append<std::int8_t>(numbers.data, out.numbers);
    if (numbers.type == 2) append<std::uint8_t>(numbers.data, out.numbers);
    if (numbers.type == 3) append<std::int16_t>(numbers.data, out.numbers);
    if (numbers.type == 4) append<std::uint16_t>(numbers.data, out.numbers);
    if (numbers.type == 5) append<std::int32_t>(numbers.data, out.numbers);
    if (numbers.type == 9) append<double>(numbers.data, out.numbers);
  }
  return {name.data.begin(), name.data.end()};
}

inline std::vector<char> inflated(Bytes data) {
  std::vector<char> out(data.size() * 8 + 1024);
  for (;;) {
    uLongf size = out.size();
    const int code = uncompress(reinterpret_cast<Bytef*>(out.data()), &size,
                                reinterpret_cast<const Bytef*>(data.data()), data.size());
    if (code == Z_OK) {
      out.resize(size);
      return out;
    }
    if (code != Z_BUF_ERROR || out.size() > (std::size_t{1} << 30U))
      throw std::runtime_error("mat file: cannot be inflated");
    out.resize(out.size() * 2);
  }
}

}  // namespace mat_detail

/// Every array of the file by its name.
inline std::map<std::string, MatArray> read_mat(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> all((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  if (all.size() < 128) throw std::runtime_error("mat file: no header");
  std::map<std::string, MatArray> arrays;
  mat_detail::Bytes bytes(all.data() + 128, all.size() - 128);
  while (bytes.size() >= 8) {
    mat_detail::Element element = mat_detail::next_element(bytes);
    constexpr std::uint32_t compressed = 15;
    std::vector<char> plain;
    if (element.type == compressed) {
      plain = mat_detail::inflated(element.data);
      mat_detail::Bytes inside(plain.data(), plain.size());
      element = mat_detail::next_element(inside);
    }
    MatArray array;
    const std::string name = mat_detail::read_matrix(element.data, array);
    arrays[name] = array;
  }
  return arrays;
}

}  // namespace cairn_test
