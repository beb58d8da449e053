// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The program as a user meets it: its exit code, its words and what it leaves behind.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <doctest/doctest.h>
#include <sys/wait.h>

#include "support/folder.hpp"

namespace program_test {
namespace {

namespace fs = std::filesystem;

struct Outcome {
  int code;
  std::string words;
};

Outcome run(const std::string& arguments, const cairn_test::Folder& folder) {
  const fs::path words = folder / "words.txt";
  const std::string command = std::string("XDG_CACHE_HOME=\"") + (folder / "cache").string() + "\" \"" +
                              STEREO_SLAM_PROGRAM + "\" " + arguments + " >\"" + words.string() + "\" 2>&1";
  const int status = std::system(command.c_str());  // NOLINT(cert-env33-c): our own program
  std::ifstream file(words);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, {std::istreambuf_iterator<char>(file), {}}};
}

bool says(const Outcome& outcome, const std::string& word) {
  return outcome.words.find(word) != std::string::npos;
}

}  // namespace

TEST_SUITE("program") {
  TEST_CASE("stereo_slam: --help names every option and ends well") {
    const cairn_test::Folder folder;
    const Outcome help = run("--help", folder);
    CHECK(help.code == 0);
    for (const char* option :
         {"--dataset", "--out", "--frames", "--seed", "--threads", "--store", "--points", "kitti_raw"}) {
      CAPTURE(option);
      CHECK(says(help, option));
    }
  }

  TEST_CASE("stereo_slam: a mistake on the command line is exit code 2 and a sentence") {
    const cairn_test::Folder folder;
    for (const std::string mistake :
         {"--store forest", "--points many", "--threads 0", "--frames -3", "--nonsense", "--script up"}) {
      CAPTURE(mistake);
      const Outcome outcome = run(mistake, folder);
      CHECK(outcome.code == 2);
      CHECK(outcome.words.size() > 10);
    }
    CHECK(run("--dataset nowhere", folder).code == 2);
  }

  TEST_CASE("stereo_slam: a missing data folder is named, and nothing is left behind") {
    const cairn_test::Folder folder;
    for (const std::string kind : {"kitti_odometry", "kitti_raw", "euroc"}) {
      CAPTURE(kind);
      const Outcome outcome =
          run("--dataset " + kind + " /no/such/drive --out \"" + (folder / "out").string() + "\"", folder);
      CHECK(outcome.code == 2);
      CHECK(says(outcome, "/no/such/drive"));
      CHECK_FALSE(fs::exists(folder / "out"));
    }
  }

  TEST_CASE("stereo_slam: an output folder that cannot be is named before the work begins") {
    const cairn_test::Folder folder;
    folder.put("file", "not a folder");
    const Outcome outcome = run("--frames 2 --out \"" + (folder / "file").string() + "\"", folder);
    CHECK(outcome.code == 2);
    CHECK(says(outcome, (folder / "file").string()));
  }

  TEST_CASE("stereo_slam: three frames of the arena leave every file, the same bytes for 1 and 2 threads") {
    const cairn_test::Folder folder;
    const auto bytes = [&](const std::string& out) {
      std::ifstream file(folder / out / "trajectory.tum", std::ios::binary);
      return std::string{std::istreambuf_iterator<char>(file), {}};
    };
    for (const std::string threads : {"1", "2"}) {
      const Outcome outcome =
          run("--frames 3 --threads " + threads + " --out \"" + (folder / ("out" + threads)).string() + "\"",
              folder);
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      for (const char* name : {"trajectory.tum", "trajectory.kitti", "map.ply", "summary.json"})
        CHECK(fs::file_size(folder / ("out" + threads) / name) > 0);
    }
    CHECK_FALSE(bytes("out1").empty());
    CHECK(bytes("out1") == bytes("out2"));
  }
}

}  // namespace program_test
