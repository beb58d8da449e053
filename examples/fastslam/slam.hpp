// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// One run over one log, and everything that is to be said of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/eval/relations.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se2.hpp>

#include "landmark_log.hpp"

namespace fastslam {

enum class ProposalKind {
  motion,    ///< FastSLAM 1.0
  landmarks  ///< FastSLAM 2.0
};

/// One setting serves all logs.
struct SlamOptions {
  std::size_t particles = 20;
  std::uint64_t seed = 1;
  unsigned threads = 1;
  ProposalKind proposal = ProposalKind::landmarks;
  double resample_below = 0.5;
  /// With FastSLAM 2.0: all paths are drawn again from the distribution that the filter is of, and without
  /// names with the names that some of the particles have. Where the particles' effective ancestors of the
  /// last time are fewer than this share of the particles, but not before an eighth of the frames until then
  /// have passed, so that a log costs O(its length) times its logarithm, nor, without names, a hundred; and
  /// at the log's end. 0: never, which is FastSLAM as published.
  double redraw_below = 0.5;
  /// All landmarks are kept. One that is not seen though it is in view, as a code on the far side of its
  /// post, would be taken away and be another when it is seen again: nothing then ties the two visits
  /// together. And names are judged along paths that differ from the one they were found on, where others
  /// would be gone.
  cairn::LandmarkOptions landmarks{
      .pick = cairn::Pick::drawn, .gate = 0.999, .remove_below = -std::numeric_limits<double>::infinity()};
};

struct StepRecord {
  double time = 0;
  double effective_size = 0;
  bool resampled = false;
  std::optional<double>
      redrawn{};  ///< effective number of the paths that were drawn again here, if they were
  std::size_t sightings = 0, landmarks = 0;  ///< of the frame; of the first particle
  cairn::Gaussian<cairn::SE2> pose{};        ///< with redrawing also of the ancestors that were lost since
  std::optional<double> nees{};  ///< of the pose, where the truth is known: of a start that is exact
};

/// A landmark of the best particle.
struct FoundLandmark {
  std::uint32_t number = 0;
  cairn::Gaussian<cairn::Vector<2>> belief{};
  std::uint32_t sightings = 0;
  double log_odds = 0;
};

/// What there was to see at a moment.
struct Snapshot {
  double time = 0;
  std::vector<std::vector<cairn::Vector<2>>>
      paths{};                             ///< of a few distinct particles, thinned; the best first
  std::vector<FoundLandmark> landmarks{};  ///< of the best
};

struct Results {
  std::string name{};
  std::uint64_t seed = 0;
  std::size_t particles = 0;
  unsigned threads = 1;
  ProposalKind proposal = ProposalKind::landmarks;
  bool identities_known = true;
  std::vector<std::string> notes{};
  std::vector<StepRecord> steps{};
  std::vector<cairn::StampedPose2> odometry{}, best{}, mean{},
      truth{};  ///< at frames and between, times of the log
  std::vector<FoundLandmark> landmarks{};
  std::vector<cairn::Vector<2>> true_landmarks{};  ///< all
  /// Fixes moved rigidly onto the mean path, whose jumps pull at nothing; and how far from the path they are.
  std::vector<cairn::Vector<2>> gps{};
  std::optional<double> gps_median{};  ///< [m]
  std::vector<Snapshot> snapshots{};
  std::size_t node_copies = 0;  ///< of the best particle's map; with several threads not always the same
  /// Root mean square after the rigid motion that fits the path best to the truth [m]; of the landmarks, by
  /// identity where it is known, else to the nearest true one, after the motion that fits them best.
  std::optional<double> path_error{}, odometry_error{}, landmark_error{};
  /// That motion of the landmarks. It is not the path's: that is the mean of all particles, the map one's.
  std::optional<cairn::SE2> T_truth_landmarks{};
  std::optional<double> median_nees{};  ///< of the steps: 2.4 where the covariance is right
  std::optional<std::string> ended_early{};
  double seconds = 0, cpu_seconds = 0;
};

/// Called after every frame; what it returns, if anything, ends the run and says why.
using OnFrame = std::function<std::optional<std::string>()>;

/// Maps the log. Throws cairn::Error where the log cannot be mapped.
[[nodiscard]] Results run(const LandmarkLog& log, const SlamOptions& options, const OnFrame& on_frame = {});

class Mapper;
/// The same with what a mapper has left of its log. It can then go on with a longer one, as though that had
/// been its log from the first.
[[nodiscard]] Results run(Mapper& mapper, const OnFrame& on_frame = {});

/// A pose for every frame and between them: along odometry, what that is short of the next frame's spread
/// over the way. `poses` are of the first frames of the log.
[[nodiscard]] std::vector<cairn::StampedPose2> filled(const LandmarkLog& log,
                                                      const std::vector<cairn::SE2>& poses);

}  // namespace fastslam
