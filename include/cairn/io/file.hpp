// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Whole files in, whole files out: a file is read completely or refused, written completely or not at all.
///
/// write_file_atomically writes beside the target and renames over it, so that a reader sees the old bytes or
/// the new ones, also when the writer is killed (a power cut may still lose both: nothing waits for the
/// disk). The part that a killed writer leaves ends in .cairn-part and goes with the next write of that file;
/// the part of a writer that lives is locked (flock) and left alone. POSIX.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

struct CloseFile {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

/// A file descriptor that closes itself.
class Descriptor {
public:
  explicit Descriptor(int number = -1) noexcept : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { static_cast<void>(close()); }

  [[nodiscard]] explicit operator bool() const noexcept { return number_ >= 0; }
  [[nodiscard]] int number() const noexcept { return number_; }

  /// 0, or what errno says: a full disk may be heard of only here.
  [[nodiscard]] int close() noexcept {
    const int number = std::exchange(number_, -1);
    return number < 0 || ::close(number) == 0 || errno == EINTR ? 0 : errno;
  }

private:
  int number_;
};

/// Whether the name still leads to the open file.
[[nodiscard]] inline bool leads_to(const std::filesystem::path& path, const Descriptor& file) noexcept {
  struct stat by_name{}, opened{};
  return ::lstat(path.c_str(), &by_name) == 0 && ::fstat(file.number(), &opened) == 0 &&
         by_name.st_dev == opened.st_dev && by_name.st_ino == opened.st_ino;
}

}  // namespace detail

/// All bytes of the file. Throws Error naming the path and `expected` ("a TUM trajectory") when it is
/// missing, a folder or unreadable.
[[nodiscard]] std::string read_file(const std::filesystem::path& path, std::string_view expected = "a file");

/// Replaces the file at `path` by `bytes`, or throws Error naming it and why ("No space left on device") and
/// leaves it as it was.
///
/// A file that is there keeps its permissions, and its owner where this process may give files away (then
/// without set-user and set-group bits otherwise); one that may not be written is refused. Hard links, access
/// lists and extended attributes stay with the old bytes. A symbolic link stays: what it leads to is
/// replaced, or made. Devices, pipes and what /proc names are written into as they are, which nothing can
/// undo; a pipe waits for its reader.
void write_file_atomically(const std::filesystem::path& path, std::string_view bytes);

#if !CAIRN_ELSEWHERE  // else cairn::compiled holds the rest

namespace detail {

/// Writes all bytes; returns 0 or what errno says.
[[nodiscard]] inline int write_all(const Descriptor& file, std::string_view bytes) noexcept {
  constexpr std::size_t most_at_once = std::size_t{1} << 30U;
  while (!bytes.empty()) {
    const ::ssize_t count = ::write(file.number(), bytes.data(), bytes.substr(0, most_at_once).size());
    if (count >= 0)
      bytes.remove_prefix(static_cast<std::size_t>(count));
    else if (errno != EINTR)
      return errno;
  }
  return 0;
}

/// Removes a part whose writer is gone, as its lock tells. False where it lives, or is no part of ours.
inline bool remove_stale_part(const std::filesystem::path& path) noexcept {
  const Descriptor part(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!part) return errno == ENOENT;
  struct stat kind{};
  if (::fstat(part.number(), &kind) != 0 || !S_ISREG(kind.st_mode)) return false;
  if (::flock(part.number(), LOCK_EX | LOCK_NB) != 0) return false;
  return !leads_to(path, part) || ::unlink(path.c_str()) == 0;
}

/// A new file beside the target under a name that no other writer of this or another process uses. Removed at
/// the end unless it has taken the target's place.
class PartFile {
public:
  /// Makes it; `mode` are the permissions, of which the process's mask takes away. error() says where that
  /// failed.
  PartFile(std::filesystem::path target, ::mode_t mode) : target_(std::move(target)) {
    constexpr unsigned most_writers = 100;
    for (; number_ < most_writers; ++number_) {
      path_ = name(number_);
      for (int attempt = 0; attempt < 3; ++attempt) {
        file_ = Descriptor(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode));
        if (file_) {
          static_cast<void>(::flock(file_.number(), LOCK_EX));  // no locks there: then parts are left alone
          if (leads_to(path_, file_)) return;                   // nobody took it for stale in between
        } else if (errno != EEXIST) {
          error_ = errno;
          return;
        } else if (!remove_stale_part(path_)) {
          break;
        }
      }
    }
    file_ = Descriptor();
    error_ = EBUSY;
  }
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;
  ~PartFile() {
    if (file_) ::unlink(path_.c_str());
  }

