// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/scoreboard.hpp"

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/version.hpp>

#include "support/folder.hpp"

TEST_SUITE("scoreboard") {
  using cairn_bench::Row;

  TEST_CASE("scoreboard: a row is judged on the side that is better") {
    Row row{.name = "error", .measured = 1.5, .unit = "m", .must = 2, .aim = 1};
    CHECK(verdict(row) == "met must");
    row.measured = 1.0;
    CHECK(verdict(row) == "met aim");
    row.measured = 2.1;
    CHECK(verdict(row) == "missed");
    CHECK(met(row) == false);
    row = {.name = "rate", .measured = 30, .unit = "Hz", .must = 5, .aim = 25, .better = cairn_bench::larger};
    CHECK(verdict(row) == "met aim");
    row.measured = 4.9;
    CHECK(verdict(row) == "missed");
  }

  TEST_CASE("scoreboard: what was not measured is neither met nor missed") {
    const Row absent{.name = "kitti", .must = 1, .note = "no data"};
    CHECK(verdict(absent) == "no data");
    CHECK_FALSE(met(absent).has_value());
    const Row alone = cairn_bench::against_rival("build", 2.0, std::nullopt, "FLANN", 1.5, 2.5);
    CHECK(verdict(alone) == "no rival");
    CHECK_FALSE(alone.measured.has_value());
  }

  TEST_CASE("scoreboard: a row against a rival says how many times faster ours is") {
    const Row row = cairn_bench::against_rival("build", 2.0, 5.0, "FLANN", 1.5, 3.0);
    CHECK(row.measured == doctest::Approx(2.5));
    CHECK(verdict(row) == "met must");
  }

  TEST_CASE("scoreboard: a program answers --help and --version, refuses what it has not, else runs") {
    std::ostringstream said, complained;
    std::streambuf* const out = std::cout.rdbuf(said.rdbuf());
    std::streambuf* const err = std::cerr.rdbuf(complained.rdbuf());
    const auto answer = [](std::vector<std::string> words) {
      std::vector<char*> arguments;
      for (std::string& word : words) arguments.push_back(word.data());
      return cairn_bench::answer(static_cast<int>(arguments.size()), arguments.data(), "board",
                                 {"low", "high"});
    };
    const auto none = answer({"board"}), part = answer({"board", "low"}),
               two = answer({"board", "high", "low"});
    const auto wrong = answer({"board", "low", "middle"}), option = answer({"board", "--fast"});
    const auto help = answer({"board", "low", "--help"}), version = answer({"board", "--version"});
    std::cout.rdbuf(out);
    std::cerr.rdbuf(err);
    CHECK_FALSE(none.has_value());
    CHECK_FALSE(part.has_value());
    CHECK_FALSE(two.has_value());
    CHECK(wrong == 2);
    CHECK(option == 2);
    CHECK(help == 0);
    CHECK(version == 0);
    CHECK(complained.str().find("board: 'middle' is no option\nusage: board [low] [high]") == 0);
    CHECK(said.str().find("usage: board [low] [high]") == 0);
    CHECK(said.str().find("board " CAIRN_VERSION_STRING "\n") != std::string::npos);
  }

  TEST_CASE("scoreboard: a table that cannot be written down is no success") {
    const cairn_test::Folder folder;
    folder.put("file", "");
    std::ostringstream said;
    std::streambuf* const out = std::cout.rdbuf(said.rdbuf());
    std::streambuf* const err = std::cerr.rdbuf(said.rdbuf());
    const auto finish = [&](const std::string& where) {
      ::setenv("CAIRN_SCOREBOARD_DIR", where.c_str(), 1);
      cairn_bench::Scoreboard board("tried");
      board.add({.name = "row", .measured = 1, .must = 2});
      return board.finish();
    };
    const int good = finish((folder / "new").string()), bad = finish((folder / "file").string());
    std::cout.rdbuf(out);
    std::cerr.rdbuf(err);
    ::unsetenv("CAIRN_SCOREBOARD_DIR");
    CHECK(good == 0);
    CHECK(bad == 1);
    CHECK(std::filesystem::exists(folder / "new" / "tried.json"));
    CHECK(said.str().find("tried.json: cannot write (Not a directory)") != std::string::npos);
  }

  TEST_CASE("timing: the ratio of contenders that do one and four times the work is about four") {
    volatile unsigned sink = 0;
    const auto work = [&sink](unsigned n) {
      for (unsigned i = 0; i < n; ++i) sink = sink + i;
    };
    bool about_four = false;  // once in ten times: others may be using the machine
    for (int attempt = 0; attempt < 10 && !about_four; ++attempt) {
      const auto timings =
          cairn_bench::interleave({{"once", [&] { work(20000); }}, {"four times", [&] { work(80000); }}},
                                  {.rounds = 9, .seconds_per_round = 0.002});
      REQUIRE(timings.size() == 2);
      CHECK(timings[0].rounds.size() == 9);
      CHECK(timings[0].fastest <= timings[0].median);
      about_four = cairn_bench::ratio(timings[1], timings[0]) == doctest::Approx(4).epsilon(0.5);
    }
    CHECK(about_four);
  }

  TEST_CASE("timing: before a turn a contender is run untimed where that is asked for") {
    const auto runs = [](bool run_first) {
      int count = 0;
      cairn_bench::interleave({{"counted", [&] { ++count; }}},
                              {.rounds = 3, .seconds_per_round = 0, .run_first = run_first});
      return count;
    };
    CHECK(runs(false) == 1 + 3);
    CHECK(runs(true) == 1 + 3 * 2);
  }
}
