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

  /// The landmarks seen from a pose, one of each at most. True where the correction changed.
  bool observe(const cairn::SE3& T_world_camera, std::vector<Sighting> sightings);

  [[nodiscard]] cairn::StereoRig rig() const { return drift_.corrected(); }
  [[nodiscard]] const cairn::CalibrationDrift& drift() const noexcept { return drift_; }

private:
  cairn::CalibrationDrift drift_;
  std::vector<Sighting> before_;  // at the beginning of the motion, by landmark
  cairn::SE3 T_world_before_;
  int frames_ = 0;  // since then
};

}  // namespace stereo_slam
