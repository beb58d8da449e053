// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "vertical_disparity.hpp"

#include <cmath>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>

#include "support/random.hpp"
#include "support/rigs.hpp"

namespace vertical_disparity_test {
namespace {

/// What `actual` sees of points, some of them matched wrongly.
std::vector<cairn::PixelPair> pairs(const cairn::StereoRig& actual, std::size_t count, std::uint64_t seed) {
  cairn::Random random(seed);
  std::vector<cairn::PixelPair> result;
  while (result.size() < count) {
    const auto pixels = actual.project(cairn_test::visible_point(actual, random, 3, 40));
    if (!pixels) continue;
    cairn::Vector<4> z = *pixels;
    for (int c = 0; c < 4; ++c) z(c) += 0.4 * random.normal();
    if (random.uniform() < 0.05) z(3) += random.uniform(-2, 2);
    result.push_back({z.head<2>(), z.tail<2>()});
  }
  return result;
}

}  // namespace

TEST_SUITE("vertical_disparity") {
  TEST_CASE("vertical_disparity: a rig that is what it says shows nothing, whatever the seed") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    for (const cairn::StereoRig& rig : {cairn_test::rectified_rig(0.5), cairn_test::unrectified_rig()})
      for (std::uint64_t run = 0; run < 20; ++run)
        CHECK_FALSE(stereo_slam::vertical_disparity(rig, pairs(rig, 400, seed + run)).shows());
  }

  TEST_CASE("vertical_disparity: a right camera that rolls by a milliradian is a slope over the columns") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const cairn::StereoRig nominal = cairn_test::rectified_rig(0.5);
    cairn::StereoRig actual = nominal;
    actual.T_left_right =
        cairn::SE3(cairn::SO3::exp(cairn::Vector<3>(0, 0, 1e-3)), nominal.T_left_right.translation());
    const auto seen = stereo_slam::vertical_disparity(nominal, pairs(actual, 500, seed));
    CHECK(seen.shows());
    CHECK(std::abs(seen.slope_x) == doctest::Approx(0.384).epsilon(0.4).scale(0));  // half a width by 1 mrad
    CHECK(seen.sigma_x < 0.08);
    CHECK(seen.points == 500);
  }

  TEST_CASE(
      "DisparityWatch: a knock is noticed in the fifth frame, scenes that differ and single frames are not") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto frame = [&](double offset) {
      return stereo_slam::VerticalDisparity{
          offset + random.normal(0, 0.05), random.normal(0, 1), 0, 0.01, 0.01, 0.01, 300};
    };
    for (const double knock : {1.5, -1.5}) {
      stereo_slam::DisparityWatch watch;
      // A rig that is off by 0.8 pixels; what lenses leave over swings by 0.1 as scenes pass.
      const auto usual = [&](int k) { return 0.8 + 0.1 * std::sin(0.15 * k); };
      for (int k = 0; k < 400; ++k) CHECK_FALSE(watch.departs(frame(usual(k) + (k % 9 == 0 ? knock : 0))));
      CHECK_FALSE(watch.departs({}));  // nothing seen is nothing new
      int frames = 0;
      for (bool noticed = false; !noticed && frames < 50; ++frames)
        noticed = watch.departs(frame(usual(400) + knock));
      CHECK(frames == 5);
    }
  }

  TEST_CASE("DisparityWatch: knows nothing at first") {
    stereo_slam::DisparityWatch watch;
    for (int k = 0; k < 14; ++k) CHECK_FALSE(watch.departs({k < 5 ? 0.0 : 9.0, 0, 0, 0.01, 0.01, 0.01, 300}));
  }

  TEST_CASE("vertical_disparity: few points say nothing") {
    const cairn::StereoRig rig = cairn_test::rectified_rig(0.5);
    CHECK_FALSE(stereo_slam::vertical_disparity(rig, pairs(rig, 20, 1)).shows());
    CHECK_FALSE(stereo_slam::vertical_disparity(rig, {}).shows());
  }
}

}  // namespace vertical_disparity_test
