// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "noise_factors.hpp"

#include <doctest/doctest.h>

namespace noise_factors_test {

using stereo_slam::Places;

TEST_SUITE("noise_factors") {
  TEST_CASE("noise_factors: begin at one, follow the frames, and gates never close") {
    stereo_slam::NoiseFactors good, bad;
    CHECK(good.pixels() == 1);
    CHECK(good.poses() == 1);
    cairn::MapLocation frame;
    frame.median_chi_squared = 0.1 * cairn::chi_square_quantile(0.5, 4);
    frame.score_variance = 0.1;
    for (int i = 0; i < 1000; ++i) CHECK(good.observe(frame, Places::patches) == doctest::Approx(0.1));
    CHECK(good.pixels() == 1);
    CHECK(good.poses() == doctest::Approx(0.15).epsilon(0.05).scale(0));
    frame.median_chi_squared *= 40;
    frame.score_variance = 3;
    frame.viewpoint_change = 0.5;
    for (int i = 0; i < 1000; ++i) bad.observe(frame, Places::patches);
    CHECK(bad.pixels() == doctest::Approx(4).epsilon(0.05));
    CHECK(bad.poses() == doctest::Approx(7.5).epsilon(0.05));
    stereo_slam::NoiseFactors recorded;
    for (int i = 0; i < 1000; ++i) recorded.observe(frame, Places::keypoints);
    CHECK(recorded.poses() == doctest::Approx(18).epsilon(0.05));
    CHECK(recorded.pixels() == bad.pixels());
  }
}

}  // namespace noise_factors_test
