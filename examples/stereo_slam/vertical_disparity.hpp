// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Whether a rig is calibrated as it says, from one pair of images and without any truth: true pairs of
/// points lie on each other's epipolar lines, and where the calibration is off their distance from them is no
/// noise but a slope over the image.
#pragma once

#include <cstddef>
#include <deque>
#include <span>

#include <cairn/geometry/calibration_drift.hpp>
#include <cairn/geometry/stereo_rig.hpp>

namespace stereo_slam {

/// Epipolar distance = offset + slope_x x + slope_y y, x and y from -1 to 1 over the left image. [pixels]
struct VerticalDisparity {
  double offset = 0, slope_x = 0, slope_y = 0;
  double sigma_offset = 0, sigma_x = 0, sigma_y = 0;
  std::size_t points = 0;

  /// A part of it is beyond doubt (five sigma) and large enough (0.1 pixels) to move disparities as much.
  [[nodiscard]] bool shows() const noexcept;
};

/// Robust fit to the pairs of one frame; all zero where there are fewer than 30. Needs a left image with a
/// size.
[[nodiscard]] VerticalDisparity vertical_disparity(const cairn::StereoRig& rig,
                                                   std::span<const cairn::PixelPair> pairs);

/// Notices that a rig comes loose which was never quite as its file says: what lenses leave over differs from
/// scene to scene, so that departing from the usual counts, not being off. Its offset is looked at only: on
/// recorded drives whose rig stands still it departed by 0.25 pixels at most, its slope by 1, and a camera
/// knocked by 4 mrad moved the offset by 1.2 and 1.7.
class DisparityWatch {
public:
  /// Takes a frame's; too few points are passed over. True where this frame and the four before depart from
  /// the median of the up to forty before them (ten at least), all to the same side, by half a pixel and six
  /// deviations.
  [[nodiscard]] bool departs(const VerticalDisparity& seen);

private:
  std::deque<double> offsets_;
};

}  // namespace stereo_slam
