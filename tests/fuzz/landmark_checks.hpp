// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What holds for a log of landmarks that any reader returned.
#pragma once

#include <cmath>

#include <cairn/core/linalg.hpp>

#include "fuzz/scratch.hpp"
#include "landmark_log.hpp"

namespace cairn_fuzz {

inline bool finite(const cairn::SE2& pose) {
  return std::isfinite(pose.x()) && std::isfinite(pose.y()) && std::isfinite(pose.angle());
}

/// Frames in the order of time, each with finite sightings and the motion since the one before. Noise drawn
/// by a simulation may make a range negative: `least_range`.
inline void check_landmark_log(const fastslam::LandmarkLog& log, double least_range = 0) {
  expect(!log.frames.empty(), "a log has frames");
  double before = -INFINITY;
  for (const fastslam::Frame& frame : log.frames) {
    expect(std::isfinite(frame.time) && frame.time >= before, "times are finite and do not run backwards");
    before = frame.time;
    expect(finite(frame.moved.mean) && frame.moved.covariance.allFinite(), "motions are finite");
    for (int i = 0; i < 3; ++i) expect(frame.moved.covariance(i, i) >= 0, "variances are not negative");
    for (const auto& sighting : frame.seen) {
      const double range = sighting.z.part<0>()(0);
      expect(std::isfinite(range) && range >= least_range, "ranges are distances");
      expect(std::isfinite(sighting.z.part<1>().angle()), "bearings are finite");
      expect(!sighting.identity || *sighting.identity < fastslam::Map::most_identity, "identities are small");
    }
  }
  for (const fastslam::Between& between : log.between)
    expect(between.frame < log.frames.size() && finite(between.moved), "poses lie between frames");
  before = -INFINITY;
  for (const cairn::StampedPose2& pose : log.truth) {
    expect(pose.time >= before && finite(pose.pose), "true poses are finite, in the order of time");
    before = pose.time;
  }
  for (const auto& [id, place] : log.landmarks) expect(place.allFinite(), "landmarks are finite");
}

}  // namespace cairn_fuzz
