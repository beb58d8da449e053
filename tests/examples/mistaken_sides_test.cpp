// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "mistaken_sides.hpp"

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <doctest/doctest.h>

#include "dataset.hpp"
#include "front_end.hpp"
#include "stereo_matcher.hpp"
#include "support/data.hpp"

namespace mistaken_sides_test {
namespace {

using stereo_slam::FramePoints;
using stereo_slam::StereoFrame;

std::optional<std::string> said_of(const cairn::StereoRig& rig, const StereoFrame& frame,
                                   FramePoints points) {
  const auto pairs =
      stereo_slam::StereoMatcher(rig, {})(frame.left, points.left, frame.right, points.right, 2);
  return mistaken_sides(rig, {}, frame, points, pairs, 2);
}

/// Every so many frames: as they are, and mistaken in every way.
void check(const stereo_slam::DatasetOptions& options, std::size_t every) {
  const auto data = stereo_slam::open_dataset(options);
  const cairn::StereoRig& rig = data->rig();
  stereo_slam::FrontEnd front_end({.points = 2000}, 2);
  for (std::size_t i = 0; i < data->size(); i += every) {
    CAPTURE(i);
    StereoFrame frame = data->frame(i);
    FramePoints points = front_end(frame);
    CHECK_FALSE(said_of(rig, frame, points));
    cairn::StereoRig turned = rig;
    turned.T_left_right = rig.T_left_right.inverse();
    CHECK(said_of(turned, frame, points));
    turned.T_left_right = {rig.T_left_right.rotation(), -rig.T_left_right.translation()};
    CHECK(said_of(turned, frame, points));
    turned.T_left_right = {rig.T_left_right.rotation(), 1e3 * rig.T_left_right.translation()};
    const auto millimetres = said_of(turned, frame, points);
    REQUIRE(millimetres);
    CHECK(millimetres->find("expected a baseline in metres") != std::string::npos);
    std::swap(frame.left, frame.right);
    std::swap(points.left, points.right);
    CHECK(said_of(rig, frame, points));
    frame.left = frame.right = cairn::Image(frame.left.width(), frame.left.height(), 90);
    CHECK_FALSE(said_of(rig, frame, front_end(frame)));
  }
}

}  // namespace

TEST_SUITE("mistaken_sides") {
  TEST_CASE("mistaken sides: they are seen in the arena, and right ones are not doubted") {
    for (const char* script : {"turn", "loop", "spiral"}) {
      CAPTURE(script);
      stereo_slam::DatasetOptions options;
      options.frames = 21;
      options.arena.script = script;
      check(options, 20);
    }
  }

  TEST_CASE("mistaken sides: they are seen on recorded drives, and right ones are not doubted") {
    for (const std::string kind : {"kitti_odometry", "kitti_raw"}) {
      CAPTURE(kind);
      const char* name = kind == "kitti_raw" ? "kitti_raw_0926" : "kitti_odometry_a";
      const auto folder = cairn_test::real_data(name);
      if (!folder) continue;
      stereo_slam::DatasetOptions options;
      options.kind = kind;
      options.folder = *folder;
      check(options, 10);
    }
  }
}

}  // namespace mistaken_sides_test
