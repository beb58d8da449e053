// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "stereo_matcher.hpp"

#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace stereo_matcher_test {
namespace {

cairn::PinholeCamera camera(double k1) {
  return cairn::PinholeCamera(
      {.fx = 500, .fy = 505, .cx = 320, .cy = 240, .k1 = k1, .width = 640, .height = 480});
}

/// A rig as it leaves a workshop: the right camera turned a little about every axis, lenses with distortion.
cairn::StereoRig crooked_rig() {
  const cairn::Vector<3> turn(0.02, -0.03, 0.015);
  return {camera(-0.2), camera(-0.15), cairn::SE3(cairn::SO3::exp(turn), {0.2, 0.01, -0.02})};
}

struct Scene {
  cairn::Features left, right;
  std::size_t pairs = 0;
};

/// Points in front of both cameras with descriptors of their own; point i is i-th on both sides. Half as many
/// points more stand on one side only.
Scene scene(const cairn::StereoRig& rig, cairn::Random& random, std::size_t count) {
  Scene result;
  result.left.dimension = result.right.dimension = 64;
  const auto add = [&](cairn::Features& side, const cairn::Vector<2>& pixel, std::int8_t sign,
                       const std::vector<float>& look) {
    side.keypoints.push_back({.x = static_cast<float>(pixel(0)),
                              .y = static_cast<float>(pixel(1)),
                              .scale = 2,
                              .laplacian = sign});
    for (const float value : look)
      side.descriptors.push_back(value + static_cast<float>(random.normal(0, 0.01)));
  };
  const auto look = [&] {
    std::vector<float> numbers(64);
    float squares = 0;
    for (float& value : numbers) {
      value = static_cast<float>(random.normal());
      squares += value * value;
    }
    for (float& value : numbers) value /= std::sqrt(squares);
    return numbers;
  };
  while (result.pairs < count) {
    const cairn::Vector<3> point(random.uniform(-2, 2), random.uniform(-1.5, 1.5), random.uniform(1.5, 12));
    const auto pixels = rig.project(point);
    if (!pixels || !rig.left.contains(pixels->head<2>()) || !rig.right.contains(pixels->tail<2>())) continue;
    const std::vector<float> numbers = look();
    const std::int8_t sign = random.below(2) == 0 ? -1 : 1;
    add(result.left, pixels->head<2>(), sign, numbers);
    add(result.right, pixels->tail<2>(), sign, numbers);
    ++result.pairs;
  }
  for (std::size_t i = 0; i < count / 2; ++i) {
    add(result.left, {random.uniform(0, 639), random.uniform(0, 479)}, 1, look());
    add(result.right, {random.uniform(0, 639), random.uniform(0, 479)}, 1, look());
  }
  return result;
}

stereo_slam::StereoMatcherOptions without_pictures() {
  stereo_slam::StereoMatcherOptions options;
  options.refine = false;
  return options;
}

}  // namespace

