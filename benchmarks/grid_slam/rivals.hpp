// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What others make of a log, where their folders are given: GMapping (Grisetti, Stachniss, Burgard, T-RO 23,
/// 2007, as openslam_gmapping has it) and open_karto, a graph of matched scans.
///
/// They read the log's scans with the laser's pose by odometry, in the order of the file, and give a pose for
/// those they process; a path for all scans follows odometry between, as the mapper's own does.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <cairn/io/carmen.hpp>
#include <cairn/manifold/se2.hpp>

namespace grid_slam_bench {

struct RivalPath {
  std::vector<std::size_t> processed;  ///< scans, rising; the first of the log is one
  std::vector<cairn::SE2> poses;       ///< of those
  double cpu_seconds = 0;
};

/// With the settings that its ROS node has unless told otherwise. Nothing where it was not built in.
[[nodiscard]] std::optional<RivalPath> gmapping(const cairn::CarmenLog& log, std::uint64_t seed);

/// With its own settings; its graph is solved by least squares, for which it has no solver of its own.
/// Nothing where it was not built in.
[[nodiscard]] std::optional<RivalPath> open_karto(const cairn::CarmenLog& log);

}  // namespace grid_slam_bench
