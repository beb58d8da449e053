// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The problem behind stereo_pose.hpp: poses from three matches, their scores, and reweighted Gauss-Newton
/// steps on any number of matches. Loops over all matches work on four at a time (stereo_residual.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/alignment.hpp>
#include <cairn/geometry/detail/pose_equations.hpp>
#include <cairn/geometry/detail/robust_pose.hpp>
#include <cairn/geometry/detail/stereo_residual.hpp>
#include <cairn/geometry/ransac.hpp>
#include <cairn/geometry/robust_loss.hpp>
#include <cairn/geometry/stereo_match.hpp>
#include <cairn/geometry/stereo_pose_options.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/simd/processor.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

inline void check_start(const SE3& T_world_camera) {
  if (!all_finite(T_world_camera.matrix())) raise("stereo pose: expected a finite pose to start from");
}

inline void check_prior(const PosePrior& prior) {
  check_start(prior.T_world_camera);
  if (!nearly_semi_definite(prior.information))
    raise("stereo pose: expected a prior information that is finite, symmetric and positive semi-definite");
}

/// The problem that ransac() solves for a stereo pose.
class StereoPoseProblem {
public:
  using Model = SE3;
  static constexpr std::size_t sample_size = 3;
  static_assert(sample_size <= match_lanes);

  StereoPoseProblem(const StereoRig& rig, std::span<const StereoMatch> matches,
                    const StereoPoseOptions& options, const std::optional<PosePrior>& prior)
      : rig_(rig),
        options_(options),
        prior_(prior),
        matches_(matches),
        triangulator_(rig, {.method = TriangulationMethod::weighted_midpoint, .max_gap = 5}),
        lanes_((matches.size() + match_lanes - 1) / match_lanes),
        gate_(chi_square_quantile(options.gate_probability, dof())) {
    CAIRN_EXPECTS(options.loss_scale > 0, "stereo pose: loss_scale is positive");
    if (prior) {
      check_prior(*prior);
      prior_->information = symmetrised(prior->information);
    }
    for (std::size_t i = 0; i < matches.size(); ++i)
      prepare(matches[i], i, rig, options.right_rows, lanes_[i / match_lanes]);
  }

  [[nodiscard]] std::size_t size() const noexcept { return matches_.size(); }

  /// Closed form on three triangulated points, then two Gauss-Newton steps on their pixels.
  [[nodiscard]] bool solve(std::span<const std::uint32_t> sample, SE3& pose) const {
    Vector<3> source[sample_size], target[sample_size];
    double weights[sample_size];
    MatchLanes lanes[1] = {};  // one block holds a sample
    for (std::size_t k = 0; k < sample_size; ++k) {
      const StereoMatch& m = matches_[sample[k]];
      const Triangulation seen = triangulator_(m.left, m.right, m.sigma_left, m.sigma_right);
      if (!seen.good()) return false;
      source[k] = seen.point;
      target[k] = m.landmark;
      weights[k] = 1 / (seen.point(2) * seen.point(2) * seen.point(2) * seen.point(2));
      copy_lane(lanes_[sample[k] / match_lanes], sample[k] % match_lanes, lanes[0], k);
    }
    if (too_narrow(source) || too_narrow(target)) return false;
    const Alignment start = align_points(source, target, weights);
    if (!start.good()) return false;
    pose = start.T_target_source;
    constexpr Weighing all_alike{.gate = std::numeric_limits<double>::max()};
    for (int i = 0; i < 2; ++i)
      if (!step(lanes, pose, all_alike)) return false;
    return true;
  }

  [[nodiscard]] RansacScore score(const SE3& pose, double limit) const noexcept {
    const StereoView view(pose, rig_);
    return with_avx2_lanes([&]() CAIRN_INLINED {
      MatchLane cost = {};  // less what the lanes without a match will add
      cost[0] = -static_cast<double>(lanes_.size() * match_lanes - matches_.size()) * gate_;
      decltype(cost < cost) inliers = {};
      StereoStatistics s;
      for (std::size_t i = 0; i < lanes_.size(); ++i) {
        evaluate(lanes_[i], view, gate_, s);
        const auto inside = s.chi_squared < gate_;
        inliers -= inside;  // true is -1
        cost += inside ? s.chi_squared : gate_ + MatchLane{};
        if (i % 4 == 3 && sum(cost) > limit) break;
      }
      return RansacScore{sum(cost), static_cast<std::size_t>(sum(inliers))};
    });
  }

