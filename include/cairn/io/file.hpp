// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Whole files in, whole files out: a file is read completely or refused, written completely or not at all.
///
/// write_file_atomically writes beside the target and renames over it, so that a reader sees the old bytes or
/// the new ones, and an interrupted or failed write leaves no fragment under the target's name.
#pragma once

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

namespace detail {

struct CloseFile {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

/// A name beside `path` that no other writer of this or another process uses: clock and counter, and the
/// exclusive open decides.
inline std::filesystem::path temporary_beside(const std::filesystem::path& path) {
  static std::atomic<unsigned> counter{0};
  const auto ticks = std::chrono::steady_clock::now().time_since_epoch().count();
  std::filesystem::path temporary = path;
  temporary += ".part-" + std::to_string(ticks) + "-" + std::to_string(counter++);
  return temporary;
}

}  // namespace detail

/// All bytes of the file. Throws Error naming the path and `expected` ("a TUM trajectory") when it is
/// missing, a folder or unreadable.
[[nodiscard]] inline std::string read_file(const std::filesystem::path& path,
                                           std::string_view expected = "a file") {
  const auto refuse = [&](const std::string& why) {
    raise(path.string() + ": " + why + "; expected " + std::string(expected));
  };
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) refuse("no such file");
  if (std::filesystem::is_directory(path, ignored)) refuse("is a folder");
  const detail::File file(std::fopen(path.c_str(), "rb"));
  if (!file) refuse(std::string("cannot open (") + std::strerror(errno) + ")");
  std::string bytes;
  char block[1 << 16];
  while (const std::size_t count = std::fread(block, 1, sizeof block, file.get())) bytes.append(block, count);
  if (std::ferror(file.get()) != 0) refuse("cannot read");
  return bytes;
}

/// Replaces the file at `path` by `bytes`, or throws Error naming it and leaves it as it was.
inline void write_file_atomically(const std::filesystem::path& path, std::string_view bytes) {
  const std::filesystem::path temporary = detail::temporary_beside(path);
  const auto refuse = [&](const std::string& why) {
    raise(path.string() + ": cannot write (" + why + "); expected a file in a writable folder");
  };
  detail::File file(std::fopen(temporary.c_str(), "wbx"));
  if (!file) refuse(std::strerror(errno));
  bool written = std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size();
  written = std::fclose(file.release()) == 0 && written;
  std::error_code failure;
  if (written)
    std::filesystem::rename(temporary, path, failure);
  else
    failure = std::make_error_code(std::errc::io_error);
  if (failure) {
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    refuse(failure.message());
  }
}

}  // namespace cairn::inline CAIRN_ABI
