// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The program as a user meets it: its exit code, its words and what it leaves behind.
#include "support/program.hpp"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <set>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/version.hpp>

#include "support/folder.hpp"
#include "support/report.hpp"

namespace fastslam_program_test {
namespace {

namespace fs = std::filesystem;
using cairn_test::names_in;
using cairn_test::Outcome;

const std::string program = FASTSLAM_PROGRAM;

Outcome run(const std::string& arguments, const std::string& standard_output = "") {
  return cairn_test::run_program("\"" + program + "\" " + arguments, standard_output);
}

std::set<std::string> results() {
  std::set<std::string> names{"landmarks.csv", "trajectory.txt", "summary.json", "timing.json"};
  if (example::has_report_page()) names.insert("report.html");
  return names;
}

}  // namespace

TEST_SUITE("fastslam/program") {
  TEST_CASE("fastslam: a mistake is exit code 2 and a line") {
    const cairn_test::Folder folder;
    for (const std::string mistake :
         {"--nonsense", "--particles 0", "--threads 0", "--seed -1", "--data mars", "--robot 6",
          "--identities perhaps", "--proposal none", "--association guessed", "--frames 0", "--redraw -1",
          "--data map", "--data mrclam --folder /nowhere", "--data map --name none --folder /nowhere",
          "--name example_webmap", "--folder /nowhere", "--robot 2", "--association drawn",
          "--proposal motion --redraw 0.5"}) {
      CAPTURE(mistake);
      const Outcome outcome = run(mistake + " --out \"" + (folder / "out").string() + "\"");
      CAPTURE(outcome.words);
      CHECK(outcome.code == 2);
      CHECK(outcome.words.size() > 10);
      CHECK_FALSE(fs::exists(folder / "out"));
    }
  }

  TEST_CASE("fastslam: --version and --help say what they are asked, or that they cannot") {
    CHECK(run("--version").words == "fastslam " CAIRN_VERSION_STRING "\n");
    CHECK(run("--help").says("=fastslam_out"));
    CHECK(run("--robot 2").says("fastslam: --robot is for --data mrclam"));
    CHECK(run("--help").says("--identities"));
    CHECK(run("--help", "/dev/full").code == 2);
  }

  TEST_CASE("fastslam: the same seed gives the same bytes but for times, and the files are what they say") {
    const cairn_test::Folder folder;
    for (const std::string threads : {"1", "2", "7"}) {
      const Outcome outcome = run("--particles 9 --seed 5 --frames 60 --identities withheld --threads " +
                                  threads + " --out \"" + (folder / threads).string() + "\"");
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      CHECK(outcome.says("frames 100 %"));
      CHECK(names_in(folder / threads) == results());
    }
    for (const std::string& name : results())
      for (const std::string threads : {"2", "7"}) {
        CAPTURE(name);
        CHECK((cairn::read_file(folder / "1" / name) == cairn::read_file(folder / threads / name)) ==
              (name != "timing.json"));
      }
    // with names paths are drawn again on the way
    for (const std::string threads : {"1", "2", "7"})
      REQUIRE(run("--particles 20 --seed 5 --frames 80 --threads " + threads + " --out \"" +
                  (folder / ("known" + threads)).string() + "\"")
                  .code == 0);
    for (const std::string threads : {"2", "7"})
      for (const std::string name : {"trajectory.txt", "landmarks.csv", "summary.json"})
        CHECK(cairn::read_file(folder / "known1" / name) ==
              cairn::read_file(folder / ("known" + threads) / name));
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "1" / "summary.json"));
    CHECK(summary["frames"] == 60);
    CHECK(summary["identities"] == "withheld");
    CHECK(summary["pose_nees_median"].get<double>() > 0);
    // and do not make it too sure: 99 % of all are below
    const auto redrawn = nlohmann::json::parse(cairn::read_file(folder / "known1" / "summary.json"));
    CHECK(redrawn["pose_nees_median"].get<double>() < 11.3);
    const std::string path = cairn::read_file(folder / "1" / "trajectory.txt");
    CHECK(std::count(path.begin(), path.end(), '\n') == 60);
    const std::string landmarks = cairn::read_file(folder / "1" / "landmarks.csv");
    CHECK(std::count(landmarks.begin(), landmarks.end(), '\n') == 1 + summary["landmarks"].get<int>());
  }

  TEST_CASE("fastslam: interrupted, it writes the frames until then") {
    const cairn_test::Folder folder;
    CHECK(cairn_test::interrupt_program(
              {program, "--particles", "50", "--frames", "20000", "--out", (folder / "out").string()},
              {SIGTERM}, 1) == 4);
    CHECK(names_in(folder / "out") == results());
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(summary["ended_early"].get<std::string>().find("interrupted (SIGTERM)") == 0);
  }
}

}  // namespace fastslam_program_test
