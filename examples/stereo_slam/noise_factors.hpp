// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How much larger variances are than the pixel sigma says, from how well frames fit the map.
#pragma once

#include <algorithm>

#include <cairn/core/statistics.hpp>
#include <cairn/slam/keyframe_map.hpp>

namespace stereo_slam {

/// What says where the landmarks of a frame are.
enum class Places {
  patches,   ///< the surface around them (surface_patch.hpp)
  keypoints  ///< the points that were found on it
};

/// Two running means over the frames; the sigma given counts as some frames.
///
/// Pixels, for gates: the median chi^2 of the matches that agree over that of four degrees of freedom. Only
/// ever larger than 1: a gate that follows a good fit down would throw out what fits less well.
///
/// Poses, for what is reported: the cluster-robust score variance of MapLocation, widened. What neighbours in
/// the image have in common shows in it; what the whole image has in common the pose has absorbed, such as
/// what a surface that is no plane does to all patches as the camera comes nearer. Measured on the rendered
/// arena, where the truth is known, the variance of poses is 1.5 times what they say on the spot, and about
/// 2.5 where the viewpoint changes (by 2 % of the distance and more between keyframes). Keypoints of a
/// surface all wander the same way as the camera comes nearer: 6 where these say where landmarks are.
class NoiseFactors {
public:
  /// What the factor of poses comes to where the camera moves.
  static constexpr double by_patches = 2.5, by_keypoints = 6;

  NoiseFactors() = default;
  /// Goes on from factors that were found before.
  NoiseFactors(double pixels, double poses) : pixels_(given * pixels), poses_(given * poses) {}

  /// Takes a frame; returns its median chi^2 over what it should be.
  double observe(const cairn::MapLocation& frame, Places places) {
    const double fit = frame.median_chi_squared / median_;
    count_ += 1;
    pixels_ += fit;
    poses_ += unseen(frame.viewpoint_change, places) * frame.score_variance;
    return fit;
  }

  [[nodiscard]] double pixels() const noexcept { return std::max(1.0, pixels_ / count_); }
  [[nodiscard]] double poses() const noexcept { return poses_ / count_; }

private:
  static constexpr double given = 5;  // frames that the sigma given is worth
  /// Variance of a pose over what the scores say.
  [[nodiscard]] static double unseen(double viewpoint_change, Places places) noexcept {
    constexpr double on_the_spot = 1.5, change = 0.02;
    const double moving = places == Places::patches ? by_patches : by_keypoints;
    const double x = viewpoint_change / change;
    return on_the_spot + (moving - on_the_spot) * x * x / (1 + x * x);
  }

  double median_ = cairn::chi_square_quantile(0.5, 4);
  double pixels_ = given, poses_ = given, count_ = given;
};

}  // namespace stereo_slam
