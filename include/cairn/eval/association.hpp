// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Which pose of an estimate belongs to which pose of the truth: the nearest in time, one to one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/trajectory.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The same moment twice: as it was and as it was estimated. The two world frames may differ.
struct PosePair {
  double time = 0;  ///< of the estimate [s]
  SE3 truth;        ///< T_world_body
  SE3 estimate;     ///< T_world'_body
};

struct AssociationOptions {
  double largest_difference = 0.01;  ///< [s]; pairs farther apart are left out
  double offset = 0;                 ///< [s]; added to the times of the estimate first
};

/// Pairs every estimated pose with the pose of the truth that is nearest in time (the earlier of two equally
/// near); where two estimates want the same one, the nearer has it (the first of two equally near) and the
/// other is left out. Both trajectories are in the order of time. Poses without a time (NaN) are of no pair.
/// O((n + m) log m).
[[nodiscard]] inline std::vector<PosePair> associate(const Trajectory& truth, const Trajectory& estimate,
                                                     const AssociationOptions& options = {}) {
  const auto before = [](const StampedPose& a, const StampedPose& b) { return a.time < b.time; };
  CAIRN_EXPECTS(std::is_sorted(truth.begin(), truth.end(), before) &&
                    std::is_sorted(estimate.begin(), estimate.end(), before),
                "associate needs trajectories in the order of time");
  std::vector<PosePair> pairs;
  if (truth.empty()) return pairs;
  std::size_t taken = truth.size();  // the truth index of the last pair
  double taken_difference = 0;
  for (const StampedPose& pose : estimate) {
    const double time = pose.time + options.offset;
    auto nearest = std::lower_bound(truth.begin(), truth.end(), time,
                                    [](const StampedPose& a, double t) { return a.time < t; });
    if (nearest == truth.end() ||
        (nearest != truth.begin() && time - (nearest - 1)->time <= nearest->time - time))
      --nearest;
    const double difference = std::abs(nearest->time - time);
    if (!(difference <= options.largest_difference)) continue;  // also where a time is none
    const auto index = static_cast<std::size_t>(nearest - truth.begin());
    const PosePair pair{pose.time, nearest->T_world_body, pose.T_world_body};
    if (index != taken)
      pairs.push_back(pair);
    else if (difference < taken_difference)
      pairs.back() = pair;
    else
      continue;
    taken = index;
    taken_difference = difference;
  }
  return pairs;
}

/// Pairs pose i with pose i: for KITTI files, which have no times. The counts must agree.
[[nodiscard]] inline std::vector<PosePair> associate_by_index(const Trajectory& truth,
                                                              const Trajectory& estimate) {
  if (truth.size() != estimate.size())
    raise("associate_by_index: expected as many estimated poses as true ones, found " +
          std::to_string(estimate.size()) + " and " + std::to_string(truth.size()));
  std::vector<PosePair> pairs;
  pairs.reserve(truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i)
    pairs.push_back({estimate[i].time, truth[i].T_world_body, estimate[i].T_world_body});
  return pairs;
}

}}  // namespace cairn::CAIRN_ABI
