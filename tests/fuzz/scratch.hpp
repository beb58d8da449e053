// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What fuzz targets share: files made of the fuzzer's bytes, and promises that end the program when broken.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <unistd.h>

namespace cairn_fuzz {

/// Inputs that the target has refused so far, for the replay: a corpus of nothing else has another format
/// than the reader.
inline std::size_t refusals = 0;
inline int refused() {
  ++refusals;
  return 0;
}

/// The fuzzer sees an aborted program as a finding.
inline void expect(bool kept, const char* promise) {
  if (kept) return;
  std::fprintf(stderr, "broken promise: %s\n", promise);
  std::abort();
}

/// A folder of this process, in memory where the system has such a place; removed at the end.
class Scratch {
public:
  Scratch() {
    std::error_code failure;
    const std::filesystem::path memory = "/dev/shm";
    const auto parent = std::filesystem::is_directory(memory, failure) && ::access(memory.c_str(), W_OK) == 0
                            ? memory
                            : std::filesystem::temp_directory_path();
    path_ = parent / ("cairn-fuzz-" + std::to_string(::getpid()));
    std::filesystem::create_directories(path_);
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

  /// Makes the file `name` of these bytes and returns its path.
  std::filesystem::path put(const std::string& name, std::string_view bytes) const {
    std::filesystem::path path = path_ / name;
    std::error_code ignored;
    std::filesystem::create_directories(path.parent_path(), ignored);
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
    return path;
  }

private:
  std::filesystem::path path_;
};

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// The input as several files: they are separated by lines "====".
inline std::vector<std::string_view> files_of(std::string_view input, std::size_t count) {
  constexpr std::string_view separator = "====\n";
  std::vector<std::string_view> files;
  while (files.size() + 1 < count) {
    const std::size_t end = input.find(separator);
    files.push_back(input.substr(0, end));
    input = end == std::string_view::npos ? std::string_view{} : input.substr(end + separator.size());
  }
  files.push_back(input);
  return files;
}

}  // namespace cairn_fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
