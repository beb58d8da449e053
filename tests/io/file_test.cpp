// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace file_test {
namespace {

namespace fs = std::filesystem;
using cairn::read_file;
using cairn::write_file_atomically;
using cairn_test::Folder;
using cairn_test::message_of;

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

unsigned mode_of(const fs::path& path) {
  struct stat status{};
  REQUIRE(::stat(path.c_str(), &status) == 0);
  return status.st_mode & 07777U;
}

bool refused_for(const fs::path& path, const std::string& why) {
  const std::string message = message_of([&] { write_file_atomically(path, "new"); });
  CAPTURE(message);
  const bool said = message.find(path.string() + ": cannot write (" + why + ")") == 0;
  CHECK(said);
  return said;
}

/// Runs `work` in a process of its own and returns its exit code; -1 where it was killed.
template <class Work>
int in_a_child(Work&& work) {
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    work();
    ::_exit(0);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// Starts `work` in a process of its own and kills that after `microseconds`.
template <class Work>
void in_a_child_that_is_killed(std::uint64_t microseconds, Work&& work) {
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    work();
    ::_exit(0);
  }
  std::this_thread::sleep_for(std::chrono::microseconds(microseconds));
  ::kill(child, SIGKILL);
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
}

}  // namespace

TEST_SUITE("file") {
  TEST_CASE("file: a write makes the file or replaces its bytes, and nothing stands beside it") {
    const Folder folder;
    write_file_atomically(folder / "a", "one");
    CHECK(read_file(folder / "a") == "one");
    write_file_atomically(folder / "a", std::string(100000, '\0'));
    CHECK(read_file(folder / "a") == std::string(100000, '\0'));
    write_file_atomically(folder / "a", "");
    CHECK(read_file(folder / "a").empty());
    CHECK(names_in(folder.path()) == std::set<std::string>{"a"});
    const fs::path before = fs::current_path();
    fs::current_path(folder.path());
    write_file_atomically("a", "relative");
    fs::current_path(before);
    CHECK(read_file(folder / "a") == "relative");
  }

  TEST_CASE("file: a replaced file keeps its mode, a new one has that of the process's mask") {
    const Folder folder;
    const ::mode_t mask = ::umask(027);
    write_file_atomically(folder / "new", "x");
    CHECK(mode_of(folder / "new") == 0640U);
    for (const ::mode_t mode : {0600U, 0644U, 0666U, 0755U, 0777U, 04755U, 02770U}) {
      CAPTURE(mode);
      folder.put("old", "before");
      REQUIRE(::chmod((folder / "old").c_str(), mode) == 0);
      write_file_atomically(folder / "old", "after");
      CHECK(mode_of(folder / "old") == mode);
      CHECK(read_file(folder / "old") == "after");
    }
    ::umask(mask);
  }

  TEST_CASE("file: a replaced file keeps its owner where this process may give files away") {
    if (::geteuid() != 0) {
      MESSAGE("skipped: not root");
      return;
    }
    const Folder folder;
    folder.put("theirs", "before");
    REQUIRE(::chown((folder / "theirs").c_str(), 1234, 4321) == 0);
    REQUIRE(::chmod((folder / "theirs").c_str(), 06751) == 0);
    write_file_atomically(folder / "theirs", "after");
    struct stat status{};
    REQUIRE(::stat((folder / "theirs").c_str(), &status) == 0);
    CHECK(status.st_uid == 1234);
    CHECK(status.st_gid == 4321);
    CHECK((status.st_mode & 07777U) == 06751U);
    // Who may not keeps the permissions without what they would lend to another owner.
    REQUIRE(::chmod(folder.path().c_str(), 0777) == 0);
    REQUIRE(::chmod((folder / "theirs").c_str(), 06777) == 0);
    CHECK(in_a_child([&] {
            if (::setgid(99) != 0 || ::setuid(99) != 0) ::_exit(3);
            write_file_atomically(folder / "theirs", "taken over");
          }) == 0);
    CHECK(read_file(folder / "theirs") == "taken over");
    CHECK(mode_of(folder / "theirs") == 0777U);
  }

  TEST_CASE("file: a file that may not be written is refused, and so is a folder that may not") {
    const Folder folder;
    folder.put("kept", "precious");
    fs::create_directory(folder / "shut");
    REQUIRE(::chmod((folder / "kept").c_str(), 0444) == 0);
    REQUIRE(::chmod((folder / "shut").c_str(), 0555) == 0);
    REQUIRE(::chmod(folder.path().c_str(), 0777) == 0);
    const auto denied = [&](const fs::path& path) {
      return in_a_child([&] {
        if (::geteuid() == 0 && ::setuid(99) != 0) ::_exit(3);
        const std::string message = message_of([&] { write_file_atomically(path, "new"); });
        ::_exit(message.find("cannot write (Permission denied)") != std::string::npos ? 0 : 1);
      });
    };
    CHECK(denied(folder / "kept") == 0);
    CHECK(denied(folder / "shut" / "a") == 0);
    CHECK(read_file(folder / "kept") == "precious");
    CHECK(names_in(folder.path()) == std::set<std::string>{"kept", "shut"});
  }

  TEST_CASE("file: a symbolic link stays, and what it leads to is replaced or made") {
    const Folder folder;
    fs::create_directory(folder / "far");
    fs::create_directory(folder / "links");
    folder.put("far/file", "old");
    REQUIRE(::chmod((folder / "far" / "file").c_str(), 0604) == 0);
    fs::create_symlink("../far/file", folder / "links" / "relative");
    fs::create_symlink(folder / "links" / "relative", folder / "links" / "chain");
    fs::create_symlink("../far/made", folder / "links" / "dangling");
    write_file_atomically(folder / "links" / "relative", "by link");
    CHECK(read_file(folder / "far" / "file") == "by link");
    write_file_atomically(folder / "links" / "chain", "by two");
    CHECK(read_file(folder / "far" / "file") == "by two");
    CHECK(mode_of(folder / "far" / "file") == 0604U);
    write_file_atomically(folder / "links" / "dangling", "made");
    CHECK(read_file(folder / "far" / "made") == "made");
    for (const char* link : {"relative", "chain", "dangling"})
      CHECK(fs::is_symlink(fs::symlink_status(folder / "links" / link)));
    CHECK(names_in(folder / "far") == std::set<std::string>{"file", "made"});
    CHECK(names_in(folder / "links") == std::set<std::string>{"relative", "chain", "dangling"});
    fs::create_symlink("circle", folder / "circle");
    CHECK(refused_for(folder / "circle", "Too many levels of symbolic links"));
    fs::create_symlink(folder / "far", folder / "to_folder");
    CHECK(refused_for(folder / "to_folder", "is a folder"));
    CHECK(refused_for(folder / "none" / "a", "No such file or directory"));
    folder.put("plain", "x");
    CHECK(refused_for(folder / "plain" / "a", "Not a directory"));
  }

  TEST_CASE("file: a pipe stays a pipe and its reader gets the bytes") {
    const Folder folder;
    REQUIRE(::mkfifo((folder / "pipe").c_str(), 0600) == 0);
    fs::create_symlink("pipe", folder / "to_pipe");
    const std::string sent(300000, 'x');  // more than a pipe holds
    for (const char* name : {"pipe", "to_pipe"}) {
      std::string received;
      std::thread reader([&] { received = read_file(folder / "pipe"); });
      write_file_atomically(folder / name, sent);
      reader.join();
      CHECK(received == sent);
      CHECK(fs::is_fifo(fs::symlink_status(folder / "pipe")));
    }
    CHECK(names_in(folder.path()) == std::set<std::string>{"pipe", "to_pipe"});
  }

  TEST_CASE("file: a device stays a device, and a full one is said to be full") {
    const Folder folder;
    fs::create_symlink("/dev/full", folder / "to_full");
    fs::create_symlink("/dev/null", folder / "to_null");
    CHECK(refused_for(folder / "to_full", "No space left on device"));
    write_file_atomically(folder / "to_null", "gone");
    CHECK(fs::is_symlink(fs::symlink_status(folder / "to_full")));
    CHECK(fs::is_symlink(fs::symlink_status(folder / "to_null")));
    // Devices of this test's own: a fault here, run by root, is not to take the machine's.
    if (::mknod((folder / "full").c_str(), S_IFCHR | 0666, ::makedev(1, 7)) != 0) {
      MESSAGE("skipped: no devices of its own (not root)");
      return;
    }
    if (const int can = ::open((folder / "full").c_str(), O_WRONLY); can >= 0) {
      ::close(can);
      CHECK(refused_for(folder / "full", "No space left on device"));
    }
    CHECK(fs::is_character_file(fs::symlink_status(folder / "full")));
  }

  TEST_CASE("file: what /proc names is written into as it is") {
    const Folder folder;
    folder.put("open", "before, and longer");
    const int file = ::open((folder / "open").c_str(), O_WRONLY);
    REQUIRE(file >= 0);
    write_file_atomically("/proc/self/fd/" + std::to_string(file), "by descriptor");
    ::close(file);
    CHECK(read_file(folder / "open") == "by descriptor");
    CHECK(names_in(folder.path()) == std::set<std::string>{"open"});
  }

  TEST_CASE("file: a write that fails half-way says why, leaves the old bytes and no part") {
    const Folder folder;
    folder.put("a", "old");
    const int code = in_a_child([&] {
      const rlimit limit{4096, 4096};
      std::signal(SIGXFSZ, SIG_IGN);
      if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) ::_exit(3);
      const std::string message =
          message_of([&] { write_file_atomically(folder / "a", std::string(100000, 'x')); });
      ::_exit(message.find("cannot write (File too large)") != std::string::npos ? 0 : 1);
    });
    CHECK(code == 0);
    CHECK(read_file(folder / "a") == "old");
    CHECK(names_in(folder.path()) == std::set<std::string>{"a"});
  }

  TEST_CASE("file: the part of a killed writer goes with the next write, that of a living one stays") {
    const Folder folder;
    for (const char* part : {"a.cairn-part", "a.cairn-part1", "a.cairn-part2"}) folder.put(part, "half");
    folder.put("b.cairn-part", "of another file");
    write_file_atomically(folder / "a", "whole");
    CHECK(names_in(folder.path()) == std::set<std::string>{"a", "b.cairn-part"});
    const int living = ::open((folder / "a.cairn-part").c_str(), O_WRONLY | O_CREAT, 0600);
    REQUIRE(living >= 0);
    REQUIRE(::flock(living, LOCK_EX | LOCK_NB) == 0);
    write_file_atomically(folder / "a", "second");
    CHECK(read_file(folder / "a") == "second");
    CHECK(names_in(folder.path()) == std::set<std::string>{"a", "a.cairn-part", "b.cairn-part"});
    ::close(living);
    // What stands in the way of the part and is no file is not followed and not removed.
    folder.put("precious", "kept");
    fs::remove(folder / "a.cairn-part");
    fs::create_symlink("precious", folder / "a.cairn-part");
    write_file_atomically(folder / "a", "third");
    CHECK(read_file(folder / "a") == "third");
    CHECK(read_file(folder / "precious") == "kept");
    CHECK(fs::is_symlink(fs::symlink_status(folder / "a.cairn-part")));
  }

  TEST_CASE("file: several writers of one file leave the bytes of one of them, and readers see whole files") {
    const Folder folder;
    write_file_atomically(folder / "a", std::string(20000, 'a'));
    std::atomic<bool> over{false};
    std::atomic<int> broken{0};
    std::vector<std::thread> threads;
    for (char letter = 'a'; letter < 'g'; ++letter)
      threads.emplace_back([&, letter] {
        for (int i = 0; i < 100; ++i) write_file_atomically(folder / "a", std::string(20000, letter));
      });
    std::thread reader([&] {
      while (!over) {
        const std::string bytes = read_file(folder / "a");
        if (bytes != std::string(20000, bytes.empty() ? '?' : bytes[0])) ++broken;
      }
    });
    for (std::thread& thread : threads) thread.join();
    over = true;
    reader.join();
    CHECK(broken == 0);
    CHECK(names_in(folder.path()) == std::set<std::string>{"a"});
  }

  TEST_CASE("file: a writer killed at any moment leaves the old bytes or the new") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const Folder folder;
    write_file_atomically(folder / "a", std::string(200000, 'a'));
    int parts = 0;
    for (int run = 0; run < 60 || (parts == 0 && run < 1000); ++run) {  // a busy machine starts none at first
      in_a_child_that_is_killed(random.below(run < 60 ? 4000 : 40000), [&] {
        for (char letter = 'a';; letter = letter == 'z' ? 'a' : static_cast<char>(letter + 1))
          write_file_atomically(folder / "a", std::string(200000, letter));
      });
      const std::string bytes = read_file(folder / "a");
      REQUIRE(bytes.size() == 200000);
      REQUIRE(bytes == std::string(200000, bytes[0]));
      REQUIRE(names_in(folder.path()).size() <= 2);
      parts += names_in(folder.path()).size() == 2;
    }
    CHECK(parts > 0);  // some were killed in the middle of a write
    write_file_atomically(folder / "a", "last");
    CHECK(names_in(folder.path()) == std::set<std::string>{"a"});
  }
}

}  // namespace file_test
