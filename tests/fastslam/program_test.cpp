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
    for (const std::string mistake : {"--nonsense",
                                      "--particles 0",
                                      "--threads 0",
                                      "--seed -1",
                                      "--data mars",
                                      "--robot 6",
                                      "--identities perhaps",
                                      "--proposal none",
                                      "--association guessed",
                                      "--frames 0",
                                      "--redraw -1",
                                      "--data map",
                                      "--data mrclam --folder /nowhere",
                                      "--data map --name none --folder /nowhere",
                                      "--name example_webmap",
                                      "--folder /nowhere",
                                      "--robot 2",
                                      "--association drawn",
                                      "--proposal motion --redraw 0.5",
                                      "--load /nowhere/map",
                                      "--load",
                                      "--save"}) {
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

  TEST_CASE("fastslam: --save and --load go on with a log as one run does") {
    const cairn_test::Folder folder;
    const auto named = [&](const std::string& name) { return "\"" + (folder / name).string() + "\""; };
    const auto outcome_of = [&](const std::string& arguments, const std::string& out) {
      return run(arguments + " --out " + named(out));
    };
    const std::string withheld = " --identities withheld", seven = " --particles 7 --seed 5";
    REQUIRE(outcome_of("--frames 40 --save " + named("a.map") + seven + withheld, "a").code == 0);
    REQUIRE(outcome_of("--frames 70 --load " + named("a.map") + " --save " + named("b.map") + withheld, "b")
                .code == 0);
    REQUIRE(outcome_of("--frames 70 --save " + named("c.map") + seven + withheld, "c").code == 0);
    for (const std::string name : {"trajectory.txt", "landmarks.csv", "summary.json"})
      CHECK(cairn::read_file(folder / "b" / name) == cairn::read_file(folder / "c" / name));
    CHECK(cairn::read_file(folder / "b.map") == cairn::read_file(folder / "c.map"));
    struct Mistake {
      std::string arguments, words;
    };
    const std::string load = "--load " + named("a.map");
    for (const auto& [arguments, words] :
         {Mistake{load, "a.map: frame 0 of the log is not that of the map"},
          Mistake{load + withheld + " --frames 40", "the map is of all 40 frames of the log"},
          Mistake{load + withheld + " --frames 39", "a map of 40 frames, and the log has 39"},
          Mistake{load + withheld + " --seed 5", "--seed is for a map that begins"},
          Mistake{load + withheld + " --particles 7", "--particles is for a map that begins"},
          Mistake{load + withheld + " --redraw 0.5", "--redraw is for a map that begins"},
          Mistake{load + withheld + " --association drawn", "--association is for a map that begins"},
          Mistake{load + " --proposal landmarks", "--proposal is for a map that begins"},
          Mistake{"--load " + named("a/summary.json"), "summary.json: no file of the kind"},
          Mistake{"--save " + named("none/map"), "expected the name of a file in a folder that there is"},
          Mistake{"--save " + named("out/summary.json"), "expected another"}}) {
      CAPTURE(arguments);
      const Outcome outcome = outcome_of(arguments, "out");
      CAPTURE(outcome.words);
      CHECK(outcome.code == 2);
      CHECK(outcome.says(words));
      CHECK_FALSE(fs::exists(folder / "out"));
    }
    // of data that is read nothing is written over
    const std::filesystem::path data = folder / "data" / "post.mat";
    fs::create_directory(folder / "data");
    cairn::write_file_atomically(data, "lm 2 1\n8 1\nwp 2 2\n0 0\n40 0\n");
    const std::string posts = "--data map --name post --frames 5 --folder " + named("data") + " --save ";
    CHECK(outcome_of(posts + named("data/post.mat"), "out").says("is read by this run"));
    CHECK(outcome_of(posts + named("data/map"), "out").code == 0);
  }

  TEST_CASE("fastslam: settings whose covariance is too sure are said to be") {
    const cairn_test::Folder folder;
    const auto words_of = [&](const std::string& arguments) {
      return run("--frames 20 " + arguments + " --out \"" + (folder / "out").string() + "\"").words;
    };
    const std::string few = "fewer than 6 particles", never = "paths are never drawn again";
    const auto says = [](const std::string& words, const std::string& what) {
      return words.find(what) != std::string::npos;
    };
    const std::string one = words_of("--particles 1"), five = words_of("--particles 5"),
                      six = words_of("--particles 6"), motion = words_of("--proposal motion"),
                      published = words_of("--redraw 0");
    CHECK((says(one, few) && says(five, few) && !says(one, never)));
    CHECK((!says(six, few) && !says(six, never)));
    CHECK((says(motion, never) && says(published, never) && !says(motion, few)));
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(says(summary["notes"].dump(), never));
  }

  TEST_CASE("fastslam: interrupted, it writes the frames until then") {
    const cairn_test::Folder folder;
    CHECK(cairn_test::interrupt_program({program, "--particles", "50", "--frames", "20000", "--out",
                                         (folder / "out").string(), "--save", (folder / "map").string()},
                                        {SIGTERM}, 1) == 4);
    CHECK(names_in(folder / "out") == results());
    const auto summary = nlohmann::json::parse(cairn::read_file(folder / "out" / "summary.json"));
    CHECK(summary["ended_early"].get<std::string>().find("interrupted (SIGTERM)") == 0);
    const int frames = summary["frames"].get<int>();
    CHECK(run("--frames " + std::to_string(frames + 2) + " --load \"" + (folder / "map").string() +
              "\" --out \"" + (folder / "on").string() + "\"")
              .code == 0);
    CHECK(nlohmann::json::parse(cairn::read_file(folder / "on" / "summary.json"))["frames"] == frames + 2);
  }
}

}  // namespace fastslam_program_test
