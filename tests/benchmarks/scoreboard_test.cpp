// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/scoreboard.hpp"

#include <doctest/doctest.h>

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

  TEST_CASE("timing: the ratio of contenders that do one and four times the work is about four") {
    volatile unsigned sink = 0;
    const auto work = [&sink](unsigned n) {
      for (unsigned i = 0; i < n; ++i) sink = sink + i;
    };
    const auto timings =
        cairn_bench::interleave({{"once", [&] { work(20000); }}, {"four times", [&] { work(80000); }}},
                                {.rounds = 9, .seconds_per_round = 0.002});
    REQUIRE(timings.size() == 2);
    CHECK(timings[0].rounds.size() == 9);
    CHECK(timings[0].fastest <= timings[0].median);
    CHECK(cairn_bench::ratio(timings[1], timings[0]) == doctest::Approx(4).epsilon(0.5));
  }
}
