// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where the robot of the arena is at each frame.
#pragma once

#include <string>
#include <vector>

#include <cairn/manifold/se3.hpp>

namespace stereo_slam {

/// Where the robot stands on the floor: position [m], heading [rad, 0 along x, counter-clockwise].
struct Stance {
  double x = 0;
  double y = 0;
  double heading = 0;
};

/// The stances of a script (turn, loop or spiral; see ArenaOptions), one a frame. Throws Error for another
/// name.
[[nodiscard]] std::vector<Stance> script_stances(const std::string& script);

/// Frames in one lap of `loop`: frame i + loop_lap() stands where frame i does.
[[nodiscard]] std::size_t loop_lap();

/// Pose of the left camera on the robot at `stance`: the pair is centred over the robot half a metre above
/// the floor and looks 11 degrees down; rough ground tilts and lifts it a little, always the same at the same
/// stance.
[[nodiscard]] cairn::SE3 left_camera_pose(const Stance& stance, double baseline);

}  // namespace stereo_slam
