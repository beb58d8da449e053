// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The long form of keyframe_map_test.cpp's promises about consistency; built with CAIRN_LONG_TESTS.
#include <algorithm>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/statistics.hpp>
#include <cairn/slam/keyframe_map.hpp>

#include "simulated_arena.hpp"
#include "support/random.hpp"

namespace consistency_study_test {
namespace {

cairn_test::ArenaRun drive(const cairn_test::ArenaOptions& arena) {
  cairn::KeyframeMap map(cairn_test::arena_rig());
  return cairn_test::run_arena(cairn_test::arena_frames(arena), map);
}

}  // namespace

TEST_SUITE("consistency_study") {
  TEST_CASE("keyframe_map: ten seeds of two laps, every run in its band, and the frames over the runs") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    constexpr int runs = 10;
    std::vector<double> of_frame(428, 0.0);
    double mean = 0;
    for (int run = 0; run < runs; ++run) {
      const auto result = drive({.seed = seed + 1000 + static_cast<std::uint64_t>(run)});
      CAPTURE(run);
      REQUIRE(result.nees.size() == of_frame.size());
      CHECK(result.mean_nees() > 3);
      CHECK(result.mean_nees() < 12);
      mean += result.mean_nees() / runs;
      for (std::size_t f = 0; f < of_frame.size(); ++f) of_frame[f] += result.nees[f] / runs;
    }
    CHECK(mean > 4.5);
    CHECK(mean < 8);
    const auto inside = std::ranges::count_if(of_frame, [](double nees) { return nees > 3.0 && nees < 9.9; });
    CHECK(static_cast<double>(inside) > 0.95 * static_cast<double>(of_frame.size()));
  }

  TEST_CASE("keyframe_map: six laps need no more keyframes than one, and NEES has no trend") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const auto result = drive({.seed = seed, .frames = 1220});
    CHECK(result.lost == 0);
    CHECK(result.keyframes.back() <= result.keyframes[210] + 1);
    CHECK(result.mean_nees(200) > 3);
    CHECK(result.mean_nees(200) < 12);
    CHECK(result.mean_nees(1000) < 2 * result.mean_nees(200, 400));
  }

  TEST_CASE("keyframe_map: noise that stays in view, half of it and most of it") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    for (const double share : {0.5, 0.8}) {
      CAPTURE(share);
      double mean = 0;
      for (std::uint64_t run = 0; run < 3; ++run)
        mean += drive({.seed = seed + run, .bias_share = share}).mean_nees() / 3;
      CHECK(mean > 2.5);
      CHECK(mean < 9);
    }
  }

  TEST_CASE("keyframe_map: 1450 points a frame") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const auto result = drive({.seed = seed, .points = 21000});
    CHECK(result.mean_nees() > 3);
    CHECK(result.mean_nees() < 12);
    CHECK(result.rms_position < 0.004);
  }
}

}  // namespace consistency_study_test
