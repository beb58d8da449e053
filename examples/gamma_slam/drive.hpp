// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Two laps around a field, seen by a stereo camera: heights of the ground, and visual odometry from points
/// that the camera follows.
///
/// Rendered is geometry, not light: every pixel of a coarse image is a ray that ends on the ground, its
/// disparity is noisy, and what is behind a rock is hidden. Visual odometry is estimated from noisy matches
/// by the library's stereo pose; where the ground has no texture there are few.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/se2.hpp>

#include "terrain.hpp"

namespace gamma_slam {

/// A point of the ground, from the vehicle: x ahead, y to the left, z up by the accelerometer, all from where
/// the wheels stand [m].
struct GroundPoint {
  double x = 0;
  double y = 0;
  double height = 0;
};

/// One step: how the vehicle came here, and what it sees.
struct TerrainScan {
  double time = 0;
  cairn::SE2 moved;  ///< since the scan before, by visual odometry
  cairn::Matrix<3> moved_covariance = cairn::Matrix<3>::Zero();  ///< on its right
  double climbed = 0;                                            ///< [m], the same way
  double climbed_variance = 0;                                   ///< [m^2]
  std::vector<GroundPoint> points;
};

struct DriveOptions {
  std::uint64_t seed = 1;
  int laps = 2;                   ///< of 80 m
  double step = 0.4;              ///< [m] between scans
  double disparity_sigma = 0.15;  ///< [pixels]
  double pixel_sigma = 0.4;       ///< of a point followed by visual odometry [pixels]
  double common_sigma = 0.5;     ///< of what all points of a look are shifted by: vibration, shutter [pixels]
  double rig_sigma = 0.05;       ///< of the disparity's error, the same for the whole drive [pixels]
  std::size_t matches = 60;      ///< where there is texture
  std::size_t few_matches = 10;  ///< on the 20 m of each lap where there is little of it
  double blurred = 12;           ///< pixel_sigma there, over that elsewhere
  double level_sigma = 0.1;      ///< of pitch and roll by the accelerometer [deg]
};

struct Drive {
  std::string name = "rendered terrain";
  std::optional<Terrain> terrain{};  ///< nothing where the ground is a real one
  std::vector<TerrainScan> scans;
  std::vector<cairn::SE2> truth;             ///< of the vehicle at each scan
  std::optional<std::string> ended_early{};  ///< why a recording is not driven to its end
};

/// Where visual odometry does not tell a motion, the step before is made again, with a covariance that says
/// so.
[[nodiscard]] Drive simulated_drive(const DriveOptions& options);

/// Poses by visual odometry alone, from the true start.
[[nodiscard]] std::vector<cairn::SE2> odometry_path(const Drive& drive);

}  // namespace gamma_slam
