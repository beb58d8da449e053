// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A pose for every scan, of which a mapper has processed some.
#pragma once

#include <cstddef>
#include <vector>

#include <cairn/eval/relations.hpp>
#include <cairn/io/carmen.hpp>
#include <cairn/manifold/se2.hpp>

namespace grid_slam {

/// Between the processed scans the path follows odometry, and the gap to the next one is spread along the
/// way. `processed(k)` is the scan of pose(k), in rising order, from the first scan on.
template <class Processed, class Pose>
[[nodiscard]] std::vector<cairn::StampedPose2> filled_path(const std::vector<cairn::StampedScan>& scans,
                                                           std::size_t count, const Processed& processed,
                                                           const Pose& pose) {
  using cairn::SE2;
  using cairn::Vector;
  std::vector<cairn::StampedPose2> all;
  all.reserve(scans.size());
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t from = processed(k);
    const std::size_t to = k + 1 < count ? processed(k + 1) : scans.size();
    const SE2 odometry = scans[from].T_odom_laser.inverse();
    Vector<3> gap = Vector<3>::Zero();
    if (k + 1 < count) gap = cairn::local(SE2(pose(k) * (odometry * scans[to].T_odom_laser)), pose(k + 1));
    for (std::size_t i = from; i < to; ++i) {
      const double share = static_cast<double>(i - from) / static_cast<double>(to - from);
      const SE2 moved = pose(k) * (odometry * scans[i].T_odom_laser);
      all.push_back({scans[i].time, cairn::retract(moved, Vector<3>(share * gap))});
    }
  }
  return all;
}

}  // namespace grid_slam
