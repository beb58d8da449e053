// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Files whose checksum is right whatever stands in them, for tests and fuzz targets: what a reader says of
/// numbers that nobody saved is heard only behind the checksum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include <cairn/io/binary_file.hpp>

namespace cairn_test {

/// A file of BinaryWriter's that holds these bytes.
inline std::string file_holding(std::string_view bytes, std::string_view kind, std::uint64_t version) {
  cairn::BinaryWriter out;
  for (const char byte : bytes) out.put(byte);
  return std::move(out).file(kind, version);
}

/// What such a file holds.
inline std::string held_by(std::string_view file) {
  return std::string(file.substr(cairn::detail::binary_header_bytes));
}

/// Writes into the eight bytes at `sum_at` the FNV-1a of all others from `begin` to `end`, least byte first.
/// Does nothing where the file has no such bytes.
inline void sign(std::string& file, std::size_t begin, std::size_t sum_at, std::size_t end) {
  if (end > file.size() || sum_at + 8 > end) return;
  std::uint64_t sum = 14695981039346656037ULL;
  for (std::size_t at = begin; at < end; ++at)
    if (at < sum_at || at >= sum_at + 8)
      sum = (sum ^ static_cast<unsigned char>(file[at])) * 1099511628211ULL;
  for (std::size_t i = 0; i < 8; ++i) file[sum_at + i] = static_cast<char>(sum >> (8 * i) & 255U);
}

/// The tree files' checksum: of all but the first eight bytes.
inline void sign(std::string& file, std::size_t sum_at) {
  sign(file, 8, sum_at, file.size());
}

}  // namespace cairn_test
