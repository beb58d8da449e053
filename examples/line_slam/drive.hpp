// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A drive around the campus, rendered: what the cameras saw and what odometry said.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se3.hpp>

#include "campus.hpp"
#include "line_sensor.hpp"
#include "segments.hpp"

namespace line_slam {

struct DriveOptions {
  std::uint64_t seed = 1;
  double metres = 250;
  double step = 0.75;  ///< between pictures [m]
  unsigned threads = 1;
  // Odometry errs by these, independently from step to step: a share of the way and an angle a metre.
  double slip = 0.03;
  double turn = 0.0175, tilt = 0.0035;  ///< [rad/m] about the vertical, about the others
  DetectorKind detector_kind = DetectorKind::noise;
  DetectorOptions detector{};
  MatchingOptions matching{};
};

struct Frame {
  cairn::Gaussian<cairn::SE3> moved{};  ///< since the frame before, by odometry; the first is where it stands
  Map::Observation seen{};
  Detections detections{};
};

struct Drive {
  DriveOptions options{};
  Campus campus{1};
  Rig rig = three_cameras();
  std::vector<cairn::SE3> truth{};  ///< one for each frame
  std::vector<Frame> frames{};
};

/// Called as frames are drawn, in their order and by the caller's thread: how many there are, and of how
/// many. The drive ends where it says false.
using OnDrawn = std::function<bool(std::size_t frames, std::size_t of)>;

/// The same for any number of threads. Throws cairn::Error where a number is out of its range.
[[nodiscard]] Drive simulated_drive(const DriveOptions& options, const OnDrawn& on_drawn = {});

}  // namespace line_slam
