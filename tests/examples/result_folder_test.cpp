// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/result_folder.hpp"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace result_folder_test {
namespace {

namespace fs = std::filesystem;
using cairn::read_file;
using cairn_test::Folder;
using cairn_test::message_of;
using Names = std::set<std::string>;

const std::vector<std::string> results{"a.txt", "b.txt", "c.txt", "d.txt", "e.txt"};

Names names_in(const fs::path& folder) {
  Names names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

/// Results of the run of this number: of an odd one "e.txt" is missing.
void fill(const fs::path& staging, int run, std::size_t size = 20) {
  const std::string bytes = std::to_string(run) + std::string(size, '.');
  for (const std::string& name : results)
    if (run % 2 == 0 || name != "e.txt") cairn::write_file_atomically(staging / name, bytes);
}

/// The number of the run whose complete results are there; -1 where there are those of several or of none.
int run_in(const fs::path& folder, std::size_t size = 20) {
  const std::string bytes = read_file(folder / "a.txt");
  const int run = std::stoi(bytes);
  if (bytes != std::to_string(run) + std::string(size, '.')) return -1;
  for (const std::string& name : results) {
    const bool expected = run % 2 == 0 || name != "e.txt";
    if (fs::exists(folder / name) != expected) return -1;
    if (expected && read_file(folder / name) != bytes) return -1;
  }
  return run;
}

void write(const fs::path& folder, int run) {
  example::ResultFolder(folder, results).replace([&](const fs::path& staging) { fill(staging, run); });
}

/// What makes two folders that change places impossible: something else stands in this one.
void add_foreign(const fs::path& folder) {
  fs::create_directories(folder / "mine");
  cairn::write_file_atomically(folder / "notes.txt", "mine");
}

/// Writes results of one run after another in processes that are killed at random moments, and looks each
/// time. Returns how often a part was left.
int kill_writers(const Folder& folder, bool foreign) {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  const fs::path out = folder / "out";
  constexpr std::size_t size = 100000;
  const example::ResultFolder writer(out, results);
  const auto begin = std::chrono::steady_clock::now();
  writer.replace([&](const fs::path& staging) { fill(staging, 0, size); });
  const auto one = std::chrono::steady_clock::now() - begin;
  // Time for a few of them, also on a busy machine.
  const auto longest = static_cast<std::uint64_t>(
      std::max<std::int64_t>(9000, 6 * std::chrono::duration_cast<std::chrono::microseconds>(one).count()));
  if (foreign) add_foreign(out);
  int parts = 0, last = 0;
  for (int kill = 0; kill < 60; ++kill) {
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      for (int run = last + 1;; ++run)
        writer.replace([&](const fs::path& staging) { fill(staging, run, size); });
    }
    std::this_thread::sleep_for(std::chrono::microseconds(random.below(longest)));
    ::kill(child, SIGKILL);
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    parts += names_in(folder.path()).size() > 1 || names_in(out).contains(".cairn-part") ||
             names_in(out).contains(".cairn-results");
    if (foreign) writer.prepare();  // as the next run does first
    const int run = run_in(out, size);
    REQUIRE(run >= last);
    last = run;
  }
  CHECK(last > 10);
  writer.prepare();
  CHECK(run_in(out, size) == last);
  CHECK(names_in(folder.path()) == Names{"out"});
  Names left{"a.txt", "b.txt", "c.txt", "d.txt"};
  if (last % 2 == 0) left.insert("e.txt");
  if (foreign) left.merge(Names{"mine", "notes.txt"});
  CHECK(names_in(out) == left);
  return parts;
}

}  // namespace

