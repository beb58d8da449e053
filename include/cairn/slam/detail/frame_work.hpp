// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A frame that a map works on: its matches and the keyframes they rest on.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/joint_gaussian.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/manifold/so3.hpp>
#include <cairn/slam/detail/keyframe_equations.hpp>
#include <cairn/slam/detail/keyframe_landmark.hpp>
#include <cairn/slam/detail/whitened_sighting.hpp>
#include <cairn/slam/map_location.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// A match in play.
struct FrameEntry {
  std::size_t match = 0;
  std::size_t landmark = 0;                           ///< place among the map's
  std::array<std::uint32_t, most_sightings> place{};  ///< of its keyframes among those in play
  WhitenedSighting seen;
  LandmarkGeometry geometry;                ///< about where this sighting and the list put the landmark
  Vector<3> from_list = Vector<3>::Zero();  ///< from there to where the list alone puts it
  PointStatistics statistics, at_solution;
  RigStatistics rig;
  double chi_squared = 0, weight = 0;  ///< in units of the pixels' factor

  /// Numbers, among the keyframes in play, of those of its landmark's sightings.
  [[nodiscard]] std::span<const std::uint32_t> places() const noexcept {
    return std::span(place).first(geometry.count);
  }
};

/// The matches of a frame, the keyframes they rest on, and what became of them.
struct FrameWork {
  std::vector<FrameEntry> entries;
  std::span<const StereoSighting> matches;
  std::vector<std::uint32_t> keyframes;  // in play
  std::vector<AnyBlockId> blocks;
  Matrix<dynamic, dynamic> prior;
  KeyframeSolution solution;
  bool has_solution = false;
};

/// Cluster-robust variance (K.-Y. Liang, S. Zeger, "Longitudinal data analysis using generalized linear
/// models", Biometrika 73, 1986) over the one that counts with independent matches: with the score s_c =
/// sum J^T W r of the matches of a cell of the image and A = sum J^T W J, the mean of s_c^T A^-1 s_c summed
/// over the cells is 6. The pose has taken its share out of the scores: 1 in as many as there are cells.
[[nodiscard]] inline double score_variance(const FrameWork& work, const Matrix<6>& camera,
                                           const PinholeCamera& left) {
  constexpr int columns = 4, rows = 3;
  std::array<Vector<6>, static_cast<std::size_t>(columns * rows)> scores;
  scores.fill(Vector<6>::Zero());
  const double width = left.width() > 0 ? left.width() : 2 * left.cx() + 1,
               height = left.height() > 0 ? left.height() : 2 * left.cy() + 1;
  for (const FrameEntry& entry : work.entries) {
    if (!(entry.weight > 0)) continue;
    const LandmarkGeometry& one = entry.geometry;
    const Vector<3> g = entry.weight * WeighedSighting(entry.at_solution, one.S).g;
    const Vector<2>& pixel = work.matches[entry.match].left;
    const double u = pixel(0) / width, v = pixel(1) / height;
    const int column = std::clamp(static_cast<int>(u * columns), 0, columns - 1),
              row = std::clamp(static_cast<int>(v * rows), 0, rows - 1);
    Vector<6>& cell = scores[static_cast<std::size_t>(row * columns + column)];
    put(cell, 0, 0, Vector<3>(part_of<3, 1>(cell, 0, 0) + g));
    put(cell, 3, 0, Vector<3>(part_of<3, 1>(cell, 3, 0) + cross<double>(one.x, g)));
  }
  const Cholesky<6> factor(camera);
  double sum = 0;
  for (const Vector<6>& s : scores) sum += factor.whiten(s).squaredNorm();
  constexpr double cells = columns * rows;
  return sum / 6 * (cells / (cells - 1));
}

}}}  // namespace cairn::CAIRN_ABI::detail
