// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Does the covariance fit the errors on a recorded drive, whose reference has axes of its own?
///
/// A reference of satellites and gyroscopes is brought to the camera by a calibration that is some tenths of
/// a degree off. Poses T_i X, turned by a constant X in their own axes, make a path that leads away at a
/// fixed angle from the true one, while all turns agree: an error of metres a kilometre that is nobody's but
/// the reference's (and, to first order, that of a principal point wrong in both cameras alike). So X is
/// estimated from all poses, the other errors weighted by the covariance that is to be judged:
///   e_i = local(P_i, P_f (Q_f X)^-1 (Q_i X)),   minimise sum_i e_i^T C_i^-1 e_i over X in SO(3), (1)
/// P estimate with covariance C, Q reference, f the frame from which on the reference is believed. Three
/// numbers of 6 n take little out of the sum.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include <cairn/core/linalg.hpp>

#include "run_record.hpp"

namespace stereo_slam {

struct MountedConsistency {
  cairn::Vector<3> turn = cairn::Vector<3>::Zero();  ///< log of X [rad], camera's axes
  double nees_as_given = 0;                          ///< mean over the frames with X = I
  double nees = 0;                                   ///< with the X of (1)
  std::size_t frames = 0;
};

/// (1) over the frames after `first` that were tracked, have a reference and claim a covariance. Nothing
/// where `first` has no reference or fewer than three frames follow.
[[nodiscard]] std::optional<MountedConsistency> mounted_consistency(std::span<const FrameRecord> frames,
                                                                    std::size_t first);

/// Mean NEES of the three numbers that a level drive has, sideways, ahead and heading (3 where it is right):
/// for a reference whose height is not to be believed. Same frames, nothing is estimated.
[[nodiscard]] std::optional<double> level_nees(std::span<const FrameRecord> frames, std::size_t first);

}  // namespace stereo_slam
