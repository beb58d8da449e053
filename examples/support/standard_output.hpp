// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a program says is a result too: that it did not get through must be heard of.
#pragma once

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <string>

namespace example {

/// Hands everything printed so far to whoever reads it. Where that fails (a full disk), or has failed before,
/// says so on standard error and returns false.
[[nodiscard]] inline bool flush_standard_output(const std::string& program) {
  errno = 0;
  const bool flushed = std::fflush(stdout) == 0 && std::cout.flush().good() && std::ferror(stdout) == 0;
  if (flushed) return true;
  std::cerr << program << ": cannot write to the standard output"
            << (errno != 0 ? std::string(" (") + std::strerror(errno) + ")" : "") << '\n';
  return false;
}

}  // namespace example
