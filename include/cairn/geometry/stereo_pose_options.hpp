// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How a stereo pose is estimated, and what may be known of it beforehand.
#pragma once

#include <cstddef>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/ransac.hpp>
#include <cairn/geometry/robust_loss.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

struct StereoPoseOptions {
  RansacOptions ransac = {};       ///< order progressive: matches are sorted, most trusted (earliest) first
  double gate_probability = 0.99;  ///< share of good matches that pass the chi-square gate
  RobustLoss loss = RobustLoss::cauchy;
  double loss_scale = 3;        ///< in standard deviations of the whole residual
  std::size_t min_inliers = 8;  ///< fewer: no consensus
  double min_share = 0.1;       ///< of all matches that must agree; below it agreement may be chance
  /// False where the right row only repeats the left one, as trackers on rectified images deliver it: it is
  /// then not counted as a measurement.
  bool right_rows = true;
};

/// What is known of the pose beforehand, such as a motion prediction: one more hypothesis and, where
/// `information` is not zero, one more measurement in the refinement.
struct PosePrior {
  SE3 T_world_camera;
  Matrix<6> information = Matrix<6>::Zero();  ///< of a right step, translation then rotation
};

}}  // namespace cairn::CAIRN_ABI
