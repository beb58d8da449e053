// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The relations metric of laser SLAM: how well a path keeps the relative poses that people found by hand.
///
/// A relation says where the robot was at one time, seen from where it was at another. The error of a path is
/// the mean, over all relations, of the length and of the absolute angle of (relation^-1 * the path's own);
/// it needs no common frame and punishes a bent map once, not at every pose after the bend. (R. Kuemmerle,
/// B. Steder, C. Dornhege et al., "On measuring the accuracy of SLAM algorithms", Autonomous Robots 27, 2009,
/// eq. 4 with trans and rot apart.)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Pose at the second time in the frame of the first.
struct PoseRelation {
  double first_time = 0;   ///< [s]
  double second_time = 0;  ///< [s]
  SE2 T_first_second;
};

/// A planar pose and when it was.
struct StampedPose2 {
  double time = 0;  ///< [s]
  SE2 pose;
};

/// Reads a relations file: lines "t1 t2 x y z roll pitch yaw". Throws Error naming the line; also where there
/// is none.
[[nodiscard]] inline std::vector<PoseRelation> read_relations(const std::filesystem::path& path) {
  TextLines lines(path, "a file of relations");
  std::vector<PoseRelation> relations;
  while (lines.next()) {
    double n[8];
    if (lines.numbers(' ', n, 8) != 8) lines.fail("8 columns: t1 t2 x y z roll pitch yaw");
    relations.push_back({n[0], n[1], SE2(n[2], n[3], n[7])});
  }
  if (relations.empty()) raise(path.string() + ": expected relations, found none");
  return relations;
}

/// Errors of a path over the relations whose two times it has.
struct RelationError {
  std::size_t count = 0;    ///< relations measured
  std::size_t missing = 0;  ///< relations with a time at which the path has no pose
  double mean = 0;          ///< of the lengths [m]
  double deviation = 0;     ///< [m]
  double largest = 0;       ///< [m]
  double mean_angle = 0;    ///< of the absolute angles [rad]
  double angle_deviation = 0;
  std::vector<double> lengths;  ///< of each relation measured, in their order
};

namespace detail {

/// Mean and standard deviation.
inline void mean_and_deviation(std::span<const double> values, double& mean, double& deviation) {
  const auto n = static_cast<double>(values.size());
  mean = deviation = 0;
  for (const double v : values) mean += v / n;
  for (const double v : values) deviation += (v - mean) * (v - mean) / n;
  deviation = std::sqrt(deviation);
}

/// The path's poses in the order of time; of several with the same time the first of the path stands, and
/// those whose time is no number nowhere.
class PosesByTime {
public:
  PosesByTime(std::span<const StampedPose2> path, double tolerance) : tolerance_(tolerance) {
    std::vector<std::pair<double, std::size_t>> order;
    order.reserve(path.size());
    for (std::size_t i = 0; i < path.size(); ++i)
      if (!std::isnan(path[i].time)) order.emplace_back(path[i].time, i);
    std::ranges::sort(order);
    poses_.reserve(order.size());
    for (const auto& [time, i] : order) poses_.push_back(path[i]);
  }

  /// The pose nearest in time within the tolerance, or null.
  [[nodiscard]] const SE2* find(double time) const {
    auto it = std::ranges::lower_bound(poses_, time - tolerance_, {}, &StampedPose2::time);
    const StampedPose2* best = nullptr;
    for (; it != poses_.end() && it->time <= time + tolerance_; ++it)
      if (best == nullptr || std::abs(it->time - time) < std::abs(best->time - time)) best = &*it;
    return best == nullptr ? nullptr : &best->pose;
  }

private:
  std::vector<StampedPose2> poses_;
  double tolerance_;
};

}  // namespace detail

/// The error of a path, whose times need not rise. A relation finds its poses by time within `tolerance` [s],
/// half of the last digit that the files print. Throws Error naming a relation that is not finite, or whose
/// poses are not.
[[nodiscard]] inline RelationError relation_error(std::span<const StampedPose2> path,
                                                  std::span<const PoseRelation> relations,
                                                  double tolerance = 5e-6) {
  const detail::PosesByTime poses(path, tolerance);
  RelationError error;
  std::vector<double> angles;
  for (const PoseRelation& relation : relations) {
    const SE2* first = poses.find(relation.first_time);
    const SE2* second = poses.find(relation.second_time);
    if (first == nullptr || second == nullptr) {
      ++error.missing;
      continue;
    }
    const SE2 off = relation.T_first_second.inverse() * (first->inverse() * *second);
    error.lengths.push_back(off.translation().norm());
    angles.push_back(std::abs(off.angle()));
    if (!std::isfinite(error.lengths.back()) || !std::isfinite(angles.back()))
      raise("relation_error: expected finite poses, relation " +
            std::to_string(&relation - relations.data()) + " or those at its times have others");
  }
  error.count = error.lengths.size();
  if (error.count == 0) return error;
  detail::mean_and_deviation(error.lengths, error.mean, error.deviation);
  detail::mean_and_deviation(angles, error.mean_angle, error.angle_deviation);
  error.largest = *std::ranges::max_element(error.lengths);
  return error;
}

}}  // namespace cairn::CAIRN_ABI
