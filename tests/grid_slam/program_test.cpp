// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The program as a user meets it: its exit code, its words and what it leaves behind.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include <cairn/io/file.hpp>
#include <cairn/io/netpbm.hpp>
#include <cairn/io/trajectory.hpp>
#include <cairn/version.hpp>

#include "floor_plan.hpp"
#include "support/folder.hpp"
#include "support/program_checks.hpp"

namespace grid_program_test {
namespace {

namespace fs = std::filesystem;
using cairn_test::names_in;
using cairn_test::Outcome;

const std::string program = GRID_SLAM_PROGRAM;

Outcome run(const std::string& arguments, const std::string& standard_output = "") {
  return cairn_test::run_program("\"" + program + "\" " + arguments, standard_output);
}

std::set<std::string> results() {
  return cairn_test::with_report({"map.pgm", "map.yaml", "trajectory.txt", "summary.json", "timing.json"});
}

/// The first scans of a rendered drive as a CARMEN log; at scan `jump` odometry is elsewhere, by so many
/// metres. Mirrored, beams run clockwise. Odometry has its origin at `origin`.
std::string short_log(std::size_t scans, std::size_t jump = 0, double by = 0, bool mirrored = false,
                      const cairn::SE2& origin = {}) {
  const grid_slam::Drive drive = grid_slam::simulated_drive({.seed = 3});
  std::string text;
  for (std::size_t i = 0; i < scans; ++i) {
    const cairn::StampedScan& s = drive.log.scans[i];
    text += "FLASER " + std::to_string(s.scan.size());
    std::vector<float> ranges = s.scan.range;
    if (mirrored) std::ranges::reverse(ranges);
    for (const float r : ranges) text += " " + cairn::shortest(r);
    const cairn::SE2 at = origin * s.T_odom_laser;
    for (int twice = 0; twice < 2; ++twice)
      for (const double n : {at.x() + (jump > 0 && i == jump ? by : 0), at.y(), at.angle()})
        text += " " + cairn::shortest(n);
    text += " " + cairn::shortest(s.time) + " host 0\n";
  }
  return text;
}

}  // namespace

TEST_SUITE("grid_slam/program") {
  TEST_CASE("grid_slam: a mistake is exit code 2 and a line") {
    const cairn_test::Folder folder;
    folder.put("empty", "");
    folder.put("torn", "FLASER 3 1 2\n");
    folder.put("nan", "FLASER 1 nan 0 0 0 0 0 0 1 h 0\n");
    folder.put("still", "FLASER 1 1 0 0 0 0 0 0 1 h 0\nFLASER 1 1 0 0 0 0 0 0 2 h 0\n");
    folder.put("log", short_log(3));
    const auto named = [&](const char* name) { return "\"" + (folder / name).string() + "\""; };
    const auto run_there = [&](const std::string& mistake) {
      return run(mistake + " --out \"" + (folder / "out").string() + "\"");
    };
    cairn_test::check_mistakes(
        run_there,
        {"--nonsense", "--particles 0", "--threads 0", "--seed -1", "--log " + named("none"),
         "--log " + named("empty"), "--log " + named("torn"), "--log " + named("nan"),
         "--log " + named("still"), "--log " + named("log") + " --relations " + named("log"),
         "--simulate --log " + named("log"), "--frame nowhere", "--frame start --load " + named("log"),
         "--log " + named("log") + " --save " + named("log")},
        300);
    CHECK_FALSE(fs::exists(folder / "out"));
    CHECK(cairn::read_file(folder / "log") == short_log(3));
    CHECK(run_there("--log " + named("log") + " --save " + named("out/map.pgm"))
              .says("out/map.pgm: a result of the run has this name; expected another"));
  }

  TEST_CASE("grid_slam: --version and --help say what they are asked, or that they cannot") {
    cairn_test::check_version_and_help(run, "grid_slam " CAIRN_VERSION_STRING "\n", "--relations");
  }

  TEST_CASE("grid_slam: the same seed gives the same bytes but for times, and the files are what they say") {
    const cairn_test::Folder folder;
    folder.put("log", short_log(150));
    for (const std::string threads : {"1", "3"}) {
      const Outcome outcome =
          run("--particles 4 --seed 5 --threads " + threads + " --log \"" + (folder / "log").string() +
              "\" --out \"" + (folder / threads).string() + "\"");
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      CHECK(outcome.says("scans 100 %"));
      CHECK(names_in(folder / threads) == results());
    }
    cairn_test::check_same_bytes(folder / "1", folder / "3", results());
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "1" / "summary.json"));
    CHECK(summary["scans"] == 150);
    CHECK(summary["relations"]["means"].is_null());
    const cairn::Netpbm map = cairn::read_netpbm(folder / "1" / "map.pgm");
    CHECK(map.width == summary["map"]["width"]);
    const std::string yaml = cairn::read_file(folder / "1" / "map.yaml");
    CHECK(yaml.find("resolution: 0.05\n") != std::string::npos);
    CHECK(yaml.find("image: map.pgm\n") == 0);
    const std::string path = cairn::read_file(folder / "1" / "trajectory.txt");
    CHECK(std::count(path.begin(), path.end(), '\n') == 150);
  }

  TEST_CASE(
      "grid_slam: a log turned and shifted has the same map and path, which begin at the laser's first "
      "pose") {
    const cairn_test::Folder folder;
    folder.put("log", short_log(150));
    folder.put("moved", short_log(150, 0, 0, false, {123.4, -56.7, 1.1}));
    for (const std::string map : {"tiles", "stop --frame start", "ancestry --frame start"}) {
      CAPTURE(map);
      for (const char* log : {"log", "moved"}) {
        const Outcome outcome = run("--particles 4 --map " + map + " --log \"" + (folder / log).string() +
                                    "\" --out \"" + (folder / "of" / log).string() + "\"");
        CAPTURE(outcome.words);
        REQUIRE(outcome.code == 0);
      }
      for (const char* name : {"map.pgm", "map.yaml", "trajectory.txt"})
        CHECK(cairn::read_file(folder / "of" / "log" / name) ==
              cairn::read_file(folder / "of" / "moved" / name));
      // DP-SLAM draws its first poses within millimetres of the start.
      const auto path = cairn::read_tum(folder / "of" / "log" / "trajectory.txt");
      CHECK(path.front().T_world_body.log().norm() < (map.starts_with("tiles") ? 1e-9 : 0.005));
    }
  }

  TEST_CASE(
      "grid_slam: with --frame odometry, as DP-SLAM's without, map and path are where odometry has its "
      "origin") {
    const cairn_test::Folder folder;
    const cairn::SE2 origin(123.4, -56.7, 1.1);
    folder.put("log", short_log(40, 0, 0, false, origin));
    const cairn::SE2 by_log = origin * grid_slam::simulated_drive({.seed = 3}).log.scans.front().T_odom_laser;
    for (const std::string map : {"tiles --frame odometry", "stop", "ancestry"}) {
      CAPTURE(map);
      const Outcome outcome = run("--particles 2 --map " + map + " --log \"" + (folder / "log").string() +
                                  "\" --out \"" + (folder / "out").string() + "\"");
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      const cairn::SE3 begin = cairn::read_tum(folder / "out" / "trajectory.txt").front().T_world_body;
      CHECK((begin.translation().head<2>() - by_log.translation()).norm() <
            (map.starts_with("tiles") ? 1e-9 : 0.005));
      // The lower left corner of the map: within the beams' reach of there.
      const std::string yaml = cairn::read_file(folder / "out" / "map.yaml");
      double left = 0, bottom = 0;
      REQUIRE(std::sscanf(yaml.c_str() + yaml.find("origin: ["), "origin: [%lf, %lf", &left, &bottom) == 2);
      CHECK(std::abs(left - by_log.x()) < 85);
      CHECK(std::abs(bottom - by_log.y()) < 85);
    }
  }

  TEST_CASE("grid_slam: a log in two runs, by way of a saved map, gives the bytes of one run") {
    const cairn_test::Folder folder;
    for (const char* name : {"whole", "begin", "end"}) fs::create_directory(folder / name);
    const std::string log = short_log(160);
    std::size_t cut = 0;
    for (int line = 0; line < 90; ++line) cut = log.find('\n', cut) + 1;
    folder.put("whole/log", log);  // the name of a log is part of the summary
    folder.put("begin/log", log.substr(0, cut));
    folder.put("end/log", log.substr(cut));
    const auto named = [&](const std::string& name) { return "\"" + (folder / name).string() + "\""; };
    const auto log_and_out = [&](const std::string& name) {
      return " --log " + named(name + "/log") + " --out " + named("out_" + name);
    };
    REQUIRE(run("--particles 5 --seed 9" + log_and_out("whole") + " --save " + named("whole.map")).code == 0);
    REQUIRE(run("--particles 5 --seed 9" + log_and_out("begin") + " --save " + named("begin.map")).code == 0);
    REQUIRE(
        run("--threads 3 --load " + named("begin.map") + log_and_out("end") + " --save " + named("end.map"))
            .code == 0);
    for (const std::string& name : results()) {
      if (name == "timing.json" || name == "report.html") continue;  // its film begins with the second run
      CAPTURE(name);
      CHECK(cairn::read_file(folder / "out_whole" / name) == cairn::read_file(folder / "out_end" / name));
    }
    CHECK(cairn::read_file(folder / "whole.map") == cairn::read_file(folder / "end.map"));
  }

  TEST_CASE(
      "grid_slam: DP-SLAM gives the same bytes on the tree of ancestors and on tiles, for any number of "
      "threads") {
    const cairn_test::Folder folder;
    folder.put("log", short_log(60));
    for (const std::string& way : {std::string("stop --threads 1"), std::string("ancestry --threads 1"),
                                   std::string("ancestry --threads 3")}) {
      const Outcome outcome = run("--particles 8 --seed 5 --map " + way + " --log \"" +
                                  (folder / "log").string() + "\" --out \"" + (folder / way).string() + "\"");
      CAPTURE(outcome.words);
      REQUIRE(outcome.code == 0);
      CHECK(names_in(folder / way) == results());
      for (const char* name : {"map.pgm", "map.yaml", "trajectory.txt"})
        CHECK(cairn::read_file(folder / "stop --threads 1" / name) == cairn::read_file(folder / way / name));
      if (!example::has_report_page()) continue;
      const std::string page = cairn::read_file(folder / way / "report.html");
      CHECK(page.find("Spread of the newest pose") != std::string::npos);
      CHECK(page.find("Memory of the maps") != std::string::npos);
    }
    CHECK(cairn::read_file(folder / "ancestry --threads 1" / "summary.json") ==
          cairn::read_file(folder / "ancestry --threads 3" / "summary.json"));
    CHECK(run("--map stop --save \"" + (folder / "map").string() + "\"").code == 2);
    CHECK(run("--map paper").code == 2);
  }

  TEST_CASE("grid_slam: a map that is none, or another, is a line and exit code 2, and nothing is lost") {
    const cairn_test::Folder folder;
    folder.put("log", short_log(40));
    const auto named = [&](const std::string& name) { return "\"" + (folder / name).string() + "\""; };
    const std::string with_log = " --log " + named("log") + " --out " + named("out");
    REQUIRE(run("--particles 3" + with_log + " --save " + named("map")).code == 0);
    const std::string map = cairn::read_file(folder / "map"),
                      summary = cairn::read_file(folder / "out" / "summary.json");
    std::string damaged = map;
    damaged[map.size() / 2] = static_cast<char>(damaged[map.size() / 2] ^ 1);
    folder.put("damaged", damaged);
    folder.put("torn", map.substr(0, map.size() / 3));
    folder.put("head", map.substr(0, 30));
    folder.put("empty", "");
    folder.put("other", "P5 1 1 255 x");
    folder.put("longer", map + "x");
    for (const std::string& mistake :
         {"--load " + named("damaged"), "--load " + named("torn"), "--load " + named("head"),
          "--load " + named("empty"), "--load " + named("other"), "--load " + named("longer"),
          "--load " + named("none"), "--load " + named("map") + " --resolution 0.1",
          "--load " + named("map") + " --particles 4", std::string("--localise"),
          "--load " + named("map") + " --window 0 0 1 1",
          "--load " + named("map") + " --localise --window 1 1 0 0",
          "--load " + named("map") + " --localise --window 500 500 510 510",
          "--load " + named("map") + " --localise --save " + named("again"),
          "--save " + named("no/folder/map"), "--save " + named("out")}) {
      CAPTURE(mistake);
      const Outcome outcome = run(mistake + with_log);
      CAPTURE(outcome.words);
      CHECK(outcome.code == 2);
      CHECK(outcome.words.size() > 10);
      CHECK(cairn::read_file(folder / "out" / "summary.json") == summary);
    }
    CHECK(cairn::read_file(folder / "map") == map);
    CHECK(run("--load " + named("map") + " --resolution 0.1" + with_log).says("cells of 0.05 m"));
    for (const char* way : {"", " --localise"}) {  // not silently with the rendered drive
      const Outcome without_log = run("--load " + named("map") + way + " --out " + named("none"));
      CHECK(without_log.code == 2);
      CHECK(without_log.says("--load goes on with a log: expected --log too, or --simulate"));
    }
    const Outcome wide = run("--load " + named("map") + " --localise --window -500 -500 500 500 --log " +
                             named("log") + " --out " + named("none"));
    CHECK(wide.code == 2);
    CHECK(wide.says(
        "expected a window of no more than 795 m a side, in a map of cells of 0.05 m; found 1000 m"));
    CHECK_FALSE(fs::exists(folder / "none"));
    CHECK(run("--load " + named("torn") + with_log).says("bytes after the head, expected"));
    CHECK(run("--load " + named("map") + " --localise --window 500 500 510 510" + with_log)
              .says("outside of the map"));
  }

  TEST_CASE("grid_slam: where no place in the window explains the first scan, no folder is left") {
    const cairn_test::Folder folder;
    folder.put("log", short_log(40));
    std::string round;  // no wall of a corridor
    for (int scan = 0; scan < 2; ++scan) {
      round += "FLASER 90";
      for (int beam = 0; beam < 90; ++beam) round += " 3";
      const std::string pose = " " + std::to_string(scan) + " 0 0";
      round += pose + pose + " " + std::to_string(scan) + " h 0\n";
    }
    folder.put("round", round);
    const auto named = [&](const char* name) { return "\"" + (folder / name).string() + "\""; };
    REQUIRE(
        run("--particles 2 --log " + named("log") + " --out " + named("mapped") + " --save " + named("map"))
            .code == 0);
    fs::create_directory(folder / "there");
    const auto localise = [&](const char* out) {
      return run("--load " + named("map") + " --localise --window -3 -3 3 3 --log " + named("round") +
                 " --out " + named(out));
    };
    for (const char* out : {"new", "a/new/one/", "there"}) {
      CAPTURE(out);
      const Outcome outcome = localise(out);
      CAPTURE(outcome.words);
      CHECK(outcome.code == 2);
      CHECK(outcome.says("no place in the window explains the first scan"));
    }
    CHECK_FALSE(fs::exists(folder / "new"));
    CHECK_FALSE(fs::exists(folder / "a"));
    CHECK(fs::is_empty(folder / "there"));
  }

  TEST_CASE("grid_slam: a map too large for a picture is left out with a note, and nothing else is") {
    const cairn_test::Folder folder;
    folder.put("log", short_log(40, 39, 2000));
    const auto named = [&](const char* name) { return "\"" + (folder / name).string() + "\""; };
    const std::string arguments =
        "--particles 1 --log " + named("log") + " --out " + named("out") + " --save " + named("map");
    for (const std::string way : {"", "--map stop ", "--map ancestry "}) {
      const Outcome outcome =
          run(way + (way.empty() ? arguments : arguments.substr(0, arguments.find(" --save"))));
      CAPTURE(outcome.words);
      CHECK(outcome.code == 0);
      CHECK(outcome.says("grid_slam: no map.pgm and map.yaml: the map of "));
      CHECK(outcome.says("picture of 30000 x 30000; --resolution 0."));
      std::set<std::string> names = results();
      names.erase("map.pgm");
      names.erase("map.yaml");
      CHECK(names_in(folder / "out") == names);
      const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
      CHECK(summary["notes"].size() == 1);
      CHECK(summary["map"]["width"] > 30000);
      CHECK(fs::exists(folder / "map"));
    }
    const Outcome coarse = run("--resolution 0.1 " + arguments);
    CAPTURE(coarse.words);
    CHECK(coarse.code == 0);
    CHECK(names_in(folder / "out") == results());
  }

  TEST_CASE("grid_slam: odometry that leaps to where no map is ends the log, and the scans before are kept") {
    const cairn_test::Folder folder;
    const auto named = [&](const std::string& name) { return "\"" + (folder / name).string() + "\""; };
    const auto log_and_out = [&](const std::string& name) {
      return "--particles 3 --log " + named(name) + " --out " + named("out_" + name);
    };
    folder.put("short", short_log(30));
    REQUIRE(run(log_and_out("short") + " --save " + named("short.map")).code == 0);
    for (const double by : {1e6, -9e8})
      for (const std::string way : {"", " --map stop", " --map ancestry"}) {
        folder.put("leap", short_log(40, 30, by));
        const Outcome outcome =
            run(log_and_out("leap") + (way.empty() ? " --save " + named("leap.map") : way));
        CAPTURE(by);
        CAPTURE(outcome.words);
        CHECK(outcome.code == 3);
        CHECK(outcome.says("grid_slam: leap: ended after 30 of 40 scans: scan 31 (line 31, time 6"));
        CHECK(names_in(folder / "out_leap") == results());
        const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out_leap" / "summary.json"));
        CHECK(summary["scans"] == 30);
        if (!way.empty()) continue;
        CHECK(cairn::read_file(folder / "leap.map") == cairn::read_file(folder / "short.map"));
        for (const char* name : {"map.pgm", "trajectory.txt"})
          CHECK(cairn::read_file(folder / "out_leap" / name) ==
                cairn::read_file(folder / "out_short" / name));
      }
  }

  TEST_CASE("grid_slam: relations of another log, and scans without a beam, are said") {
    const cairn_test::Folder folder;
    folder.put("log", short_log(20));
    folder.put("other", "1e6 2e6 1 0 0 0 0 0\n");
    folder.put("some", "0 2 1 0 0 0 0 0\n0 1e6 1 0 0 0 0 0\n");
    folder.put("blind", "FLASER 1 90 0 0 0 0 0 0 1 h 0\nFLASER 1 90 1 0 0 1 0 0 2 h 0\n");
    const auto run_with = [&](const std::string& log, const std::string& more) {
      const Outcome outcome = run("--particles 2 --log \"" + (folder / log).string() + "\" --out \"" +
                                  (folder / "out").string() + "\"" + more);
      CAPTURE(outcome.words);
      CHECK(outcome.code == 0);
      const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
      REQUIRE(summary["notes"].size() == 1);
      CHECK(outcome.says("grid_slam: " + summary["notes"][0].get<std::string>()));
      return outcome;
    };
    const auto relations = [&](const char* name) {
      return " --relations \"" + (folder / name).string() + "\"";
    };
    CHECK(run_with("log", relations("other")).says("none of the 1 relations has poses"));
    CHECK(run_with("log", relations("some")).says("1 of 2 relations have no pose"));
    CHECK(run_with("blind", "").says("no scan has a beam that came back"));
  }

  TEST_CASE("grid_slam: a mirrored scanner is a mistake, not a map") {
    const cairn_test::Folder folder;
    const std::size_t all = grid_slam::simulated_drive({.seed = 3}).log.scans.size();
    folder.put("log", short_log(all, 0, 0, true));
    const Outcome outcome = run("--particles 1 --log \"" + (folder / "log").string() + "\" --out \"" +
                                (folder / "out").string() + "\"");
    CHECK(outcome.code == 2);
    CHECK(outcome.says("expected beams that run counter-clockwise"));
    CHECK_FALSE(fs::exists(folder / "out"));
  }

  TEST_CASE("grid_slam: interrupted, it writes the scans until then") {
    const cairn_test::Folder folder;
    CHECK(cairn_test::interrupt_program({program, "--particles", "2", "--out", (folder / "out").string()},
                                        {SIGTERM}, 1) == 4);
    CHECK(names_in(folder / "out") == results());
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(summary["ended_early"].get<std::string>().find("interrupted (SIGTERM)") == 0);
  }
}

}  // namespace grid_program_test