  [[nodiscard]] int error() const noexcept { return error_; }
  [[nodiscard]] const Descriptor& file() const noexcept { return file_; }

  /// Puts it in the target's place; returns 0 or what errno says.
  [[nodiscard]] int deliver() noexcept {
    // Some file systems hear of a full disk when a file is closed. The lock is to hold until the name is free
    // again, so it is a copy that is closed first.
    Descriptor copy(::dup(file_.number()));
    if (!copy) return errno;
    if (const int error = copy.close(); error != 0) return error;
    if (::rename(path_.c_str(), target_.c_str()) != 0) return errno;
    static_cast<void>(file_.close());
    for (unsigned next = number_ + 1; next < number_ + 3; ++next)  // of several writers that were killed
      if (!remove_stale_part(name(next))) break;
    return 0;
  }

private:
  [[nodiscard]] std::filesystem::path name(unsigned number) const {
    std::filesystem::path path = target_;
    path += number == 0 ? ".cairn-part" : ".cairn-part" + std::to_string(number);
    return path;
  }

  std::filesystem::path target_, path_;
  unsigned number_ = 0;
  Descriptor file_;
  int error_ = 0;
};

/// Where a chain of symbolic links ends, be there a file or not. Nothing where the end cannot be replaced:
/// links of /proc (as /dev/stdout is one) lead to open files, not to names.
[[nodiscard]] inline std::filesystem::path end_of_links(std::filesystem::path path) {
  constexpr int most_links = 40;
  for (int links = 0; links < most_links; ++links) {
    std::error_code failure;
    if (!std::filesystem::is_symlink(std::filesystem::symlink_status(path, failure))) return path;
    const std::filesystem::path next = std::filesystem::read_symlink(path, failure);
    if (failure) return {};
    path = path.parent_path() / next;  // `next` alone where it is absolute
    if (path.native().starts_with("/proc/")) return {};
  }
  return {};
}

}  // namespace detail

CAIRN_INLINE std::string read_file(const std::filesystem::path& path, std::string_view expected) {
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

CAIRN_INLINE void write_file_atomically(const std::filesystem::path& path, std::string_view bytes) {
  const auto refuse = [&](const std::string& why) {
    raise(path.string() + ": cannot write (" + why + "); expected a file in a writable folder");
  };
  const auto check = [&](int error) {
    if (error != 0) refuse(std::strerror(error));
  };
  struct stat old{};
  const bool replaces = ::stat(path.c_str(), &old) == 0;
  if (!replaces && errno != ENOENT) check(errno);
  if (replaces && S_ISDIR(old.st_mode)) refuse("is a folder");

  const std::filesystem::path target = detail::end_of_links(path);
  if (replaces && (!S_ISREG(old.st_mode) || target.empty())) {
    detail::Descriptor file(::open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC | O_NOCTTY));
    if (!file) check(errno);
    check(detail::write_all(file, bytes));
    check(file.close());
    return;
  }
  if (target.empty()) check(ELOOP);
  if (replaces && ::faccessat(AT_FDCWD, target.c_str(), W_OK, AT_EACCESS) != 0) check(errno);
  // Never open to more readers than the file will be.
  detail::PartFile part(target, replaces ? old.st_mode & 0600U : 0666U);
  check(part.error());
  if (replaces) {
    struct stat made{};
    if (::fstat(part.file().number(), &made) != 0) check(errno);
    ::mode_t mode = old.st_mode & 07777U;
    if ((made.st_uid != old.st_uid || made.st_gid != old.st_gid) &&
        ::fchown(part.file().number(), old.st_uid, old.st_gid) != 0)
      mode &= 0777U;
    if (::fchmod(part.file().number(), mode) != 0) check(errno);
  }
  check(detail::write_all(part.file(), bytes));
  check(part.deliver());
}

#endif

}}  // namespace cairn::CAIRN_ABI
