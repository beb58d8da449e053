// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The key figures of a run: how well it tracked, how far it was from the truth, and, apart from them because
/// they differ from run to run, how long each stage took.
///
/// Two views of the same error stand side by side. Absolute error (ATE) and relative error (RPE) are what the
/// literature compares: ATE after the rigid fit of all positions, RPE between successive frames. Everything
/// named "max", "end" and "revisit" is what a user sees who starts at a known place: estimate and truth share
/// the first pose and nothing is fitted afterwards.
#pragma once

#include <array>
#include <cstddef>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <cairn/eval/association.hpp>

#include "run_record.hpp"

namespace stereo_slam {

inline constexpr double degrees = 180.0 / std::numbers::pi;  ///< in a radian

/// Middle and 95th percentile of a stage's time over the frames [ms].
struct StageTime {
  double median = 0;
  double p95 = 0;
};

/// Distance from the truth of one frame: what the summary takes the largest of and the report plots.
struct FrameError {
  double position = 0;  ///< [m]
  double heading = 0;  ///< angle of the whole rotation error [rad]: never less than that of the heading alone
};

/// The frame at the same true place as an earlier one where the relative estimate differs most.
struct RevisitError {
  double position = 0;    ///< [m]
  double heading = 0;     ///< [rad]
  std::size_t pairs = 0;  ///< that were compared
};

struct RevisitOptions {
  std::size_t frames_apart = 20;         ///< a return is later by more than so many frames
  double distance = 0.05;                ///< the same place: true positions within [m]
  double angle = std::numbers::pi / 90;  ///< and true attitudes within [rad], two degrees
};

/// Does the system know how wrong it is? NEES e^T P^-1 e of the pose, 6 where its covariance is right.
struct PoseConsistency {
  double nees_mean = 0;
  double nees_above_999 = 0;  ///< share of frames above the 0.999 quantile, 22.5: 0.001 where it is right
  std::size_t frames = 0;     ///< that were tracked, have a truth and are not the gauge
};

/// Errors against the truth; only where frames have it.
struct TruthErrors {
  std::size_t frames = 0;                           ///< that have a truth
  double ate_rmse = 0;                              ///< [m], positions, after the alignment named next
  std::string ate_alignment;                        ///< "rigid", or "first pose" where all positions are one
  std::optional<double> rpe_translation;            ///< RMSE between successive frames [m]
  std::optional<double> rpe_rotation;               ///< [rad]
  std::optional<double> kitti_translation_percent;  ///< nothing when the path is under 100 m
  double end = 0;                                   ///< distance at the last frame with a truth [m]
  FrameError largest;                               ///< largest of each over all frames
  std::optional<RevisitError> revisit;              ///< nothing when no place is visited twice
  std::optional<PoseConsistency> consistency;       ///< nothing where no frame claims a covariance
};

/// What meeting a place again was worth.
struct LoopEffect {
  std::size_t frame = 0;  ///< as the data set numbers it
  std::size_t landmarks = 0;
  int away = 0;                             ///< steps
  FrameError correction;                    ///< how far the landmarks that came back moved the pose
  std::optional<FrameError> before, after;  ///< distance from the truth, without and with them
};

/// How far the path is from the truth, as it was estimated while driving and as the map has it at the end:
/// RMSE of positions, the first poses coinciding [m].
struct PathError {
  double while_driving = 0;
  double at_the_end = 0;
};

/// What the time a frame may take made the run do without.
struct BudgetEffect {
  double milliseconds = 0;                            ///< of work a frame
  std::size_t frames = 0;                             ///< of the run
  std::size_t frames_over = 0;                        ///< that took longer all the same
  std::size_t frames_shed = 0;                        ///< that left something out
  std::array<std::size_t, shed_names.size()> shed{};  ///< frames that left it out, by kind
  int fewest_points = 0;                              ///< that were looked for in an image
};

struct Summary {
  std::size_t frames = 0;
  std::size_t frames_tracked = 0;
  std::size_t frames_lost = 0;
  std::size_t frames_carried = 0;   ///< of these, those whose pose the motion says
  std::size_t frames_bridged = 0;   ///< of these, those between frames that say it
  std::size_t relocalisations = 0;  ///< how often it found itself in the map again
  double points_left = 0;           ///< median over frames, as the next three
  double stereo_matches = 0;
  double map_matches = 0;
  double inliers = 0;
  std::size_t landmarks = 0;
  std::size_t keyframes = 0;  ///< in the map at the end
  std::size_t loops_closed = 0;
  std::vector<LoopEffect> loops;
  std::optional<PathError> path_error;
  std::optional<BudgetEffect> budget;  ///< nothing where there was none
  double path = 0;  ///< [m], of the truth where every frame has one, otherwise of the estimate
  std::optional<TruthErrors> errors;
};

struct Timing {
  double seconds = 0;
  double hz = 0;  ///< frames per second of the whole run, loading included
  std::array<StageTime, stage_names.size()> stages{};
};

/// The frames that have a truth, in order.
[[nodiscard]] std::vector<cairn::PosePair> truth_pairs(const RunRecord& run);

/// What each loop closure was worth; those of which the pose without it is not known are left out.
[[nodiscard]] std::vector<LoopEffect> loop_effects(const RunRecord& run);

/// Nothing without truth, or without a corrected path.
[[nodiscard]] std::optional<PathError> path_error(const RunRecord& run);

/// Distance of an estimated pose from the true one.
[[nodiscard]] FrameError frame_error(const cairn::SE3& estimate, const cairn::SE3& truth);

/// NEES of a frame's pose; nothing without a truth, where it was lost, or where its covariance is none or
/// that of the gauge (a variance below 2e-12 m^2 or rad^2, KeyframeMapOptions::first_sigma being 1e-6).
[[nodiscard]] std::optional<double> pose_nees(const FrameRecord& frame);

/// For every pose the nearest earlier one at the same true place, compared by
/// E = (P_i^-1 P_j)^-1 (Q_i^-1 Q_j), P estimate, Q truth; nothing when there is none. O(n^2), 0.1 s for 4000.
[[nodiscard]] std::optional<RevisitError> revisit_error(const std::vector<cairn::PosePair>& pairs,
                                                        const RevisitOptions& options = {});

/// The key figures of a run with at least one frame. Throws cairn::Error without frames.
[[nodiscard]] Summary summarise(const RunRecord& run);

/// The same as a sentence.
[[nodiscard]] std::string budget_text(const BudgetEffect& effect);

/// The times of a run with at least one frame. Throws cairn::Error without frames.
[[nodiscard]] Timing timing(const RunRecord& run);

/// summary.json of a run: SI units as the keys say, null where nothing is known. Has no times and no number
/// of threads: a run with the same options on the same data gives the same bytes, unless it has a budget of
/// time.
[[nodiscard]] std::string summary_json(const RunRecord& run, const Summary& summary);

/// timing.json of a run: everything that is another the next time.
[[nodiscard]] std::string timing_json(const RunRecord& run);

}  // namespace stereo_slam
