// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a map is asked with, and what it answers: sightings of landmarks, and where a frame was taken.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A landmark as both cameras of the rig see it.
struct StereoSighting {
  std::uint32_t landmark = 0;                                     ///< a number of the caller's choosing
  Vector<2> left = Vector<2>::Zero(), right = Vector<2>::Zero();  ///< [pixels]
  double sigma = 0.5;                                             ///< of each coordinate [pixels]
};

enum class MapLocationStatus {
  good,
  too_few_matches,  ///< under min_matches that agree
  degenerate        ///< what agrees leaves a direction undetermined
};

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(MapLocationStatus status) noexcept {
  switch (status) {
    case MapLocationStatus::good:
      return "good";
    case MapLocationStatus::too_few_matches:
      return "no pose: too few matches agree";
    case MapLocationStatus::degenerate:
      return "no pose: the matches that agree leave a direction undetermined";
  }
  return "unknown status";
}

/// Where a frame was taken.
struct MapLocation {
  SE3 T_world_camera;
  Matrix<6> covariance = Matrix<6>::Zero();  ///< of a right step, translation then rotation
  std::vector<std::uint8_t> inliers;         ///< 1 for each match that agrees
  std::size_t inlier_count = 0;
  /// How much larger the variance of the pose is than the pixels' sigmas say, by how the matches of a part of
  /// the image err together: 1 where each errs alone and by its sigma. Errors that are common to the whole
  /// image do not show.
  double score_variance = 1;
  /// Median of how far the camera is from where a match was last recorded, over the landmark's distance: 0 on
  /// the spot.
  double viewpoint_change = 0;
  double median_chi_squared = 0;  ///< of those, 4 degrees of freedom each: 3.36 where sigmas are right
  std::vector<double>
      chi_squared;  ///< of each match by all that is uncertain; infinite where it is out of view
  MapLocationStatus status = MapLocationStatus::too_few_matches;
  [[nodiscard]] bool good() const noexcept { return status == MapLocationStatus::good; }
};

}}  // namespace cairn::CAIRN_ABI
