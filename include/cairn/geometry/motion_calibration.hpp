// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Calibrates a stereo rig by moving it: what two stereo pairs of the same rigid scene say of the rig.
///
/// One pair's epipolar constraint hardly sees the right camera's yaw w_y, which shifts every disparity alike
/// and so scales the map: d z = z^2 w_y / b. Moving shows it. Bearings alone tell by which factor a point's
/// depth changed, and a shifted disparity tells another, the more so the nearer the point: no rigid motion
/// explains points at all depths. The estimate is least squares over everything that the eight coordinates
/// of a point in four images depend on: motion d (6), correction c (5, rig_correction.hpp), point X (3),
///   sum |W (obs - pi(X, T, c))|^2  +  (c - c0)' P0^-1 (c - c0)  ->  min                   (1)
/// by Gauss-Newton with the points eliminated (the Schur complement: D. Brown, "A solution to the general
/// problem of multiple station analytical stereotriangulation", 1958; B. Triggs et al., "Bundle adjustment: a
/// modern synthesis", 1999, section 6) and Cauchy weights.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/detail/robust_pose.hpp>
#include <cairn/geometry/rig_correction.hpp>
#include <cairn/geometry/robust_loss.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A point that both cameras saw before and after a motion.
struct MovedPair {
  Vector<2> left_before, right_before, left_after, right_after;  ///< [pixels]
  double sigma = 0.5;                                            ///< noise in each coordinate [pixels]
};

struct MotionCalibrationOptions {
  double gate_probability = 0.999;  ///< share of good points that pass the gate in the end
  double loss_scale = 3;            ///< of the Cauchy weights, in standard deviations of a point's residual
  std::size_t min_inliers = 20;     ///< fewer points inside the gate: no consensus
  double min_share = 0.5;           ///< of the points that must be inside the gate
  int max_steps = 12;
};

enum class MotionCalibrationStatus {
  good,
  too_few_points,  ///< under min_inliers can be triangulated
  no_consensus,    ///< the points do not move as one rigid scene
  degenerate       ///< the motion is undetermined
};

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(MotionCalibrationStatus status) noexcept {
  switch (status) {
    case MotionCalibrationStatus::good:
      return "good";
    case MotionCalibrationStatus::too_few_points:
      return "not calibrated: too few points can be triangulated";
    case MotionCalibrationStatus::no_consensus:
      return "not calibrated: the points do not move as one rigid scene";
    case MotionCalibrationStatus::degenerate:
      return "not calibrated: the motion is undetermined";
  }
  return "unknown status";
}

/// Result for a correction, or for one and how fast it changes (CalibrationDrift). Unless good, state and
/// covariance are those given and the motion is the guess.
template <int Numbers>
struct MotionCalibrationOf {
  Vector<Numbers> state;       ///< of the correction, see RigCorrection
  Matrix<Numbers> covariance;  ///< its posterior
  SE3 T_before_after;          ///< pose of the left camera after the motion in its frame before
  std::size_t inliers = 0;     ///< points inside the gate
  MotionCalibrationStatus status = MotionCalibrationStatus::too_few_points;
  [[nodiscard]] bool good() const noexcept { return status == MotionCalibrationStatus::good; }
};
using MotionCalibration = MotionCalibrationOf<5>;

namespace detail {

/// The least-squares problem (1) at its current estimate, of a rig that stays as it is (5 numbers) or whose
/// right camera keeps turning (8): the correction after the motion, then how fast w changes a frame, so that
/// before the motion it was w - rate * frames.
template <int Numbers>
class MotionCalibrationProblem {
public:
  static_assert(Numbers == 5 || Numbers == 8, "MotionCalibrationProblem: a correction, or one and its rate");
  static constexpr int shared = 6 + Numbers;  // motion, then correction, then rate

