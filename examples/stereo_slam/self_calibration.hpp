// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Corrects the rig's calibration while the camera moves.
///
/// A yaw of the right camera that is off by 0.3 mrad shifts every disparity by a fifth of a pixel and
/// stretches a whole drive by a percent. No single pair shows it, but points that were seen before and after
/// a motion do (cairn/geometry/motion_calibration.hpp). The frames are cut into motions just long enough that
/// half of the points are lost from view.
#pragma once

#include <vector>

#include <cairn/geometry/calibration_drift.hpp>

#include "landmarks.hpp"

namespace stereo_slam {

/// A landmark in the current pair of images.
struct Sighting {
  LandmarkId landmark;
  cairn::Vector<2> left, right;  ///< [pixels]
  double sigma;                  ///< of each coordinate
};

class SelfCalibration {
public:
  SelfCalibration(const cairn::StereoRig& nominal, const cairn::CalibrationDriftOptions& options)
      : drift_(nominal, options) {}

  /// The landmarks seen from a pose, one of each at most, in frames whose numbers rise. True where the
  /// correction changed.
  bool observe(int frame, const cairn::SE3& T_world_camera, std::vector<Sighting> sightings);

  /// What is known of the rig by the last frame, and of what it will be in the next one.
  [[nodiscard]] cairn::CalibrationDrift now() const { return drift_.ahead(now_ - begun_); }
  [[nodiscard]] cairn::CalibrationDrift next() const { return drift_.ahead(now_ - begun_ + 1); }

private:
  cairn::CalibrationDrift drift_;
  std::vector<Sighting> before_;  // at the beginning of the motion, by landmark
  cairn::SE3 T_world_before_;
  int begun_ = 0, now_ = 0;  // frames: that one, and the last one
};

}  // namespace stereo_slam