  /// Local optimisation: one step that listens to a neighbourhood wider than the gate, one within it.
  [[nodiscard]] bool refine(SE3& pose) const {
    return step(pose, 3).has_value() && step(pose, 1).has_value();
  }

  void inliers(const SE3& pose, std::span<std::uint8_t> mask) const {
    const std::vector<double> of_lanes = chi_squares(pose, gate_);
    for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = of_lanes[i] < gate_;
  }

  /// One reweighted Gauss-Newton step with all sigmas taken `widening` times as large, on the matches inside
  /// the gate: its length in standard deviations, squared, or nothing where the equations are degenerate.
  [[nodiscard]] std::optional<double> step(SE3& pose, double widening = 1) const {
    return step(lanes_, pose, {gate_ * widening * widening, options_.loss, options_.loss_scale * widening});
  }

  /// A guess that may be off by tens of pixels, brought closer.
  [[nodiscard]] SE3 approach(SE3 pose) const {
    for (const double widening : {40.0, 12.0, 4.0})
      if (!step(pose, widening)) break;
    return pose;
  }

  /// What the matches below the gate and the prior tell of the pose; nothing where they leave a direction
  /// undetermined. The first part carries the efficiency of the loss and the gate.
  ///
  /// Where the noise of the landmarks may be most of what J^T W J holds of a direction, the information there
  /// is less: by the share that is expected to be noise, and by how much the cost does rise along it, the
  /// mean of both. Landmarks on a line that is not known exactly: J^T W J is sure of the turn about it, and
  /// the cost is level.
  [[nodiscard]] std::optional<Certainty> certainty(const SE3& pose) const {
    constexpr double suspect = 0.1;  // share of noise in J^T W J: more than that is looked into
    constexpr double least = 0.25;   // of J^T W J that is left
    const double efficiency =
        robust_efficiency(options_.loss, options_.loss_scale, options_.gate_probability, gate_, dof());
    const PoseEquations of_lanes = linearise(lanes_, pose, {gate_}, noise_stride());
    const Matrix<3> R = pose.rotation().matrix();
    const Matrix<6> of_matches = efficiency * of_lanes.information(R);
    NormalEquations equations{of_matches};
    add_prior(pose, equations);
    const auto factor = factor_information(equations.information);
    if (!factor) return std::nullopt;
    Certainty result{equations.information, factor->inverse()};
    const auto [d, share] =
        noisiest_direction(result, efficiency * static_cast<double>(noise_stride()) * of_lanes.noise(R));
    if (!(share > suspect)) return result;
    const double of_prior = 1 - d.dot(of_matches * d);
    const double left = 0.5 * (1 - share + efficiency * rise(pose, d) + of_prior);
    if (!(left > least)) return std::nullopt;
    if (left < 1) {  // of what is known along d, one standard deviation long, that share
      const Vector<6> along = result.information * d;
      result.information -= symmetrised(Matrix<6>((1 - left) * along * along.transpose()));
      result.covariance += symmetrised(Matrix<6>((1 / left - 1) * d * d.transpose()));
    }
    return result;
  }

private:
  // Independent coordinates of a residual.
  [[nodiscard]] int dof() const noexcept { return options_.right_rows ? 4 : 3; }

  // What share of the equations is noise is known well enough from every so many matches.
  [[nodiscard]] std::size_t noise_stride() const noexcept {
    constexpr std::size_t enough = 64 / match_lanes;
    return std::max<std::size_t>(1, lanes_.size() / enough);
  }

  // What a match counts: nothing from the gate on.
  struct Weighing {
    double gate;
    RobustLoss loss = RobustLoss::none;
    double loss_scale = 1;
    [[nodiscard]] double operator()(double chi_squared) const noexcept {
      return chi_squared < gate ? robust_weight(loss, loss_scale, chi_squared) : 0;
    }
  };

