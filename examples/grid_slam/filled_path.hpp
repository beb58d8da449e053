// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A pose for every scan, of which a mapper has processed some.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include <cairn/eval/relations.hpp>
#include <cairn/io/carmen.hpp>
#include <cairn/manifold/se2.hpp>

#include "scan_delay.hpp"

namespace grid_slam {

/// Between the processed scans the path follows odometry, and the gap to the next one is spread along the
/// way: by metres plus radians, for a robot that stands does not err, and evenly where odometry saw no way at
/// all. `processed(k)` is the scan of pose(k),
/// in rising order, from the first scan on. Scans lag behind odometry by `delay`, in scans.
template <class Processed, class Pose>
[[nodiscard]] std::vector<cairn::StampedPose2> filled_path(const std::vector<cairn::StampedScan>& scans,
                                                           std::size_t count, const Processed& processed,
                                                           const Pose& pose, double delay = 0) {
  using cairn::SE2;
  using cairn::Vector;
  std::vector<SE2> odometry;
  odometry.reserve(scans.size());
  for (std::size_t i = 0; i < scans.size(); ++i) odometry.push_back(delayed_odometry(scans, i, delay));
  const auto way = [&](std::size_t i) {  // from scan i to the next
    const SE2 moved = odometry[i].inverse() * odometry[i + 1];
    return moved.translation().norm() + std::abs(moved.angle());
  };
  std::vector<cairn::StampedPose2> all;
  all.reserve(scans.size());
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t from = processed(k);
    const std::size_t to = k + 1 < count ? processed(k + 1) : scans.size();
    const SE2 back = odometry[from].inverse();
    Vector<3> gap = Vector<3>::Zero();
    if (k + 1 < count) gap = cairn::local(SE2(pose(k) * (back * odometry[to])), pose(k + 1));
    double whole = 0, gone = 0;
    for (std::size_t i = from; i < to && i + 1 < scans.size(); ++i) whole += way(i);
    for (std::size_t i = from; i < to; ++i) {
      const SE2 moved = pose(k) * (back * odometry[i]);
      const double share =
          whole > 0 ? gone / whole : static_cast<double>(i - from) / static_cast<double>(to - from);
      all.push_back({scans[i].time, cairn::retract(moved, Vector<3>(share * gap))});
      if (i + 1 < to) gone += way(i);
    }
  }
  return all;
}

/// Odometry alone, from a pose on.
[[nodiscard]] inline std::vector<cairn::StampedPose2> odometry_from(
    const cairn::SE2& start, const std::vector<cairn::StampedScan>& scans) {
  std::vector<cairn::StampedPose2> all;
  all.reserve(scans.size());
  for (const cairn::StampedScan& scan : scans)
    all.push_back({scan.time, start * (scans.front().T_odom_laser.inverse() * scan.T_odom_laser)});
  return all;
}

}  // namespace grid_slam
