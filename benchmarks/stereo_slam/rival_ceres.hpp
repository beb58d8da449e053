// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Keyframes and landmarks solved jointly by Ceres, where that is installed. Nothing of slam/ is used.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>

#include "slam/simulated_arena.hpp"

namespace stereo_slam_bench {

/// A least squares problem: poses, of which the first is known to `first_sigma` [m, rad], and points.
struct Bundle {
  struct Sighting {
    std::size_t pose = 0, point = 0;
    cairn::Vector<2> left = cairn::Vector<2>::Zero(), right = cairn::Vector<2>::Zero();  ///< [pixels]
    double sigma = 1;                                                                    ///< [pixels]
  };
  std::vector<cairn::SE3> poses;         ///< T_world_camera, where to begin
  std::vector<cairn::Vector<3>> points;  ///< world, where to begin [m]
  std::vector<Sighting> sightings;
  double first_sigma = 1e-6;
};

struct BundleSolution {
  std::vector<cairn::SE3> poses;
  /// Of all poses but the first; small steps in the world, translation then rotation.
  cairn::Matrix<cairn::dynamic, cairn::dynamic> covariance;
  double seconds = 0;  ///< CPU, of the minimum without the covariance
};

/// What became of a window that was driven over frames: the pose of every frame but the first.
struct WindowRun {
  std::vector<cairn::SE3> poses;
  std::vector<cairn::Matrix<6>> covariances;  ///< of a right step, translation then rotation
  std::size_t keyframes = 0;                  ///< made
  double seconds = 0;                         ///< CPU, of all
};

/// The minimum over poses and points of a pinhole rig without distortion whose cameras differ by a shift.
/// Nothing where the program was built without Ceres, or where Ceres comes to no minimum.
[[nodiscard]] std::optional<BundleSolution> solve_with_ceres(const cairn::StereoRig& rig,
                                                             const Bundle& bundle);

/// Drives a window of `size` keyframes over the frames: every frame's pose with all the window's poses and
/// points, a keyframe by the rule that the map goes by, and over the size the oldest keyframe marginalised
/// with what it and the others but the newest saw of its points. Those the newest sees begin anew with that.
[[nodiscard]] std::optional<WindowRun> drive_ceres_window(const cairn::StereoRig& rig,
                                                          const std::vector<cairn_test::ArenaFrame>& frames,
                                                          const cairn_test::ArenaRule& rule,
                                                          std::size_t size);

}  // namespace stereo_slam_bench