  // With noise() too, of every so many matches, where the stride is not 0.
  [[nodiscard]] PoseEquations linearise(std::span<const MatchLanes> matches, const SE3& pose,
                                        const Weighing& weighing,
                                        std::size_t noise_stride = 0) const noexcept {
    const StereoView view(pose, rig_);
    const MatchLane axis[3] = {view.left[6], view.left[7], view.left[8]};
    PoseEquations equations;
    with_avx2_lanes([&]() CAIRN_INLINED {
      StereoStatistics s;
      for (std::size_t i = 0; i < matches.size(); ++i) {
        if (!evaluate(matches[i], view, weighing.gate, s)) continue;
        MatchLane weight;
        for (std::size_t lane = 0; lane < match_lanes; ++lane) weight[lane] = weighing(s.chi_squared[lane]);
        equations.add(s, weight);
        if (noise_stride != 0 && i % noise_stride == 0)
          equations.add_noise(s, matches[i].covariance, axis, weight);
      }
    });
    return equations;
  }

  [[nodiscard]] std::optional<double> step(std::span<const MatchLanes> matches, SE3& pose,
                                           const Weighing& weighing) const {
    const PoseEquations of_lanes = linearise(matches, pose, weighing);
    const Matrix<3> R = pose.rotation().matrix();
    NormalEquations equations{of_lanes.information(R), of_lanes.gradient(R)};
    add_prior(pose, equations);
    return newton_step(equations, pose);
  }

  void add_prior(const SE3& pose, NormalEquations& equations) const {
    if (!prior_ || prior_->information.isZero(0)) return;
    const Vector<6> error = local(prior_->T_world_camera, pose);
    const Matrix<6> J = SE3::right_jacobian_inverse(error);
    equations.information += symmetrised(transposed_product(J, product(prior_->information, J)));
    equations.gradient -= transposed_product(J, product(prior_->information, error));
  }

  struct Direction {
    Vector<6> step;    // one standard deviation long
    double share = 0;  // of noise in what the information holds of it
  };

  // By power iteration: how sharply it is met decides nothing.
  [[nodiscard]] static Direction noisiest_direction(const Certainty& of, const Matrix<6>& noise) noexcept {
    constexpr int rounds = 12;
    Direction result{Vector<6>::Ones()};
    for (int i = 0; i < rounds; ++i) {
      result.step /= std::sqrt(result.step.dot(of.information * result.step));
      const Vector<6> pulled = noise * result.step;
      result.share = result.step.dot(pulled);
      if (!(result.share > 0)) return result;
      if (i + 1 < rounds) result.step = of.covariance * pulled;
    }
    return result;
  }

  // Half the second difference of the cost along a step, over the matches that agree at `pose`.
  [[nodiscard]] double rise(const SE3& pose, const Vector<6>& step) const {
    const double most = 100 * gate_;  // of a match that is lost from sight
    const std::vector<double> here = chi_squares(pose, gate_), ahead = chi_squares(retract(pose, step), most),
                              behind = chi_squares(retract(pose, Vector<6>(-step)), most);
    double sum = 0;
    for (std::size_t i = 0; i < here.size(); ++i)
      if (here[i] < gate_) sum += 0.5 * (std::min(ahead[i], most) + std::min(behind[i], most)) - here[i];
    return sum;
  }

  // Of all lanes, exact below the gate; infinite without a match, or where it is out of sight.
  [[nodiscard]] std::vector<double> chi_squares(const SE3& pose, double gate) const {
    const StereoView view(pose, rig_);
    std::vector<double> result(lanes_.size() * match_lanes);
    with_avx2_lanes([&]() CAIRN_INLINED {
      StereoStatistics s;
      for (std::size_t i = 0; i < lanes_.size(); ++i) {
        evaluate(lanes_[i], view, gate, s);
        std::memcpy(&result[i * match_lanes], &s.chi_squared, sizeof(MatchLane));
      }
    });
    return result;
  }

  // Sine of the smallest angle of the triangle below 0.02, or a side of no length.
  [[nodiscard]] static bool too_narrow(const Vector<3> (&x)[sample_size]) noexcept {
    const Vector<3> a = x[1] - x[0], b = x[2] - x[0], c = x[2] - x[1];
    const double area = cross<double>(a, b).squaredNorm();
    const double aa = a.squaredNorm(), bb = b.squaredNorm(), cc = c.squaredNorm();
    return !(area > 4e-4 * std::max({aa * bb, aa * cc, bb * cc}));
  }

  StereoRig rig_;
  StereoPoseOptions options_;
  std::optional<PosePrior> prior_;
  std::span<const StereoMatch> matches_;
  Triangulator triangulator_;
  std::vector<MatchLanes> lanes_;
  double gate_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
