// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where a stereo camera stands, from landmarks it sees: robust, in pixels, with an honest covariance.
///
/// Three landmarks give a closed-form pose (alignment of triangulated with map positions, weights 1/z^4) that
/// two Gauss-Newton steps on their pixels make usable; LO-MSAC (ransac.hpp) finds the one that most matches
/// agree with, and iterated reweighting on all inliers finishes. Scores and steps use the pixel residuals
/// whitened with pixel noise and landmark covariance (stereo_residual.hpp): points at 5 m and at 50 m then
/// weigh what they are worth, which distances in space cannot express.
///
/// Covariance: inverse of the inliers' information, corrected for what the loss and the gate cost. Landmarks
/// are levers, and so is their noise: where it may be most of what J^T W J knows of a direction, as the turn
/// about a line that all landmarks are on, the cost is asked how much it rises that way, and where it hardly
/// does the pose is degenerate. Some twenty landmarks on a line may still pass by chance, one time in ten.
///
/// Cost: O(matches) for each of some 10 to 70 samples.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_match.hpp>
#include <cairn/geometry/stereo_pose_options.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

#if !CAIRN_ELSEWHERE  // else cairn::compiled holds what needs these
#include <cairn/geometry/detail/robust_pose.hpp>
#include <cairn/geometry/detail/stereo_pose_problem.hpp>
#include <cairn/geometry/ransac.hpp>
#endif

namespace cairn { inline namespace CAIRN_ABI {

enum class StereoPoseStatus {
  good,
  too_few_matches,  ///< under min_inliers matches
  no_consensus,     ///< no pose that enough matches agree with
  degenerate        ///< the inliers leave a direction of the pose undetermined
};

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(StereoPoseStatus status) noexcept {
  switch (status) {
    case StereoPoseStatus::good:
      return "good";
    case StereoPoseStatus::too_few_matches:
      return "no pose: too few matches";
    case StereoPoseStatus::no_consensus:
      return "no pose: not enough matches agree with any";
    case StereoPoseStatus::degenerate:
      return "no pose: the matches that agree leave a direction undetermined";
  }
  return "unknown status";
}

/// Result. Unless good, the pose is the prior's or the identity, and covariance and information are zero.
struct StereoPose {
  SE3 T_world_camera;                         ///< pose of the left camera in the landmarks' frame
  Matrix<6> covariance = Matrix<6>::Zero();   ///< of a right step, translation then rotation
  Matrix<6> information = Matrix<6>::Zero();  ///< its inverse
  std::vector<std::uint8_t> inliers;          ///< 1 for each match that agrees
  std::size_t inlier_count = 0;
  int iterations = 0;  ///< samples drawn
  double cost = 0;     ///< sum of min(chi^2, gate) over all matches
  StereoPoseStatus status = StereoPoseStatus::too_few_matches;
  [[nodiscard]] bool good() const noexcept { return status == StereoPoseStatus::good; }
};

/// Pose of the left camera from matches of which any part may be wrong. Throws Error, naming the match or the
/// prior, where a number is not finite or a covariance or information is none. Deterministic in its
/// arguments.
[[nodiscard]] StereoPose estimate_stereo_pose(const StereoRig& rig, std::span<const StereoMatch> matches,
                                              const StereoPoseOptions& options = {},
                                              const std::optional<PosePrior>& prior = std::nullopt);

/// The same without sampling: reweighted Gauss-Newton from a pose that is already about right, for example on
/// the earliest landmarks of a result only.
[[nodiscard]] StereoPose refine_stereo_pose(const StereoRig& rig, std::span<const StereoMatch> matches,
                                            const SE3& start, const StereoPoseOptions& options = {},
                                            const std::optional<PosePrior>& prior = std::nullopt);

#if !CAIRN_ELSEWHERE

CAIRN_INLINE StereoPose estimate_stereo_pose(const StereoRig& rig, std::span<const StereoMatch> matches,
                                             const StereoPoseOptions& options,
                                             const std::optional<PosePrior>& prior) {
  const detail::StereoPoseProblem problem(rig, matches, options, prior);
  StereoPose result;
  result.inliers.assign(matches.size(), 0);
  if (prior) result.T_world_camera = prior->T_world_camera;
  if (matches.size() < std::max(options.min_inliers, detail::StereoPoseProblem::sample_size)) return result;
  std::vector<SE3> guesses;
  if (prior) guesses = {prior->T_world_camera, problem.approach(prior->T_world_camera)};
  const auto best = ransac(problem, options.ransac, std::span<const SE3>(guesses));
  result.iterations = best.iterations;
  result.status = StereoPoseStatus::no_consensus;
  if (!best.model || !detail::enough_inliers(best.score.inliers, matches.size(), options)) return result;
  SE3 pose = *best.model;
  if (detail::settle(problem, pose, options, result)) result.T_world_camera = pose;
  return result;
}

CAIRN_INLINE StereoPose refine_stereo_pose(const StereoRig& rig, std::span<const StereoMatch> matches,
                                           const SE3& start, const StereoPoseOptions& options,
                                           const std::optional<PosePrior>& prior) {
  detail::check_start(start);
  const detail::StereoPoseProblem problem(rig, matches, options, prior);
  StereoPose result;
  result.T_world_camera = start;
  result.inliers.assign(matches.size(), 0);
  if (matches.size() < options.min_inliers) return result;
  SE3 pose = problem.approach(start);
  if (problem.refine(pose) && detail::settle(problem, pose, options, result)) result.T_world_camera = pose;
  return result;
}

#endif

}}  // namespace cairn::CAIRN_ABI
