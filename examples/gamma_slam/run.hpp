// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Gamma-SLAM over one drive, and visual odometry alone beside it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/vision/image.hpp>

#include "drive.hpp"
#include "elevation_map.hpp"

namespace gamma_slam {

enum class Cells { heights, variance };  ///< HeightCell, VarianceCell

struct RunOptions {
  Cells cells = Cells::heights;
  std::size_t particles = 100;
  std::uint64_t seed = 1;
  unsigned threads = 1;
  ElevationOptions map{};
  /// What odometry's own covariance does not hold: errors that all matches of a look have in common.
  double per_metre = 0.005;    ///< [m] to either side
  double turn_sigma = 0.0013;  ///< [rad] a step
  /// Poses that a particle draws where odometry says little of the turn; 1 elsewhere.
  std::size_t draws = 8;
  double wide_turn = 0.003;  ///< [rad] from which on that is so
  double resample_below = 0.5;
};

/// Expected sigma of the heights as a picture: white unknown, light smooth, dark rough.
struct SigmaImage {
  cairn::Image image;
  double left = 0, top = 0;  ///< of the upper left pixel's corner [m]
  double pixel = 0;          ///< side [m]
};

/// How the claimed spread of cells compares with the terrain's.
struct Coverage {
  std::size_t cells = 0;    ///< with at least 10 heights' worth of belief beyond the prior's
  std::size_t covered = 0;  ///< whose 90 % interval of sigma holds the true one
  double log_ratio = 0;     ///< mean of log(expected / true)

  [[nodiscard]] double share() const noexcept {
    return cells > 0 ? static_cast<double>(covered) / static_cast<double>(cells) : 0;
  }
};

struct Results {
  RunOptions options;
  std::size_t scans = 0, resampled = 0;
  std::vector<double> time, effective_size;
  std::vector<cairn::SE2> truth, odometry, path;  ///< one pose a scan; path is the best particle's
  std::vector<std::vector<cairn::SE2>> paths;     ///< of all particles, equal ones once
  /// Mean of the newest poses as drawn, seen from the start, and how far it may be off: what lines that died
  /// out knew of the way, and, where ground is met again, how well the newest scan fits what was seen first.
  cairn::Gaussian<cairn::SE2> newest;
  std::string drive;  ///< its name
  SigmaImage odometry_map, filter_map;
  std::optional<SigmaImage> true_map;  ///< where the terrain is known
  std::optional<Coverage> coverage;
  std::optional<std::string> ended_early;
  double seconds = 0;

  /// Mean distance from the truth [m].
  [[nodiscard]] double odometry_error() const { return mean_error(odometry); }
  [[nodiscard]] double filter_error() const { return mean_error(path); }
  /// How far from the truth the last pose is [m].
  [[nodiscard]] double odometry_end_error() const { return end_error(odometry); }
  [[nodiscard]] double filter_end_error() const { return end_error(path); }
  [[nodiscard]] double end_error(const std::vector<cairn::SE2>& poses) const;
  [[nodiscard]] double mean_error(const std::vector<cairn::SE2>& poses) const;
};

/// `on_scan` is called after every scan; what it returns, if anything, ends the run and says why. Throws
/// cairn::Error on options out of range.
[[nodiscard]] Results run(const Drive& drive, const RunOptions& options,
                          const std::function<std::optional<std::string>()>& on_scan = {});

}  // namespace gamma_slam