TEST_SUITE("examples/result_folder") {
  TEST_CASE("result folder: the results of one run take the place of those of another") {
    const Folder folder;
    const fs::path out = folder / "new" / "out";
    for (const bool foreign : {false, true}) {
      for (int run = 0; run < 4; ++run) {
        write(out, run);
        CHECK(run_in(out) == run);
      }
      CHECK(names_in(folder / "new") == Names{"out"});
      if (foreign) {
        CHECK(names_in(out) == Names{"a.txt", "b.txt", "c.txt", "d.txt", "mine", "notes.txt"});
        CHECK(read_file(out / "notes.txt") == "mine");
      } else {
        CHECK(names_in(out) == Names{"a.txt", "b.txt", "c.txt", "d.txt"});
        add_foreign(out);
      }
    }
  }

  TEST_CASE("result folder: what is not finished is not delivered") {
    const Folder folder;
    for (const bool foreign : {false, true}) {
      const fs::path out = folder / (foreign ? "shared" : "own");
      write(out, 6);
      if (foreign) add_foreign(out);
      const Names before = names_in(out);
      CHECK_THROWS_AS(example::ResultFolder(out, results).replace([&](const fs::path& staging) {
        cairn::write_file_atomically(staging / "a.txt", "half");
        throw std::runtime_error("the disk is full");
      }),
                      std::runtime_error);
      CHECK(run_in(out) == 6);
      CHECK(names_in(out) == before);
    }
    CHECK(names_in(folder.path()) == Names{"own", "shared"});
  }

  TEST_CASE("result folder: permissions stay, of the folder and of what is replaced") {
    const Folder folder;
    for (const bool foreign : {false, true}) {
      const fs::path out = folder / (foreign ? "shared" : "own");
      write(out, 0);
      if (foreign) add_foreign(out);
      REQUIRE(::chmod(out.c_str(), 0710) == 0);
      REQUIRE(::chmod((out / "b.txt").c_str(), 0604) == 0);
      write(out, 2);
      CHECK(run_in(out) == 2);
      CHECK(fs::status(out).permissions() == fs::perms{0710});
      CHECK(fs::status(out / "b.txt").permissions() == fs::perms{0604});
    }
  }

  TEST_CASE("result folder: links and pipes stay, also where a run has no such file") {
    const Folder folder;
    const fs::path out = folder / "out";
    fs::create_directories(out);
    fs::create_symlink("../published", out / "b.txt");
    fs::create_symlink("/dev/null", out / "e.txt");
    write(out, 2);
    CHECK(read_file(folder / "published") == read_file(out / "a.txt"));
    write(out, 3);
    CHECK(read_file(folder / "published") == read_file(out / "a.txt"));
    CHECK(fs::is_symlink(fs::symlink_status(out / "b.txt")));
    CHECK(fs::is_symlink(fs::symlink_status(out / "e.txt")));
    CHECK(names_in(out) == Names{"a.txt", "b.txt", "c.txt", "d.txt", "e.txt"});
  }

  TEST_CASE("result folder: may be a link, the working folder, or be named with a slash") {
    const Folder folder;
    fs::create_directories(folder / "real");
    fs::create_directory_symlink("real", folder / "link");
    write(folder / "link", 2);
    CHECK(run_in(folder / "real") == 2);
    CHECK(fs::is_symlink(fs::symlink_status(folder / "link")));
    write((folder / "link").string() + "/", 4);
    CHECK(run_in(folder / "real") == 4);
    const fs::path before = fs::current_path();
    fs::current_path(folder / "real");
    write(".", 6);
    CHECK(run_in(".") == 6);  // who stands there still does
    write("../link/../real", 8);
    CHECK(run_in(".") == 8);
    fs::current_path(before);
    CHECK(names_in(folder.path()) == Names{"real", "link"});
  }

  TEST_CASE("result folder: who may not write beside the folder writes into it") {
    if (::geteuid() != 0) {
      MESSAGE("skipped: not root");
      return;
    }
    const Folder folder;
    fs::create_directories(folder / "out");
    REQUIRE(::chmod((folder / "out").c_str(), 0777) == 0);
    REQUIRE(::chmod(folder.path().c_str(), 0755) == 0);
    for (const int run : {2, 3}) {
      const pid_t child = ::fork();
      REQUIRE(child >= 0);
      if (child == 0) {
        if (::setuid(99) != 0) ::_exit(3);
        write(folder / "out", run);
        ::_exit(message_of([&] { write(folder / "other", run); }).find("Permission denied") !=
                        std::string::npos
                    ? 0
                    : 1);
      }
      int status = 0;
      REQUIRE(::waitpid(child, &status, 0) == child);
      CHECK(status == 0);
      CHECK(run_in(folder / "out") == run);
    }
    CHECK(names_in(folder.path()) == Names{"out"});
  }

  TEST_CASE("result folder: a folder that cannot be is named, and so is one in a result's place") {
    const Folder folder;
    folder.put("file", "in the way");
    for (const fs::path& impossible : {folder / "file", folder / "file" / "out"})
      CHECK(message_of([&] {
              example::ResultFolder(impossible, results).prepare();
            }).find(impossible.string() + ": cannot write there (") == 0);
    fs::create_directories(folder / "out" / "c.txt");
    CHECK(message_of([&] { write(folder / "out", 1); }) ==
          (folder / "out" / "c.txt").string() + ": is a folder; expected a file or nothing");
    CHECK(names_in(folder / "out") == Names{"c.txt"});
  }

  TEST_CASE("result folder: what is written besides has a name of its own, in a folder that there is") {
    const Folder folder;
    const fs::path out = folder / "out";
    const auto said_of = [&](const std::vector<fs::path>& besides) {
      return message_of([&] { example::ResultFolder(out, results).prepare(besides); });
    };
    CHECK(said_of({"", folder / "map", out / "map", ""}).empty());
    fs::create_directory_symlink(out, folder / "link");
    folder.put("out/b.txt", "");
    fs::create_symlink(out / "b.txt", folder / "file");
    for (const fs::path& taken : {out / "a.txt", folder / "link" / "a.txt", out / ".." / "out" / "e.txt",
                                  fs::relative(out / "c.txt"), folder / "file"})
      CHECK(said_of({"", taken}) == taken.string() + ": a result of the run has this name; expected another");
    CHECK(said_of({folder / "map", folder / "link" / ".." / "map"}).find(": expected a name for each file") !=
          std::string::npos);
    for (const fs::path& nowhere : {folder / "no" / "map", out, folder / "map" / ""})
      CHECK(said_of({nowhere}) ==
            nowhere.string() + ": expected the name of a file in a folder that there is");
  }

  TEST_CASE("result folder: the folder of a living run is left alone, what a killed one left is not") {
    const Folder folder;
    const fs::path out = folder / "out";
    write(out, 2);
    fs::create_directories(folder / "out.cairn-part");
    folder.put("out.cairn-part/a.txt", "half");
    folder.put("out.cairn-part/late.txt", "came between");
    fs::create_directories(folder / "out.cairn-part1");
    const int living = ::open((folder / "out.cairn-part1").c_str(), O_RDONLY | O_DIRECTORY);
    REQUIRE(living >= 0);
    REQUIRE(::flock(living, LOCK_EX | LOCK_NB) == 0);
    example::ResultFolder(out, results).prepare();
    CHECK(names_in(folder.path()) == Names{"out", "out.cairn-part1"});
    CHECK(run_in(out) == 2);
    CHECK(read_file(out / "late.txt") == "came between");
    ::close(living);
    write(out, 4);
    CHECK(run_in(out) == 4);
    CHECK(names_in(folder.path()) == Names{"out"});
  }

  TEST_CASE("result folder: a delivery that was cut short anywhere is completed by the next run") {
    for (std::size_t moved = 0; moved <= results.size(); ++moved) {
      CAPTURE(moved);
      const Folder folder;
      const fs::path out = folder / "out";
      write(out, 2);
      add_foreign(out);
      // The completed set of run 3, which has no e.txt, of which some files were moved.
      fs::create_directories(out / ".cairn-results");
      fill(out / ".cairn-results", 3);
      cairn::write_file_atomically(out / ".cairn-results" / "e.txt.absent", "");
      for (std::size_t i = 0; i < moved; ++i)
        if (results[i] == "e.txt") {
          fs::remove(out / "e.txt");
          fs::remove(out / ".cairn-results" / "e.txt.absent");
        } else {
          fs::rename(out / ".cairn-results" / results[i], out / results[i]);
        }
      example::ResultFolder(out, results).prepare();
      CHECK(run_in(out) == 3);
      CHECK(names_in(out) == Names{"a.txt", "b.txt", "c.txt", "d.txt", "mine", "notes.txt"});
    }
  }

  TEST_CASE("result folder: a run killed at any moment leaves the old results or the new") {
    const Folder folder;
    CHECK(kill_writers(folder, false) > 0);  // some in the middle of the work
  }

  TEST_CASE("result folder: killed where other files stand, the next run finds the old results or the new") {
    const Folder folder;
    CHECK(kill_writers(folder, true) > 0);
  }

  TEST_CASE("result folder: runs that write at the same time leave the results of one of them") {
    const Folder folder;
    for (const bool foreign : {false, true}) {
      const fs::path out = folder / (foreign ? "shared" : "own");
      write(out, 0);
      if (foreign) add_foreign(out);
      std::vector<std::thread> threads;
      for (int thread = 0; thread < 4; ++thread)
        threads.emplace_back([&, thread] {
          for (int run = 0; run < 20; ++run) write(out, 100 * thread + run);
        });
      for (std::thread& thread : threads) thread.join();
      CHECK(run_in(out) % 100 == 19);
      Names left{"a.txt", "b.txt", "c.txt", "d.txt"};
      if (foreign) left.merge(Names{"mine", "notes.txt"});
      CHECK(names_in(out) == left);
    }
    CHECK(names_in(folder.path()) == Names{"own", "shared"});
  }
}

}  // namespace result_folder_test
