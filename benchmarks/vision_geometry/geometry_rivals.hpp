// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What other libraries of the system make of the same problem.
#pragma once

#include <optional>
#include <span>
#include <string>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_pose.hpp>

namespace rivals {

/// One named way to a pose; nothing where it finds none.
struct PoseRival {
  std::string name;
  std::optional<cairn::SE3> (*solve)(const cairn::StereoRig&, std::span<const cairn::StereoMatch>);
};

/// OpenCV's solvePnPRansac on the left image with its own refinement, and estimateAffine3D on triangulated
/// points; empty without OpenCV.
std::span<const PoseRival> pose_rivals();

/// Eigen::umeyama without scale, which is always there.
cairn::Matrix<4> umeyama(std::span<const cairn::Vector<3>> source, std::span<const cairn::Vector<3>> target);

}  // namespace rivals
