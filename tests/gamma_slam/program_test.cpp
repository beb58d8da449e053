// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The program as a user meets it: its exit code, its words and what it leaves behind.
#include "support/program.hpp"

#include <csignal>
#include <filesystem>
#include <set>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/io/trajectory.hpp>
#include <cairn/version.hpp>

#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/report.hpp"

namespace gamma_program_test {
namespace {

namespace fs = std::filesystem;
using cairn_test::names_in;
using cairn_test::Outcome;

const std::string program = GAMMA_SLAM_PROGRAM;

Outcome run(const std::string& arguments, const std::string& standard_output = "") {
  return cairn_test::run_program("\"" + program + "\" " + arguments, standard_output);
}

std::set<std::string> results() {
  std::set<std::string> names{"sigma.pgm", "sigma_by_odometry.pgm", "trajectory.txt", "summary.json",
                              "timing.json"};
  if (example::has_report_page()) names.insert("report.html");
  return names;
}

}  // namespace

TEST_SUITE("gamma_slam/program") {
  TEST_CASE("gamma_slam: a mistake is exit code 2 and a line") {
    const cairn_test::Folder folder;
    for (const char* mistake : {"--nonsense", "--particles 0", "--threads 0", "--seed -1", "--laps 0",
                                "--cells stones", "--drive nowhere", "--drive . --laps 2", "--frames 3",
                                "--cell-size 0", "--cell-size nan", "more words"}) {
      CAPTURE(mistake);
      const Outcome outcome = run(std::string(mistake) + " --out \"" + (folder / "out").string() + "\"");
      CAPTURE(outcome.words);
      CHECK(outcome.code == 2);
      CHECK(outcome.words.size() > 10);
      CHECK_FALSE(fs::exists(folder / "out"));
    }
    folder.put("file", "");
    CHECK(run("--out \"" + (folder / "file").string() + "\"").code == 2);
  }

  TEST_CASE("gamma_slam: --version and --help say what they are asked, or that they cannot") {
    CHECK(run("--version").words == "gamma_slam " CAIRN_VERSION_STRING "\n");
    CHECK(run("--help").says("--cell-size"));
    CHECK(run("--help").says("=gamma_slam_out"));
    CHECK(run("--help", "/dev/full").code == 2);
  }

  TEST_CASE("gamma_slam: the same seed gives the same bytes but for times, and the files are what they say") {
    const cairn_test::Folder folder;
    for (const std::string threads : {"1", "3"}) {
      const Outcome outcome = run("--particles 3 --laps 1 --seed 5 --threads " + threads + " --out \"" +
                                  (folder / threads).string() + "\"");
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      CHECK(outcome.says("scans 100 %"));
      CHECK(names_in(folder / threads) == results());
    }
    for (const std::string& name : results()) {
      CAPTURE(name);
      CHECK((cairn::read_file(folder / "1" / name) == cairn::read_file(folder / "3" / name)) ==
            (name != "timing.json"));
    }
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "1" / "summary.json"));
    CHECK(summary["scans"] == 201);
    CHECK(summary["cells"] == "heights");
    CHECK(cairn::read_tum(folder / "1" / "trajectory.txt").size() == 201);
    CHECK(cairn::read_netpbm(folder / "1" / "sigma.pgm").width == 250);
  }

  TEST_CASE("gamma_slam: interrupted, it writes the scans until then") {
    const cairn_test::Folder folder;
    CHECK(cairn_test::interrupt_program(
              {program, "--particles", "30", "--laps", "4", "--out", (folder / "out").string()}, {SIGTERM},
              1) == 4);
    CHECK(names_in(folder / "out") == results());
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(summary["ended_early"].get<std::string>().find("interrupted (SIGTERM)") == 0);
  }

#ifdef GAMMA_SLAM_HAS_RECORDINGS
  TEST_CASE("gamma_slam: a recording is prepared under the user's eyes, up to what of it can be used") {
    const auto data = cairn_test::real_data("kitti_raw_0926");
    if (!data) return;
    const cairn_test::Folder folder;
    const fs::path copy = folder / "drive";
    fs::copy(*data, copy, fs::copy_options::recursive);
    const auto drive = [&](const std::string& more) {
      return run("--particles 2 --drive \"" + copy.string() + "\" --out \"" + (folder / "out").string() +
                 "\" --frames " + more);
    };
    const fs::path image = copy / "image_01" / "data" / "0000000006.png";
    fs::remove(image);
    folder.put("drive/image_01/data/0000000006.png", "no image");
    const Outcome damaged = drive("6 --threads 2");
    CAPTURE(damaged.words);
    CHECK(damaged.code == 3);
    CHECK(damaged.says("frames  50 %"));
    CHECK(damaged.says("gamma_slam: ended after 4 of 6 frames, and driven back from there: "));
    CHECK(damaged.says("0000000006.png"));
    CHECK(names_in(folder / "out") == results());
    CHECK(nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"))["scans"] == 7);
    CHECK(cairn_test::interrupt_program({program, "--drive", data->string(), "--frames", "40", "--out",
                                         (folder / "interrupted").string()},
                                        {SIGINT}, 1) == 4);
    CHECK(names_in(folder / "interrupted").empty());
    fs::remove_all(copy / "poses_cam0_rectified.txt");
    const Outcome untrue = drive("3");
    CAPTURE(untrue.words);
    CHECK(untrue.code == 2);
    CHECK(untrue.says("true pose"));
    CHECK(untrue.says("poses_cam0_rectified.txt"));
    CHECK_FALSE(untrue.says("gamma_slam: gamma_slam"));
    CHECK(run("--help").says("true poses"));
  }
#endif
}

}  // namespace gamma_program_test
