// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where real data lives: the folder CAIRN_DATA names. Tests that need it say so and skip without it.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>

namespace cairn_test {

/// Path of `name` below the data folder (CAIRN_DATA, or CAIRN_DEFAULT_DATA of the build), or nothing when
/// absent.
inline std::optional<std::filesystem::path> real_data(const std::string& name) {
  const char* root = std::getenv("CAIRN_DATA");
#ifdef CAIRN_DEFAULT_DATA
  if (root == nullptr) root = CAIRN_DEFAULT_DATA;
#endif
  if (root != nullptr) {
    const std::filesystem::path path = std::filesystem::path(root) / name;
    if (std::filesystem::exists(path)) return path;
  }
  std::cout << "skipped: no data (" << name << "; set CAIRN_DATA)\n";
  return std::nullopt;
}

}  // namespace cairn_test
