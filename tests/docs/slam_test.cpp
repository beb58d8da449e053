// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The examples in the headers of cairn/slam, compiled and run: see CMakeLists.txt.
#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/geometry/triangulation.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/slam/keyframe_map.hpp>
#include <cairn/slam/keyframe_map_file.hpp>
#include <cairn/slam/landmark_map.hpp>

#include "slam/simulated_arena.hpp"

namespace docs_slam_test {

namespace landmark_map {
#include "snippets/slam/landmark_map_1.inc"
static_assert(cairn::LandmarkSensor<RangeBearingOfPoint>);
}  // namespace landmark_map

/// A frame whose association is known beforehand.
struct Frame {
  std::vector<cairn::StereoSighting> matches, unmatched;
  bool shows_much_that_is_new;
};

TEST_CASE("docs: the example of keyframe_map.hpp makes two keyframes") {
  const cairn::StereoRig rig = cairn_test::arena_rig();
  const auto arena = cairn_test::arena_frames({.frames = 2});
  const std::vector<cairn::StereoSighting> first = arena[0].sightings;
  Frame second{{}, {}, true};
  for (const cairn::StereoSighting& s : arena[1].sightings) {
    const bool known = std::ranges::binary_search(first, s.landmark, {}, &cairn::StereoSighting::landmark);
    (known ? second.matches : second.unmatched).push_back(s);
  }
  const std::vector<Frame> frames{second};
  const cairn::SE3 guess = arena[1].T_world_camera;
#include "snippets/slam/keyframe_map_1.inc"
  CHECK(map.keyframe_count() == 2);
  // A sighting of too few pixels' disparity makes no point.
  const auto makes_a_point = [&](const cairn::StereoSighting& seen) {
    return cairn::Triangulator(rig)(seen.left, seen.right, seen.sigma, seen.sigma).good();
  };
  const auto points =
      std::ranges::count_if(first, makes_a_point) + std::ranges::count_if(second.unmatched, makes_a_point);
  CHECK(static_cast<std::ptrdiff_t>(map.landmark_count()) == points);
}

TEST_CASE("docs: the example of keyframe_map_file.hpp loads what it saved") {
  cairn::KeyframeMap map(cairn_test::arena_rig());
  map.begin(cairn::SE3());
#include "snippets/slam/keyframe_map_file_1.inc"
  CHECK(loaded.keyframe_count() == 1);
}

}  // namespace docs_slam_test
