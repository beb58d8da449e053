// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The least squares of a drive's poses and lines together, whose associations are those along a path.
#pragma once

#include <vector>

#include <cairn/manifold/se3.hpp>

#include "drive.hpp"
#include "line_sensor.hpp"

namespace line_slam {

/// The path that odometry and all sightings make likeliest when they are of the lines that they are nearest
/// to along `path`, which is of the drive's first frames; `empty` says how they are chosen. A wrong one loses
/// its say as it comes to contradict the others (S. Geman, D. McClure, Bull. Int. Stat. Inst. 52, 1987).
/// Sparse Gauss-Newton with Levenberg's damping. The path as it is where nothing better is found.
[[nodiscard]] std::vector<cairn::SE3> smoothed(const Drive& drive, const std::vector<cairn::SE3>& path,
                                               const Map& empty);

}  // namespace line_slam
