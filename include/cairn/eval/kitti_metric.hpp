// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The drift of an odometry as the KITTI benchmark measures it: no alignment, segments of 100 to 800 m.
///
/// From every tenth frame i and for every length L, the segment ends at the first frame j whose distance
/// along the true path exceeds that of i by more than L. Its error is
///   E = (P_i^-1 P_j)^-1 (Q_i^-1 Q_j)        P estimate, Q truth                                  (1)
/// and counts |t(E)| / L and angle(E) / L; the result is the mean over all segments (A. Geiger, P. Lenz,
/// R. Urtasun, "Are we ready for autonomous driving? The KITTI vision benchmark suite", CVPR 2012, and the
/// benchmark's description of its odometry measure).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/eval/association.hpp>
#include <cairn/io/trajectory.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

struct KittiOptions {
  std::vector<double> lengths{100, 200, 300, 400, 500, 600, 700, 800};  ///< [m]
  std::size_t step = 10;                                                ///< frames between segment starts
};

/// Mean errors over segments.
struct SegmentError {
  double length = 0;       ///< of the segments [m]; 0 for the mean over all lengths
  double translation = 0;  ///< per metre travelled [1]
  double rotation = 0;     ///< per metre travelled [rad/m]
  std::size_t segments = 0;

  [[nodiscard]] double translation_percent() const noexcept { return 100.0 * translation; }
  [[nodiscard]] double rotation_degrees_per_100m() const noexcept {
    return 100.0 * rotation * 180.0 / std::numbers::pi;
  }
};

struct KittiError {
  SegmentError overall;
  std::vector<SegmentError> by_length;  ///< lengths that no segment has are left out
};

namespace detail {

/// The measure over segments of a path with these distances; segment(i, j) gives |t(E)| [m] and angle(E)
/// [rad].
template <class Segment>
std::optional<KittiError> kitti_error_over(const std::vector<double>& distances, const KittiOptions& options,
                                           Segment&& segment) {
  CAIRN_EXPECTS(options.step > 0, "kitti_error needs a step of at least one frame");
  KittiError result;
  for (const double length : options.lengths) {
    CAIRN_EXPECTS(length > 0.0, "kitti_error needs positive lengths");
    SegmentError error{length};
    for (std::size_t i = 0; i < distances.size(); i += options.step) {
      const auto end = std::upper_bound(distances.begin(), distances.end(), distances[i] + length);
      if (end == distances.end()) break;
      const std::pair<double, double> e = segment(i, static_cast<std::size_t>(end - distances.begin()));
      error.translation += e.first / length;
      error.rotation += e.second / length;
      ++error.segments;
    }
    if (error.segments == 0) continue;
    result.overall.translation += error.translation;
    result.overall.rotation += error.rotation;
    result.overall.segments += error.segments;
    error.translation /= static_cast<double>(error.segments);
    error.rotation /= static_cast<double>(error.segments);
    result.by_length.push_back(error);
  }
  if (result.overall.segments == 0) return std::nullopt;
  result.overall.translation /= static_cast<double>(result.overall.segments);
  result.overall.rotation /= static_cast<double>(result.overall.segments);
  return result;
}

[[nodiscard]] inline Vector<3> position(const KittiRow& row) {
  return part_of<3, 1>(row, 0, 3);
}

/// A^-1 B of two printed poses, the inverse by transposing.
inline KittiRow relative(const KittiRow& a, const KittiRow& b) {
  KittiRow moved = b;
  put(moved, 0, 3, Vector<3>(position(b) - position(a)));
  return transposed_product(part_of<3, 3>(a, 0, 0), moved);
}

}  // namespace detail

/// Distance along the true path at each pair [m]: 0 first, never falling.
[[nodiscard]] inline std::vector<double> path_distances(std::span<const PosePair> pairs) {
  std::vector<double> distances(pairs.size(), 0.0);
  for (std::size_t i = 1; i < pairs.size(); ++i)
    distances[i] =
        distances[i - 1] + (pairs[i].truth.translation() - pairs[i - 1].truth.translation()).norm();
  return distances;
}

/// The KITTI measure of pairs in the order of time, or nothing when the path is shorter than every length.
/// Frames that were not tracked must stand in the pairs with their last pose, as the benchmark demands.
/// Throws Error naming a pair with a pose that is not finite. O(n log n).
[[nodiscard]] inline std::optional<KittiError> kitti_error(std::span<const PosePair> pairs,
                                                           const KittiOptions& options = {}) {
  detail::expect_finite(pairs, "kitti_error");
  return detail::kitti_error_over(path_distances(pairs), options, [&](std::size_t i, std::size_t j) {
    const SE3 E = (pairs[i].estimate.inverse() * pairs[j].estimate).inverse() *
                  (pairs[i].truth.inverse() * pairs[j].truth);  // (1)
    return std::pair(E.translation().norm(), E.rotation().angle());
  });
}

/// The same computed from the printed matrices as they stand, inverses by transposing and angles by trace, as
/// published figures are: rows printed with seven digits are no rotations, and the trace sees that. On KITTI
/// 00 ORB-SLAM2 has 0.2536 deg per 100 m this way and 0.2533 by the other function. Needs as many true rows
/// as estimated ones. Throws Error naming a row with a number that is not finite.
[[nodiscard]] inline std::optional<KittiError> kitti_error(std::span<const KittiRow> truth,
                                                           std::span<const KittiRow> estimate,
                                                           const KittiOptions& options = {}) {
  CAIRN_EXPECTS(truth.size() == estimate.size(), "kitti_error needs one estimate for each true pose");
  for (std::size_t i = 0; i < truth.size(); ++i)
    if (!all_finite(truth[i]) || !all_finite(estimate[i]))
      raise("kitti_error: expected finite numbers, row " + std::to_string(i) + " has others");
  std::vector<double> distances(truth.size(), 0.0);
  for (std::size_t i = 1; i < truth.size(); ++i)
    distances[i] = distances[i - 1] + (detail::position(truth[i]) - detail::position(truth[i - 1])).norm();
  return detail::kitti_error_over(distances, options, [&](std::size_t i, std::size_t j) {
    const KittiRow E =
        detail::relative(detail::relative(estimate[i], estimate[j]), detail::relative(truth[i], truth[j]));
    const double cosine = 0.5 * (E(0, 0) + E(1, 1) + E(2, 2) - 1.0);
    return std::pair(detail::position(E).norm(), std::acos(std::clamp(cosine, -1.0, 1.0)));
  });
}

}}  // namespace cairn::CAIRN_ABI
