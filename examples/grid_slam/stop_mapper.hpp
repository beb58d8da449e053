// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// DP-SLAM: particles drawn from odometry, many of each, over maps of how much every cell stops; the maps as
/// a tree of ancestors or as shared tiles, with the same result bit for bit.
///
/// No loop closing: what closes a loop is a particle that came back right. (A. Eliazar, R. Parr, "DP-SLAM
/// 2.0", ICRA 2004.) Poses may instead be drawn where the scan matches an occupancy grid kept beside the
/// stops, and weighed by the stops: one draw a particle, at the cost of a second map.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <cairn/eval/relations.hpp>
#include <cairn/io/carmen.hpp>
#include <cairn/scan/stop_grid.hpp>

#include "mapper.hpp"
#include "outputs.hpp"

namespace grid_slam {

enum class StopStorage { tiles, ancestry };
enum class StopProposal { motion, match };

struct StopMapperOptions {
  /// As MapperOptions::start. None: by luck, more runs over ACES keep together so (docs/grid.md).
  std::optional<cairn::SE2> start{};
  StopStorage storage = StopStorage::ancestry;
  std::size_t particles = 50;
  StopProposal proposal = StopProposal::motion;
  std::size_t draws = 10;  ///< of each particle from its motion, of which one is kept
  std::uint64_t seed = 1;
  unsigned threads = 1;
  cairn::StopOptions map{.every = 5};
  OdometryNoise odometry{.offset = 0.01,
                         .per_metre = 0.05,
                         .per_radian = 0.02,
                         .angle_offset = 0.005,
                         .angle_per_metre = 0.03,
                         .angle_per_radian = 0.05};
  double step_distance = 0.2;  ///< [m] between processed scans
  double step_angle = 0.15;    ///< [rad]
  double resample_below = 0.5;
};

/// Scans are matched as the grid mapper does it, so that its steps and odometry are the right ones. More of
/// the beams' evidence counts than where poses are only drawn: ten draws of each particle would not survive
/// it.
[[nodiscard]] StopMapperOptions matching_stops();

/// Maps the log; the rest as run(). The covariance of the newest pose is as Mapper::newest() where scans are
/// matched. Drawn from motion it is that of lines that died out as well, and, where a scan sees what was seen
/// 2 m before or earlier, of how well it fits there, by all that the beams' evidence leaves open: too modest
/// where that counts for less than it is worth. Throws cairn::Error on options out of range.
[[nodiscard]] Results run_stop_mapper(const cairn::CarmenLog& log, const StopMapperOptions& options,
                                      const std::vector<cairn::PoseRelation>& relations,
                                      const std::function<std::optional<std::string>()>& on_scan = {},
                                      std::size_t frames = 0);

}  // namespace grid_slam
