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
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/trajectory.hpp>
#include <cairn/version.hpp>

#include "drive.hpp"
#include "run.hpp"
#include "support/folder.hpp"
#include "support/program_checks.hpp"

namespace line_program_test {
namespace {

namespace fs = std::filesystem;
using cairn_test::names_in;
using cairn_test::Outcome;

const std::string program = LINE_SLAM_PROGRAM;

Outcome run(const std::string& arguments, const std::string& standard_output = "") {
  return cairn_test::run_program("\"" + program + "\" " + arguments, standard_output);
}

const std::set<std::string> results =
    cairn_test::with_report({"lines.csv", "trajectory.txt", "summary.json", "timing.json"});

}  // namespace

TEST_SUITE("line_slam/program") {
  TEST_CASE("line_slam: a mistake is exit code 2 and a line") {
    const cairn_test::Folder folder;
    const std::string out = " --out \"" + (folder / "out").string() + "\"";
    cairn_test::check_mistakes([&](const std::string& mistake) { return run(mistake + out); },
                               {"--nonsense", "--particles 0", "--particles many", "--threads 0", "--seed -1",
                                "--metres 0", "--metres nan", "--detector eyes", "--smoothings -1",
                                "--smoothings some", "--quiet=perhaps", "more words"});
    CHECK_FALSE(fs::exists(folder / "out"));
    folder.put("file", "");
    CHECK(run("--out \"" + (folder / "file").string() + "\"").code == 2);
  }

  TEST_CASE("line_slam: --version and --help say what they are asked, or that they cannot") {
    cairn_test::check_version_and_help(run, "line_slam " CAIRN_VERSION_STRING "\n", "--metres");
  }

  TEST_CASE("line_slam: the same seed gives the same bytes but for times, and the files are what they say") {
    const cairn_test::Folder folder;
    for (const std::string threads : {"1", "2", "7"}) {
      const Outcome outcome =
          run("--particles 5 --metres 15 --seed 5 --threads " + threads + (threads == "7" ? " --quiet" : "") +
              " --out \"" + (folder / threads).string() + "\"");
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      CHECK(outcome.says("frames 100 %") == (threads != "7"));
      CHECK(names_in(folder / threads) == results);
    }
    cairn_test::check_same_bytes(folder / "1", folder / "2", results);
    cairn_test::check_same_bytes(folder / "1", folder / "7", results);
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "1" / "summary.json"));
    CHECK(summary["frames"] == 21);
    CHECK(summary["particles"] == 5);
    CHECK(cairn::read_tum(folder / "1" / "trajectory.txt").size() == 21);
    const std::string lines = cairn::read_file(folder / "1" / "lines.csv");
    CHECK(std::count(lines.begin(), lines.end(), '\n') == 1 + summary["slam"]["lines"].get<int>());
  }

  TEST_CASE(
      "line_slam: --smoothings 0 hands over a particle's path as it was, and the default a smoothed one") {
    const cairn_test::Folder folder;
    const line_slam::Drive drive = line_slam::simulated_drive({.seed = 5, .metres = 15});
    const auto off = [&](const std::string& name, const line_slam::RunOptions& options) {
      const auto written = cairn::read_tum(folder / name / "trajectory.txt");
      const auto made = line_slam::run(drive, options).slam.path;
      REQUIRE(written.size() == made.size());
      double farthest = 0;
      for (std::size_t k = 0; k < made.size(); ++k)
        farthest = std::max(farthest, cairn::local(made[k], written[k].T_world_body).norm());
      return farthest;
    };
    const auto smoothings = [&](const std::string& name, const std::string& option) {
      const Outcome outcome = run("--particles 5 --metres 15 --seed 5 --quiet" + option + " --out \"" +
                                  (folder / name).string() + "\"");
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      return nlohmann::json::parse(cairn::read_file(folder / name / "summary.json"))["smoothings"].get<int>();
    };
    CHECK(smoothings("raw", " --smoothings 0") == 0);
    CHECK(smoothings("smooth", "") == line_slam::RunOptions{}.smoothings);
    const line_slam::RunOptions raw{.particles = 5, .seed = 5, .smoothings = 0},
        smooth{.particles = 5, .seed = 5};
    CHECK(off("raw", raw) < 1e-5);
    CHECK(off("smooth", smooth) < 1e-5);
    CHECK(off("raw", smooth) > 1e-3);
    // One of the particles' own, pose for pose.
    const line_slam::Results r = line_slam::run(drive, raw);
    const auto is_same = [&](const std::vector<cairn::SE3>& path) {
      for (std::size_t k = 0; k < path.size(); ++k)
        if (cairn::local(path[k], r.slam.path[k]).norm() != 0) return false;
      return path.size() == r.slam.path.size();
    };
    CHECK(std::ranges::any_of(r.paths, is_same));
  }

  TEST_CASE("line_slam: segments found in the pictures make a map, or it is said that there is no detector") {
    const cairn_test::Folder folder;
    const Outcome outcome =
        run("--detector lsd --particles 20 --metres 12 --seed 5 --out \"" + (folder / "out").string() + "\"");
    CAPTURE(outcome.words);
    if (outcome.says("expected OpenCV")) {
      CHECK(outcome.code == 2);
      CHECK_FALSE(fs::exists(folder / "out"));
      MESSAGE("skipped: OpenCV's line segment detector, without OpenCV");
      return;
    }
    REQUIRE(outcome.code == 0);
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(summary["slam"]["lines"].get<int>() >= 20);
    CHECK(summary["slam"]["rms_m"].get<double>() < 0.3);
    CHECK(outcome.says("pictures 100 %"));

    // It is not deaf while it draws: of forty pictures most are left when it has said the first line.
    CHECK(cairn_test::interrupt_program(
              {program, "--detector", "lsd", "--metres", "30", "--out", (folder / "interrupted").string()},
              {SIGTERM}, 1) == 4);
    CHECK(names_in(folder / "interrupted") == results);
    const auto ended = nlohmann::json::parse(cairn::read_file(folder / "interrupted" / "summary.json"));
    CHECK(ended["frames"] == 1);
  }

  TEST_CASE("line_slam: interrupted, it writes the frames until then") {
    const cairn_test::Folder folder;
    CHECK(cairn_test::interrupt_program(
              {program, "--particles", "2000", "--metres", "60", "--out", (folder / "out").string()},
              {SIGTERM}, 1) == 4);
    CHECK(names_in(folder / "out") == results);
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(summary["ended_early"].get<std::string>().find("interrupted (SIGTERM)") == 0);
  }
}

}  // namespace line_program_test