  MotionCalibrationProblem(const RigCorrection& rig, const Vector<Numbers>& state, const SE3& motion,
                           std::span<const MovedPair> pairs, double frames)
      : rig_(rig), state_(state), motion_(motion), frames_(frames) {
    const StereoRig start = rig.rig(correction_before());
    const Triangulator triangulate(start, {.max_gap = std::numeric_limits<double>::infinity()});
    for (const MovedPair& pair : pairs) {
      if (!(pair.sigma > 0 && std::isfinite(pair.sigma))) continue;
      const Triangulation point = triangulate(pair.left_before, pair.right_before, pair.sigma, pair.sigma);
      if (!point.good()) continue;
      Track track;
      track.point = point.point;
      const std::array pixels{pair.left_before, pair.right_before, pair.left_after, pair.right_after};
      bool usable = true;
      for (std::size_t v = 0; v < 4; ++v) {
        const PinholeCamera& camera = v % 2 == 0 ? start.left : start.right;
        const auto n = camera.normalise_with_jacobian(pixels[v]);
        usable = usable && n.has_value();
        if (n) track.views[v] = {n->normalised, n->J_pixel / pair.sigma};
      }
      if (usable) tracks_.push_back(track);
    }
  }

  [[nodiscard]] std::size_t size() const noexcept { return tracks_.size(); }
  [[nodiscard]] const Vector<Numbers>& state() const noexcept { return state_; }
  [[nodiscard]] const SE3& motion() const noexcept { return motion_; }

  /// One step on the points inside `gate` with Cauchy weights of this scale. Its squared length in standard
  /// deviations, or nothing where the equations are degenerate.
  [[nodiscard]] std::optional<double> step(const Vector<Numbers>& mean, const Matrix<Numbers>& information,
                                           double gate, double loss_scale) {
    Matrix<shared> H;
    Vector<shared> g;
    gather(mean, information, gate, loss_scale, H, g);
    const Cholesky<shared> factor(H);
    if (!factor.good()) return std::nullopt;
    const Vector<shared> d = factor.solve(g);
    if (!all_finite(d)) return std::nullopt;
    for (Track& track : tracks_)
      track.point += track.elimination.solve(Vector<3>(track.gradient - product(track.coupling, d)));
    motion_ = retract(motion_, part_of<6, 1>(d, 0, 0));
    state_ += part_of<Numbers, 1>(d, 6, 0);
    return d.dot(g);
  }

  /// Covariance of the correction by the prior and the points inside `gate`, which tell `efficiency` of what
  /// least squares would make of them; nothing where the equations are degenerate.
  [[nodiscard]] std::optional<Matrix<Numbers>> covariance(const Matrix<Numbers>& information, double gate,
                                                          double efficiency) {
    Matrix<shared> H;
    Vector<shared> g;
    gather(state_, Matrix<Numbers>::Zero(), gate, std::numeric_limits<double>::infinity(), H, g);
    H *= efficiency;
    put(H, 6, 6, Matrix<Numbers>(part_of<Numbers, Numbers>(H, 6, 6) + information));
    const Cholesky<shared> factor(H);
    if (!factor.good()) return std::nullopt;
    const Matrix<Numbers> result = part_of<Numbers, Numbers>(factor.inverse(), 6, 6);
    if (!all_finite(result)) return std::nullopt;
    return result;
  }

  [[nodiscard]] std::size_t inside(double gate) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(tracks_, [&](const Track& track) { return track.chi_squared < gate; }));
  }

