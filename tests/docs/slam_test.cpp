// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The examples in the headers of cairn/slam, compiled and run: see CMakeLists.txt.
#include <algorithm>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/slam/keyframe_map.hpp>
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
  const std::size_t shown = first.size() + second.unmatched.size();
  CHECK(map.landmark_count() <= shown);
  CHECK(map.landmark_count() + shown / 50 >= shown);  // a sighting of few pixels' disparity may make no point
}

}  // namespace docs_slam_test
