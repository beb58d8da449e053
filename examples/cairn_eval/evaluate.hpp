// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Trajectory files, and how good one is: everything of cairn/eval for one estimate against one truth.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/eval/association.hpp>
#include <cairn/eval/kitti_metric.hpp>
#include <cairn/eval/trajectory_error.hpp>
#include <cairn/io/trajectory.hpp>

namespace cairn_eval {

enum class Format { automatic, tum, kitti, euroc };

/// A trajectory as it was read. KITTI files have no times, but rows as printed.
struct TrajectoryFile {
  std::filesystem::path path;
  Format format = Format::automatic;  ///< as found
  bool has_times = true;
  cairn::Trajectory poses;
  std::vector<cairn::KittiRow> rows;  ///< of a KITTI file
};

/// Reads a trajectory; `automatic` goes by the first line that is no comment. `times` is a KITTI times.txt,
/// or empty. Throws cairn::Error naming file, line and what was expected.
[[nodiscard]] TrajectoryFile read_trajectory(const std::filesystem::path& path, Format format,
                                             const std::filesystem::path& times = {});

/// The covariance of the step T_world_body exp(d) from a pose to the truth.
struct StampedCovariance {
  double time = 0;              ///< [s]
  cairn::Matrix<6> covariance;  ///< translation [m], then rotation [rad]
};

/// Covariances as they were read.
struct CovarianceFile {
  std::filesystem::path path;
  std::vector<StampedCovariance> rows;
};

/// Reads trajectory_covariance.csv of the example programs: a line of names, then time and the upper triangle
/// (x_x, x_y, ... rz_rz) of each pose. Throws cairn::Error.
[[nodiscard]] CovarianceFile read_covariances(const std::filesystem::path& path);

struct EvaluationOptions {
  cairn::AlignBy align = cairn::AlignBy::rigid;
  cairn::AssociationOptions association = {};
  cairn::RelativeOptions relative = {};
  cairn::KittiOptions kitti = {};
};

/// NEES of the poses that have a covariance with an inverse.
struct NeesFigures {
  std::vector<double> times;   ///< of the pairs [s]
  std::vector<double> values;  ///< 6 on the average where the covariance is true
  std::size_t missing = 0;     ///< pairs without a covariance of their time
  std::size_t no_inverse = 0;  ///< pairs whose covariance has no inverse
  double mean = 0;
  cairn::ConsistencyBand band;  ///< of the mean, 95 %, as if all poses were independent, which they are not
};

struct Evaluation {
  std::vector<cairn::PosePair> pairs;
  std::size_t poses = 0;          ///< of the estimate, with or without a partner
  double length = 0;              ///< of the true path over the pairs [m]
  cairn::AbsoluteError absolute;  ///< after the alignment
  std::optional<cairn::RelativeError> relative;
  std::optional<cairn::KittiError> kitti;  ///< nothing where the path is shorter than every length
  bool has_covariances = false;
  std::optional<NeesFigures> nees;  ///< of the covariances, where the alignment determines attitudes
};

/// Throws cairn::Error in words where the files do not belong together: nothing in common in time, another
/// number of poses or covariances, nothing to align by. Covariances go with the poses of their times; where
/// trajectories have none, row by row.
[[nodiscard]] Evaluation evaluate(const TrajectoryFile& truth, const TrajectoryFile& estimate,
                                  const std::optional<CovarianceFile>& covariances,
                                  const EvaluationOptions& options);

}  // namespace cairn_eval
