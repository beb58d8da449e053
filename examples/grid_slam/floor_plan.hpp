// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A floor of an office building and a drive through it, rendered: a corridor around a block of rooms, a
/// robot with a laser of 181 beams and wheels that drift. Truth is known, so that errors and their claimed
/// spread can be held against it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/eval/relations.hpp>
#include <cairn/io/carmen.hpp>

namespace grid_slam {

/// A wall, from one point to another [m].
struct Wall {
  double x0, y0, x1, y1;
};

struct DriveOptions {
  std::uint64_t seed = 1;
  int laps = 1;                  ///< of the corridor, and a little more
  double range_sigma = 0.01;     ///< of a range [m]
  double odometry_scale = 0.02;  ///< standard deviation of the wheels' scale, the same for the whole drive
  double turn_noise = 0.02;      ///< of the heading [rad] per square root of a radian turned
  double drift = 0.3;            ///< of the heading [deg] per square root of a metre
};

/// The drive: what the robot recorded, and where it was.
struct Drive {
  cairn::CarmenLog log;
  std::vector<cairn::SE2> truth;  ///< of the laser, at each scan
  std::vector<Wall> walls;
};

[[nodiscard]] Drive simulated_drive(const DriveOptions& options);

/// Range [m] from a pose along a beam to the first wall; infinity where there is none.
[[nodiscard]] double range_to_wall(const std::vector<Wall>& walls, double x, double y, double angle);

/// Relations of the truth: each pose to one about `spacing` scans later, and to later poses near by.
[[nodiscard]] std::vector<cairn::PoseRelation> true_relations(const Drive& drive, std::size_t spacing = 10);

}  // namespace grid_slam