TEST_SUITE("stereo_matcher") {
  TEST_CASE("stereo_matcher: pairs every point of an unrectified rig, and no wrong ones") {
    const std::uint64_t seed = cairn_test::seed(3);
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::StereoRig rig = crooked_rig();
    const Scene points = scene(rig, random, 600);
    const stereo_slam::StereoMatcher matcher(rig, without_pictures());
    const auto pairs = matcher({}, points.left, {}, points.right, 1);
    std::size_t right = 0;
    for (const auto& pair : pairs) right += pair.left == pair.right && pair.left < points.pairs ? 1 : 0;
    CHECK(right == points.pairs);
    CHECK(pairs.size() == points.pairs);
  }

  TEST_CASE("stereo_matcher: answers the same for every number of threads") {
    cairn::Random random(5);
    const cairn::StereoRig rig = crooked_rig();
    const Scene points = scene(rig, random, 300);
    const stereo_slam::StereoMatcher matcher(rig, without_pictures());
    const auto one = matcher({}, points.left, {}, points.right, 1);
    for (const unsigned threads : {2U, 3U, 7U}) {
      const auto more = matcher({}, points.left, {}, points.right, threads);
      REQUIRE(more.size() == one.size());
      for (std::size_t i = 0; i < one.size(); ++i) {
        CHECK(more[i].left == one[i].left);
        CHECK(more[i].right == one[i].right);
      }
    }
  }

  TEST_CASE("stereo_matcher: bright points never pair with dark ones") {
    cairn::Random random(6);
    const cairn::StereoRig rig = crooked_rig();
    Scene points = scene(rig, random, 50);
    for (cairn::Keypoint& point : points.right.keypoints)
      point.laplacian = static_cast<std::int8_t>(-point.laplacian);
    const auto pairs =
        stereo_slam::StereoMatcher(rig, without_pictures())({}, points.left, {}, points.right, 1);
    for (const auto& pair : pairs) CHECK(pair.left != pair.right);
  }

  TEST_CASE("stereo_matcher: the slope of a pair is that of the surface's inverse depth, whatever the rig") {
    const cairn::StereoRig crooked = crooked_rig();
    const cairn::StereoRig parallel{camera(0), camera(0), cairn::SE3({}, {0.2, 0, 0})};
    const cairn::Vector<3> normal = cairn::Vector<3>(0.3, -0.8, -0.5).normalized();
    for (const cairn::StereoRig& rig : {crooked, parallel}) {
      // Of the plane normal . x = -1.2, seen in the left camera.
      const auto depth = [&](const cairn::Vector<2>& pixel) {
        return -1.2 / normal.dot(*rig.left.unproject(pixel));
      };
      const auto partner = [&](const cairn::Vector<2>& pixel) {
        const auto seen = rig.project(depth(pixel) * *rig.left.unproject(pixel));
        REQUIRE(seen);
        return cairn::Vector<2>(seen->tail<2>());
      };
      const stereo_slam::StereoMatcher matcher(rig, {});
      const cairn::Vector<2> x(1, 0), y(0, 1);
      for (const cairn::Vector<2>& pixel : {cairn::Vector<2>(320, 240), cairn::Vector<2>(90, 400)}) {
        stereo_slam::PointPair pair{0, 0, pixel, partner(pixel), true};
        pair.stretch = static_cast<float>(partner(pixel + x)(0) - partner(pixel)(0)) - 1;
        pair.shear = static_cast<float>(partner(pixel + y)(0) - partner(pixel)(0));
        const cairn::Vector<2> slope = matcher.slope_of_inverse_depth(pair),
                               truth(depth(pixel) / depth(pixel + x) - 1,
                                     depth(pixel) / depth(pixel + y) - 1);
        CAPTURE(truth.transpose());
        CHECK((slope - truth).norm() < 0.01 * truth.norm());
      }
    }
    const stereo_slam::StereoMatcher matcher(parallel, {});
    CHECK(matcher.slope_of_inverse_depth({0, 0, {300, 200}, {310, 200}, true}).isZero());  // behind
    CHECK(matcher.slope_of_inverse_depth({0, 0, {NAN, 200}, {290, 200}, true}).isZero());
  }

  TEST_CASE("stereo_matcher: no points give no pairs; a baseline along the view is refused in words") {
    const cairn::StereoRig rig = crooked_rig();
    cairn::Features none;
    none.dimension = 64;
    CHECK(stereo_slam::StereoMatcher(rig, {})({}, none, {}, none, 2).empty());
    cairn::StereoRig behind = rig;
    behind.T_left_right = cairn::SE3(cairn::SO3(), {0, 0, 0.3});
    CHECK_THROWS_WITH_AS(stereo_slam::StereoMatcher(behind, {}),
                         "stereo matcher: expected two cameras side by side, found a baseline along the view",
                         cairn::Error);
    behind.T_left_right = cairn::SE3();
    CHECK_THROWS_AS(stereo_slam::StereoMatcher(behind, {}), cairn::Error);
  }
}

}  // namespace stereo_matcher_test