private:
  struct View {
    Vector<2> observed;   // normalised
    Matrix<2> whitening;  // d pixel / d normalised over sigma
  };
  struct Track {
    std::array<View, 4> views;  // left, right before, left, right after
    Vector<3> point;            // left camera before
    Matrix<3, shared> coupling = Matrix<3, shared>::Zero();
    Vector<3> gradient = Vector<3>::Zero();
    Cholesky<3> elimination{Matrix<3>::Identity()};
    double chi_squared = std::numeric_limits<double>::infinity();
  };
  struct Linearised {
    Matrix<8, 3> J_point;
    Matrix<8, shared> J_shared;
    Vector<8> residual;
  };

  /// Of the right camera at one moment.
  struct RightPose {
    Matrix<3> R;  // to the left camera
    Vector<3> baseline;
    Matrix<3, 2> by_direction;  // d direction / d (t_y, t_z), in the right camera's axes
  };

  [[nodiscard]] Vector<5> correction_after() const { return part_of<5, 1>(state_, 0, 0); }
  [[nodiscard]] Vector<5> correction_before() const {
    Vector<5> result = correction_after();
    if constexpr (Numbers == 8)
      for (int i = 0; i < 3; ++i) result(i) -= frames_ * state_(5 + i);
    return result;
  }
  [[nodiscard]] RightPose right_pose(const Vector<5>& correction) const {
    const Matrix<3> R = rig_.rotation(correction).matrix();
    return {R, rig_.nominal().baseline() * rig_.direction(correction),
            transposed_product(R, rig_.direction_jacobian())};
  }

  /// Nothing where the point is behind a camera.
  [[nodiscard]] std::optional<Linearised> linearise(const Track& track,
                                                    const std::array<RightPose, 2>& right_poses) const {
    const Matrix<3> R_after = transposed(motion_.rotation().matrix());
    Linearised result;
    result.J_shared.setZero();
    for (const std::size_t moment : {0U, 1U}) {
      Vector<3> p = track.point;
      Matrix<3> by_point = Matrix<3>::Identity();
      if (moment == 1) {
        const Vector<3> shifted = p - motion_.translation();
        p = product(R_after, shifted);
        by_point = R_after;
      }
      const auto& [R, baseline, by_direction] = right_poses[moment];
      const Vector<3> arm = p - baseline, q = transposed_product(R, arm);
      constexpr double nearest = 1e-6;
      if (!(p(2) > nearest && q(2) > nearest)) return std::nullopt;
      const WhitenedResidual left = whitened(track.views[2 * moment], p);
      const WhitenedResidual right = whitened(track.views[2 * moment + 1], q);
      const Matrix<2, 3> right_by_p = product_transposed(right.J_point, R);
      const int row = moment == 0 ? 0 : 4;
      put(result.residual, row, 0, left.residual);
      put(result.residual, row + 2, 0, right.residual);
      put(result.J_point, row, 0, product(left.J_point, by_point));
      put(result.J_point, row + 2, 0, product(right_by_p, by_point));
      if (moment == 1) {  // d p / d motion = [-I, skew(p)]
        put(result.J_shared, row, 0, Matrix<2, 3>(-left.J_point));
        put(result.J_shared, row, 3, product(left.J_point, skew(p)));
        put(result.J_shared, row + 2, 0, Matrix<2, 3>(-right_by_p));
        put(result.J_shared, row + 2, 3, product(right_by_p, skew(p)));
      }
      const Matrix<2, 3> by_rotation = product(right.J_point, skew(q));
      put(result.J_shared, row + 2, 6, by_rotation);
      if constexpr (Numbers == 8)
        if (moment == 0) put(result.J_shared, row + 2, 11, Matrix<2, 3>(-frames_ * by_rotation));
      put(result.J_shared, row + 2, 9,
          Matrix<2>(-rig_.nominal().baseline() * product(right.J_point, by_direction)));
    }
    return result;
  }

  [[nodiscard]] static WhitenedResidual whitened(const View& view, const Vector<3>& p) {
    return whitened_residual(view.observed, view.whitening, p);
  }

  /// Normal equations of motion and correction with the points eliminated.
  void gather(const Vector<Numbers>& mean, const Matrix<Numbers>& information, double gate, double loss_scale,
              Matrix<shared>& H, Vector<shared>& g) {
    H.setZero();
    g.setZero();
    put(H, 6, 6, information);
    put(g, 6, 0, product(information, Vector<Numbers>(mean - state_)));
    const std::array right_poses{right_pose(correction_before()), right_pose(correction_after())};
    for (Track& track : tracks_) {
      track.coupling.setZero();
      track.gradient.setZero();
      track.chi_squared = std::numeric_limits<double>::infinity();
      const auto at = linearise(track, right_poses);
      if (!at) continue;
      Matrix<3> own = Matrix<3>::Zero();
      add_transposed_product(own, at->J_point, at->J_point);
      const Cholesky<3> elimination(own);
      if (!elimination.good()) continue;
      track.elimination = elimination;
      add_transposed_product(track.coupling, at->J_point, at->J_shared);
      add_transposed_product(track.gradient, at->J_point, at->residual);
      const Vector<3> eliminated = elimination.solve(track.gradient);
      track.chi_squared = at->residual.squaredNorm() - track.gradient.dot(eliminated);
      if (!(track.chi_squared < gate)) continue;
      const double weight = robust_weight(RobustLoss::cauchy, loss_scale, track.chi_squared);
      add_transposed_product(H, at->J_shared, at->J_shared, weight);
      add_transposed_product(H, track.coupling, elimination.solve(track.coupling), -weight);
      add_transposed_product(g, at->J_shared, at->residual, weight);
      add_transposed_product(g, track.coupling, eliminated, -weight);
    }
  }

  const RigCorrection& rig_;
  Vector<Numbers> state_;
  SE3 motion_;
  double frames_;  // between before and after
  std::vector<Track> tracks_;
};

