// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "levelled_rig.hpp"

#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>

#include "dataset.hpp"
#include "front_end.hpp"
#include "pipeline.hpp"
#include "stereo_matcher.hpp"
#include "support/data.hpp"

namespace levelled_rig_test {
namespace {

using stereo_slam::FramePoints;
using stereo_slam::LevelledRig;
using stereo_slam::StereoFrame;

/// The rig as a file has it that does not know how the right camera is pitched.
cairn::StereoRig pitched(cairn::StereoRig rig, double degrees) {
  const cairn::Vector<3> turn(degrees * std::numbers::pi / 180, 0, 0);
  rig.T_left_right = {rig.T_left_right.rotation() * cairn::SO3::exp(turn), rig.T_left_right.translation()};
  return rig;
}

std::optional<LevelledRig> levelled_from(const cairn::StereoRig& rig, const StereoFrame& frame,
                                         const FramePoints& points) {
  const auto pairs =
      stereo_slam::StereoMatcher(rig, {})(frame.left, points.left, frame.right, points.right, 2);
  return stereo_slam::levelled(rig, {}, frame, points, pairs, 2);
}

/// Every so many frames: pitches are found to a twentieth of a degree, and none where there is none.
void check(const stereo_slam::DatasetOptions& options, std::size_t every) {
  const auto data = stereo_slam::open_dataset(options);
  stereo_slam::FrontEnd front_end({.points = 2000}, 2);
  for (std::size_t i = 0; i < data->size(); i += every) {
    CAPTURE(i);
    StereoFrame frame = data->frame(i);
    FramePoints points = front_end(frame);
    CHECK_FALSE(levelled_from(data->rig(), frame, points));
    for (const double degrees : {-1.0, -0.4, 0.3, 0.8}) {
      CAPTURE(degrees);
      const cairn::StereoRig rig = pitched(data->rig(), degrees);
      const auto level = levelled_from(rig, frame, points);
      REQUIRE(level);
      CHECK(std::abs(level->angle * 180 / std::numbers::pi + degrees) < 0.05);
      const auto apart = cairn::local(level->rig.T_left_right, data->rig().T_left_right);
      CHECK(apart.norm() < 0.05 * std::numbers::pi / 180);
      CHECK(std::abs(level->rows) > 2);
    }
    std::swap(frame.left, frame.right);
    std::swap(points.left, points.right);
    CHECK_FALSE(levelled_from(data->rig(), frame, points));
    frame.left = frame.right = cairn::Image(frame.left.width(), frame.left.height(), 90);
    CHECK_FALSE(levelled_from(data->rig(), frame, front_end(frame)));
  }
}

}  // namespace

TEST_SUITE("levelled rig") {
  TEST_CASE("levelled rig: how a camera is pitched is found in the arena, and level rigs are left alone") {
    for (const char* script : {"turn", "loop"}) {
      CAPTURE(script);
      stereo_slam::DatasetOptions options;
      options.frames = 21;
      options.arena.script = script;
      check(options, 20);
    }
  }

  TEST_CASE("levelled rig: the same on recorded drives, unrectified ones among them") {
    for (const std::string kind : {"kitti_odometry", "kitti_raw"}) {
      CAPTURE(kind);
      const auto folder = cairn_test::real_data(kind == "kitti_raw" ? "kitti_raw_0926" : "kitti_odometry_a");
      if (!folder) continue;
      stereo_slam::DatasetOptions options;
      options.kind = kind;
      options.folder = *folder;
      check(options, 40);
    }
  }

  TEST_CASE("levelled rig: a run with a pitched camera is as good as one with a level one, and says so") {
    stereo_slam::DatasetOptions arena;
    arena.frames = 12;
    arena.arena.script = "turn";
    const auto data = stereo_slam::open_dataset(arena);
    const cairn::StereoRig rig = pitched(data->rig(), 0.6);
    stereo_slam::PipelineOptions options;
    options.threads = 2;
    stereo_slam::Pipeline pipeline(rig, options);
    for (std::size_t i = 0; i < data->size(); ++i) {
      const auto& record = pipeline.step(data->frame(i));
      REQUIRE(record.tracked);
      REQUIRE(record.truth);
      CHECK(cairn::local(*record.truth, record.T_world_camera).head<3>().norm() < 0.01);
    }
    const auto run = pipeline.record();
    CHECK(run.calibration.on);
    REQUIRE(run.notes.size() == 1);
    CHECK(run.notes[0].find("turned by -0.6") != std::string::npos);
    CHECK(cairn::local(run.rig.T_left_right, data->rig().T_left_right).tail<3>().norm() < 1e-3);
    CHECK_NOTHROW(stereo_slam::Pipeline(rig, options, pipeline.map(), "map"));  // is a map of this rig
    CHECK_THROWS_WITH_AS(stereo_slam::Pipeline(pitched(data->rig(), 4), options, pipeline.map(), "map"),
                         doctest::Contains("made with another rig"), cairn::Error);

    options.calibrate = stereo_slam::Calibration::off;
    stereo_slam::Pipeline as_given(rig, options);
    CHECK_THROWS_WITH_AS(as_given.step(data->frame(0)), doctest::Contains("rows of the right image"),
                         cairn::Error);
  }
}

}  // namespace levelled_rig_test
