// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Reading the descriptors of the TEXMEX sets (.bvecs).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <vector>

namespace cairn_test {

/// Vectors of bytes, each after its length, as one row of floats after the other.
inline std::vector<float> read_bvecs(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<float> rows;
  std::vector<std::uint8_t> row;
  std::int32_t dim = 0;
  while (file.read(reinterpret_cast<char*>(&dim), 4)) {
    row.resize(static_cast<std::size_t>(dim));
    file.read(reinterpret_cast<char*>(row.data()), dim);
    rows.insert(rows.end(), row.begin(), row.end());
  }
  return rows;
}

}  // namespace cairn_test