/// The body of calibrate_from_motion(); `frames` from before to after, which a rate is told by.
template <int Numbers>
[[nodiscard]] MotionCalibrationOf<Numbers> calibrate_from_motion(const RigCorrection& rig,
                                                                 const Vector<Numbers>& state,
                                                                 const Matrix<Numbers>& covariance,
                                                                 std::span<const MovedPair> pairs,
                                                                 double frames, const SE3& guess,
                                                                 const MotionCalibrationOptions& options) {
  MotionCalibrationOf<Numbers> result{state, covariance, guess};
  const Cholesky<Numbers> prior(covariance);
  CAIRN_EXPECTS(all_finite(state) && all_finite(covariance) && prior.good(),
                "calibrate_from_motion: expected a finite state and a positive definite covariance");
  const Matrix<Numbers> information = prior.inverse();
  MotionCalibrationProblem<Numbers> problem(rig, state, guess, pairs, frames);
  if (problem.size() < options.min_inliers) return result;
  const double gate = chi_square_quantile(options.gate_probability, 5);
  result.status = MotionCalibrationStatus::degenerate;
  double widening = 30;  // of all sigmas: the guess may be pixels away; narrows to 1
  for (int i = 0; i < options.max_steps; ++i) {
    const auto length =
        problem.step(state, information, gate * widening * widening, options.loss_scale * widening);
    if (!length) return result;
    if (widening == 1 && *length < 1e-6) break;
    widening = std::max(1.0, widening / 4);
  }
  const double efficiency =
      robust_efficiency(RobustLoss::cauchy, options.loss_scale, options.gate_probability, gate, 5);
  const auto posterior = problem.covariance(information, gate, efficiency);
  if (!posterior || !all_finite(problem.state())) return result;
  result.inliers = problem.inside(gate);
  result.status = MotionCalibrationStatus::no_consensus;
  if (!enough_inliers(result.inliers, problem.size(), options)) return result;
  result.status = MotionCalibrationStatus::good;
  result.state = problem.state();
  result.covariance = *posterior;
  result.T_before_after = problem.motion();
  return result;
}

}  // namespace detail

/// Correction of the rig by one motion, given what is known of the correction beforehand: its mean `state`
/// and positive definite `covariance`. `guess` is about the motion (within some tens of pixels). Points that
/// cannot be triangulated or do not move with the others are left out. A motion with little parallax says
/// little, and the covariance stays near the prior's. O(points) for each step; deterministic.
[[nodiscard]] inline MotionCalibration calibrate_from_motion(const RigCorrection& rig, const Vector<5>& state,
                                                             const Matrix<5>& covariance,
                                                             std::span<const MovedPair> pairs,
                                                             const SE3& guess,
                                                             const MotionCalibrationOptions& options = {}) {
  return detail::calibrate_from_motion<5>(rig, state, covariance, pairs, 1, guess, options);
}

}}  // namespace cairn::CAIRN_ABI
