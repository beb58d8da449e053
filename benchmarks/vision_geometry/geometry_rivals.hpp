// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What other libraries of the system make of the same problem.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_pose.hpp>

namespace rivals {

/// One named way to a pose; nothing where it finds none.
struct PoseRival {
  std::string name;
  std::optional<cairn::SE3> (*solve)(const cairn::StereoRig&, std::span<const cairn::StereoMatch>);
};

/// OpenCV's solvePnPRansac on the left image with its own refinement, and estimateAffine3D on triangulated
/// points; OpenGV's RANSAC on triangulated points with its own refinement; those that were found.
std::span<const PoseRival> pose_rivals();

#ifdef CAIRN_BENCH_OPENGV
std::optional<cairn::SE3> opengv_pose(const cairn::StereoRig& rig,
                                      std::span<const cairn::StereoMatch> matches);
#endif

/// The rigid motion of two point sets by somebody else, on points already in its own containers.
struct AlignmentRival {
  std::string name;
  std::function<cairn::Matrix<4>()> solve;
};

/// Eigen::umeyama, which is always there; PCL's SVD and OpenGV's Arun where they were found.
std::vector<AlignmentRival> alignment_rivals(std::span<const cairn::Vector<3>> source,
                                             std::span<const cairn::Vector<3>> target);

}  // namespace rivals
