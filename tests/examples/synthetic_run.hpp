// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A run that never was, whose errors are known by construction.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/manifold/se3.hpp>

#include "run_record.hpp"

namespace cairn_test {

/// Pose at (x, y, z), turned by `yaw` about the camera's y axis.
inline cairn::SE3 pose(double x, double y, double z, double yaw = 0) {
  return {cairn::SO3::exp(cairn::Vector<3>(0, yaw, 0)), cairn::Vector<3>(x, y, z)};
}

/// Frame i of a drive straight ahead, one metre and a tenth of a second a frame; stage s takes i + s ms.
inline stereo_slam::FrameRecord straight_frame(std::size_t i) {
  stereo_slam::FrameRecord frame;
  const auto n = static_cast<double>(i);
  frame.index = i;
  frame.time = 0.1 * n;
  frame.T_world_camera = pose(0, 0, n);
  frame.covariance = 1e-4 * cairn::Matrix<6, 6>::Identity();
  frame.truth = frame.T_world_camera;
  frame.tracked = true;
  frame.points_left = 1000 + static_cast<int>(i);
  frame.points_right = 990;
  frame.stereo_matches = 500 + static_cast<int>(i);
  frame.map_matches = 300 + static_cast<int>(i);
  frame.inliers = 200 + static_cast<int>(i);
  frame.landmarks = 10 * i;
  for (std::size_t stage = 0; stage < frame.milliseconds.size(); ++stage)
    frame.milliseconds[stage] = n + static_cast<double>(stage);
  return frame;
}

/// A drive straight ahead without an error.
inline stereo_slam::RunRecord straight_run(std::size_t frames) {
  stereo_slam::RunRecord run;
  run.dataset = "straight";
  run.store = "multi";
  run.seed = 7;
  run.threads = 2;
  run.target_points = 2000;
  run.seconds = 4;
  for (std::size_t i = 0; i < frames; ++i) run.frames.push_back(straight_frame(i));
  return run;
}

/// `laps` of a circle of 4 m radius with a slow drift, landmarks on a fence around it, and a sample frame:
/// what a report looks like in earnest.
inline stereo_slam::RunRecord circular_run(std::size_t frames, std::size_t landmarks, double laps = 2) {
  stereo_slam::RunRecord run = straight_run(frames);
  run.dataset = "synthetic circle";
  cairn::Random random(1);
  for (stereo_slam::FrameRecord& frame : run.frames) {
    const double share = static_cast<double>(frame.index) / static_cast<double>(frames);
    const double angle = 2 * std::numbers::pi * laps * share;
    frame.truth = pose(4 - 4 * std::cos(angle), 0, 4 * std::sin(angle), angle);
    const double drift = 0.05 * share * (1 + std::sin(3 * angle));
    frame.T_world_camera = *frame.truth * pose(drift, 0.3 * drift, drift, 0.02 * drift);
    frame.landmarks = static_cast<std::size_t>(static_cast<double>(landmarks) * (1 - std::exp(-4 * share)));
    frame.points_left = 1900 + static_cast<int>(random.uniform(0, 100));
    frame.stereo_matches = 800 + static_cast<int>(random.uniform(0, 200));
    frame.map_matches = 500 + static_cast<int>(200 * std::sin(angle) + random.uniform(0, 50));
    frame.inliers = frame.map_matches - 60;
    for (std::size_t stage = 0; stage + 1 < frame.milliseconds.size(); ++stage)
      frame.milliseconds[stage] = (1 + static_cast<double>(stage % 3)) * random.uniform(2, 4);
    frame.milliseconds.back() = 40 + random.uniform(0, 10);
  }
  for (std::size_t i = 0; i < landmarks; ++i) {
    stereo_slam::LandmarkRecord landmark;
    const double angle = random.uniform(0, 2 * std::numbers::pi), up = random.uniform(0, 0.5);
    landmark.position = cairn::Vector<3>(4 + 7 * std::cos(angle), 0.4 - up, 7 * std::sin(angle));
    landmark.covariance = std::pow(0.01 + 0.05 * up, 2) * cairn::Matrix<3, 3>::Identity();
    landmark.grey = static_cast<std::uint8_t>(random.uniform(20, 250));
    landmark.age = static_cast<int>(random.uniform(0, static_cast<double>(frames)));
    landmark.sightings = 1 + landmark.age / 3;
    run.landmarks.push_back(landmark);
  }
  stereo_slam::SampleFrame sample{frames / 2, cairn::Image(768, 576), cairn::Image(768, 576), {}};
  for (int y = 0; y < 576; ++y)
    for (int x = 0; x < 768; ++x)
      sample.left(x, y) =
          static_cast<std::uint8_t>(96 + 60 * std::sin(0.05 * x) * std::cos(0.04 * y) + y / 8);
  for (int i = 0; i < 900; ++i) {
    const auto x = static_cast<float>(random.uniform(40, 760)),
               y = static_cast<float>(random.uniform(5, 570));
    const auto kind = static_cast<stereo_slam::SamplePoint::Kind>(i % 10 == 0 ? 1 : i % 3 == 0 ? 0 : 2);
    sample.points.push_back({x, y, x - static_cast<float>(random.uniform(3, 30)), y, kind});
  }
  run.sample = std::move(sample);
  return run;
}

}  // namespace cairn_test
