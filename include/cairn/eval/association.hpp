// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Which pose of an estimate belongs to which pose of the truth: the nearest in time, one to one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
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

namespace detail {

inline void expect_finite(std::span<const PosePair> pairs, const char* who) {
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (!all_finite(pairs[i].truth.matrix()) || !all_finite(pairs[i].estimate.matrix()))
      raise(std::string(who) + ": expected finite poses, pair " + std::to_string(i) + " has others");
}

}  // namespace detail

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
  std::vector<const StampedPose*> timed;  // of the truth
  timed.reserve(truth.size());
  for (const StampedPose& pose : truth)
    if (!std::isnan(pose.time)) timed.push_back(&pose);
  const auto rises = [last = -std::numeric_limits<double>::infinity()](const StampedPose& pose) mutable {
    if (std::isnan(pose.time)) return true;
    return pose.time >= std::exchange(last, pose.time);
  };
  CAIRN_EXPECTS(
      std::all_of(truth.begin(), truth.end(), rises) && std::all_of(estimate.begin(), estimate.end(), rises),
      "associate needs trajectories in the order of time");
  std::vector<PosePair> pairs;
  if (timed.empty()) return pairs;
  std::size_t taken = timed.size();  // the place of the last pair's truth
  double taken_difference = 0;
  for (const StampedPose& pose : estimate) {
    const double time = pose.time + options.offset;
    if (std::isnan(time)) continue;
    auto nearest = std::lower_bound(timed.begin(), timed.end(), time,
                                    [](const StampedPose* a, double t) { return a->time < t; });
    if (nearest == timed.end() ||
        (nearest != timed.begin() && time - (*(nearest - 1))->time <= (*nearest)->time - time))
      --nearest;
    const double difference = std::abs((*nearest)->time - time);
    if (!(difference <= options.largest_difference)) continue;
    const auto index = static_cast<std::size_t>(nearest - timed.begin());
    const PosePair pair{pose.time, (*nearest)->T_world_body, pose.T_world_body};
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
