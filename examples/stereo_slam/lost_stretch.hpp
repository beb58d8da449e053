// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Poses of frames that showed nothing, once it is known where the camera was before and after.
///
/// Between two known poses T_a and T_b, s seconds after the one and D in all, the camera is taken to have
/// kept its twist:
///   T = T_a exp(s / D log(T_a^-1 T_b)),   P = (1 - s / D) P_a + s / D P_b + A s^2 (D - s)^2 / (3 D) (1)
/// with A the spectral densities of SteadyTwist's acceleration: what an acceleration that is white does to a
/// path whose ends are known and whose speed is not (the integral over its Green's function squared, of
/// x'' = w with x(0) = x(D) = 0). The errors of the ends are taken for the same error. To first order in how
/// far the camera turns meanwhile.
#pragma once

#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se3.hpp>

#include "pose_filter.hpp"
#include "run_record.hpp"

namespace stereo_slam {

/// (1): `seconds` after `before`, of `duration` in all. Expects 0 <= seconds <= duration and duration > 0.
[[nodiscard]] cairn::Gaussian<cairn::SE3> pose_between(const cairn::Gaussian<cairn::SE3>& before,
                                                       const cairn::Gaussian<cairn::SE3>& after,
                                                       double seconds, double duration,
                                                       const SteadyTwist& process);

/// Gives lost frames that lie between known ones, tracked or carried, their poses by (1); they are then
/// `bridged`. After the last known frame the pose stays, and its covariance grows by how far the camera would
/// have come with its last twist, whichever way it went, and by the acceleration: T = T_a,
/// P = P_a + s^2 diag(|v|^2 I, |w|^2 I) + A s^3 / 3. Frames before the first known one stay as they are.
/// Times as by seconds_between(). O(frames).
void lay_lost_frames(std::vector<FrameRecord>& frames, const SteadyTwist& process);

}  // namespace stereo_slam
