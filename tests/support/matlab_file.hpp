// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Files of MATLAB 5 with columns of numbers, for tests of what reads them.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace cairn_test {

/// Columns of doubles by their names.
inline std::string matlab_file(const std::vector<std::pair<std::string, std::vector<double>>>& columns) {
  const auto word = [](std::size_t value) {
    const auto small = static_cast<std::uint32_t>(value);
    char bytes[4];
    std::memcpy(bytes, &small, sizeof bytes);
    return std::string(bytes, 4);
  };
  const auto element = [&](std::size_t type, std::string bytes) {
    const std::string head = word(type) + word(bytes.size());
    bytes.resize((bytes.size() + 7) / 8 * 8, '\0');
    return head + bytes;
  };
  std::string file = "MATLAB 5.0 MAT-file, for a test";
  file.resize(124, ' ');
  file += std::string("\0\1IM", 4);
  for (const auto& [name, values] : columns) {
    std::string numbers(values.size() * sizeof(double), '\0');
    if (!values.empty()) std::memcpy(numbers.data(), values.data(), numbers.size());
    file += element(14, element(6, word(6) + word(0)) + element(5, word(values.size()) + word(1)) +
                            element(1, name) + element(9, numbers));
  }
  return file;
}

}  // namespace cairn_test
