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

/// The data folder where CAIRN_DATA names none; a program's main file may set it. A variable rather than a
/// macro: then only that one file is compiled anew where the checkout lies elsewhere.
inline const char* default_data_folder = nullptr;

/// Path of `name` below the data folder (CAIRN_DATA, or `default_data_folder`), or nothing when absent.
inline std::optional<std::filesystem::path> real_data(const std::string& name) {
  const char* root = std::getenv("CAIRN_DATA");
  if (root == nullptr) root = default_data_folder;
  if (root != nullptr) {
    const std::filesystem::path path = std::filesystem::path(root) / name;
    if (std::filesystem::exists(path)) return path;
  }
  std::cout << "skipped: no data (" << name << "; set CAIRN_DATA)\n";
  return std::nullopt;
}

}  // namespace cairn_test
