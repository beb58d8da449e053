// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The rigid motion between two sets of points of which some pairs are wrong, each point with its covariance.
///
/// LO-MSAC (ransac.hpp) over samples of three, closed form (alignment.hpp) for a sample, reweighted
/// Gauss-Newton on the rest. A pair's residual r = T^-1 y - x, in the source frame, has covariance C = C_x +
/// R^T C_y R and d r / d step = [-I, skew(p)] for right steps of T_target_source. (1)
///
/// The lever p is where both sightings together put the point, p = T^-1 y - R^T C_y R C^-1 r: with T^-1 y in
/// its place the step would leave out that C turns with R. Its noise, of covariance C_p = C_x C^-1 R^T C_y R,
/// is lever too, so that J^T C^-1 J holds more of the rotation than there is to know,
///   E[skew(n)^T W skew(n)] = W S + S W - tr(W) S - tr(S) W + (tr(W) tr(S) - tr(W S)) I,   W = C^-1, S = C_p
///   (2)
/// which is taken off; a direction that has less than four times as much beside it is undetermined.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/alignment.hpp>
#include <cairn/geometry/detail/pose_equations.hpp>
#include <cairn/geometry/ransac.hpp>
#include <cairn/geometry/robust_loss.hpp>
#include <cairn/geometry/stereo_match.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The same point in two frames.
struct PointMatch {
  Vector<3> source = Vector<3>::Zero(), target = Vector<3>::Zero();
  Matrix<3> source_covariance = Matrix<3>::Zero(), target_covariance = Matrix<3>::Identity();  ///< [m^2]
};

struct RobustAlignmentOptions {
  RansacOptions ransac = {};
  double gate_probability = 0.99;  ///< share of good pairs that pass the chi-square gate
  RobustLoss loss = RobustLoss::cauchy;
  double loss_scale = 3;        ///< in standard deviations of the whole residual
  std::size_t min_inliers = 6;  ///< fewer: no consensus
  double min_share = 0.1;       ///< of all pairs that must agree; below it agreement may be chance
};

enum class RobustAlignmentStatus { good, too_few_pairs, no_consensus, degenerate };

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(RobustAlignmentStatus status) noexcept {
  switch (status) {
    case RobustAlignmentStatus::good:
      return "good";
    case RobustAlignmentStatus::too_few_pairs:
      return "no motion: too few pairs";
    case RobustAlignmentStatus::no_consensus:
      return "no motion: not enough pairs agree with any";
    case RobustAlignmentStatus::degenerate:
      return "no motion: the pairs that agree leave a direction undetermined";
  }
  return "unknown status";
}

/// Result. Unless good, the motion is the identity, and covariance and information are zero.
struct RobustAlignment {
  SE3 T_target_source;
  Matrix<6> covariance = Matrix<6>::Zero();   ///< of a right step, translation then rotation
  Matrix<6> information = Matrix<6>::Zero();  ///< its inverse
  std::vector<std::uint8_t> inliers;          ///< 1 for each pair that agrees
  std::size_t inlier_count = 0;
  int iterations = 0;  ///< samples drawn
  RobustAlignmentStatus status = RobustAlignmentStatus::too_few_pairs;
  [[nodiscard]] bool good() const noexcept { return status == RobustAlignmentStatus::good; }
};

namespace detail {

class RigidProblem {
public:
  using Model = SE3;
  static constexpr std::size_t sample_size = 3;

  RigidProblem(std::span<const PointMatch> pairs, const RobustAlignmentOptions& options)
      : pairs_(pairs), options_(options), gate_(chi_square_quantile(options.gate_probability, 3)) {
    for (std::size_t i = 0; i < pairs.size(); ++i)
      if (!all_finite(pairs[i].source) || !all_finite(pairs[i].target) ||
          !all_finite(pairs[i].source_covariance) || !all_finite(pairs[i].target_covariance))
        raise("align_robustly: expected finite numbers, pair " + std::to_string(i) + " has others");
      else if (!may_be_covariance(pairs[i].source_covariance) ||
               !may_be_covariance(pairs[i].target_covariance))
        raise("align_robustly: expected covariances, symmetric and positive semi-definite, pair " +
              std::to_string(i) + " has others");
  }

  [[nodiscard]] std::size_t size() const noexcept { return pairs_.size(); }

  [[nodiscard]] bool solve(std::span<const std::uint32_t> sample, SE3& motion) const {
    Vector<3> source[sample_size], target[sample_size];
    for (std::size_t k = 0; k < sample_size; ++k) {
      source[k] = pairs_[sample[k]].source;
      target[k] = pairs_[sample[k]].target;
    }
    const Alignment alignment = align_points(source, target, {}, {.tolerance = 1e-4});
    motion = alignment.T_target_source;
    return alignment.good();
  }

  [[nodiscard]] RansacScore score(const SE3& motion, double limit) const noexcept {
    const Frame frame(motion);
    RansacScore result{0, 0};
    for (const PointMatch& pair : pairs_) {
      const double chi_squared = Residual(pair, frame).chi_squared();
      result.cost += std::min(gate_, chi_squared);
      result.inliers += chi_squared < gate_;
      if (result.cost > limit) break;
    }
    return result;
  }

  [[nodiscard]] bool refine(SE3& motion) const {
    return step(motion, 9 * gate_).has_value() && step(motion, gate_).has_value();
  }

  void inliers(const SE3& motion, std::span<std::uint8_t> mask) const noexcept {
    const Frame frame(motion);
    for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = Residual(pairs_[i], frame).chi_squared() < gate_;
  }

  /// One reweighted Gauss-Newton step: its length in standard deviations, squared.
  [[nodiscard]] std::optional<double> step(SE3& motion, double gate) const {
    const auto [information, gradient] = linearise(motion, gate, options_.loss);
    const auto factor = factor_information(information);
    if (!factor) return std::nullopt;
    const Vector<6> d = factor->solve(gradient);
    motion = retract(motion, d);
    return d.dot(gradient);
  }
  [[nodiscard]] std::optional<double> step(SE3& motion) const { return step(motion, gate_); }

  /// Of the pairs that agree, without what is noise; nothing where that leaves a direction undetermined.
  [[nodiscard]] std::optional<Matrix<6>> information(const SE3& motion) const {
    constexpr double least_signal = 4;  // levers twice as long as their deviation
    const Matrix<6> information = linearise(motion, gate_, RobustLoss::none).information;
    const Matrix<3> noise = lever_noise(motion);
    Matrix<6> seen = information, doubtful = information;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        seen(3 + i, 3 + j) -= noise(i, j);
        doubtful(3 + i, 3 + j) -= (1 + least_signal) * noise(i, j);
      }
    if (!factor_information(doubtful)) return std::nullopt;
    return seen * robust_efficiency(options_.loss, options_.loss_scale, options_.gate_probability, gate_, 3);
  }

private:
  struct Equations {
    Matrix<6> information;
    Vector<6> gradient;
  };

  struct Frame {
    SE3 T_source_target;
    Matrix<3> R_source_target;
    explicit Frame(const SE3& motion)
        : T_source_target(motion.inverse()), R_source_target(T_source_target.rotation().matrix()) {}
  };

  struct Residual {
    Vector<3> q, r;       // T^-1 y; q - x
    Matrix<3> of_target;  // R^T C_y R
    Cholesky<3> factor;   // of the residual's covariance
    Residual(const PointMatch& pair, const Frame& frame)
        : q(frame.T_source_target * pair.target),
          r(q - pair.source),
          of_target(turned(pair, frame)),
          factor(Matrix<3>(pair.source_covariance + of_target)) {}
    // Infinite where the covariance is not positive definite: nothing can be said.
    [[nodiscard]] double chi_squared() const noexcept {
      return factor.good() ? factor.whiten(r).squaredNorm() : std::numeric_limits<double>::infinity();
    }
    [[nodiscard]] static Matrix<3> turned(const PointMatch& pair, const Frame& frame) noexcept {
      const Matrix<3> half = product(frame.R_source_target, pair.target_covariance);
      return product_transposed(half, frame.R_source_target);
    }
  };

  [[nodiscard]] Equations linearise(const SE3& motion, double gate, RobustLoss loss) const {
    const Frame frame(motion);
    Matrix<3> translation = Matrix<3>::Zero(), coupling = Matrix<3>::Zero(), rotation = Matrix<3>::Zero();
    Vector<3> force = Vector<3>::Zero(), moment = Vector<3>::Zero();
    for (const PointMatch& pair : pairs_) {
      const Residual residual(pair, frame);
      const double chi_squared = residual.chi_squared();
      if (!(chi_squared < gate)) continue;
      const Matrix<3> inverse = residual.factor.inverse();
      const Matrix<3> weight = robust_weight(loss, options_.loss_scale, chi_squared) * inverse;
      const Matrix<3> share = product(inverse, residual.of_target);  // C^-1 R^T C_y R
      const Vector<3> point = residual.q - transposed_product(share, residual.r);
      const Matrix<3> lever = skew(point), weight_lever = product(weight, lever);
      const Vector<3> pull = product(weight, residual.r);
      translation += weight;
      coupling -= weight_lever;
      rotation += transposed_product(lever, weight_lever);
      force += pull;
      moment -= transposed_product(lever, pull);
    }
    Equations e;  // J^T weight J and -J^T weight r, J of (1)
    put(e.information, 0, 0, translation);
    put(e.information, 0, 3, coupling);
    put(e.information, 3, 0, transposed(coupling));
    put(e.information, 3, 3, rotation);
    put(e.gradient, 0, 0, force);
    put(e.gradient, 3, 0, moment);
    e.information = symmetrised(e.information);
    return e;
  }

  /// What the noise of the levers adds to the information of the rotation, of the pairs that agree: (2).
  [[nodiscard]] Matrix<3> lever_noise(const SE3& motion) const {
    const Frame frame(motion);
    Matrix<3> sum = Matrix<3>::Zero();
    for (const PointMatch& pair : pairs_) {
      const Residual residual(pair, frame);
      if (!(residual.chi_squared() < gate_)) continue;
      const Matrix<3> w = residual.factor.inverse();
      const Matrix<3> s = symmetrised(product(pair.source_covariance, product(w, residual.of_target)));
      const Matrix<3> both = product(w, s);
      const double size_w = w.trace(), size_s = s.trace();
      sum += both + both.transpose() - size_w * s - size_s * w;
      for (int i = 0; i < 3; ++i) sum(i, i) += size_w * size_s - both.trace();
    }
    return sum;
  }

  std::span<const PointMatch> pairs_;
  RobustAlignmentOptions options_;
  double gate_;
};

}  // namespace detail

/// The motion that most pairs agree with, refined on those. Throws Error, naming the pair, where a number is
/// not finite or a covariance is none. Deterministic in its arguments.
[[nodiscard]] inline RobustAlignment align_robustly(std::span<const PointMatch> pairs,
                                                    const RobustAlignmentOptions& options = {}) {
  const detail::RigidProblem problem(pairs, options);
  RobustAlignment result;
  result.inliers.assign(pairs.size(), 0);
  if (pairs.size() < std::max(options.min_inliers, detail::RigidProblem::sample_size)) return result;
  const auto best = ransac(problem, options.ransac);
  result.iterations = best.iterations;
  result.status = RobustAlignmentStatus::no_consensus;
  if (!best.model || !detail::enough_inliers(best.score.inliers, pairs.size(), options)) return result;
  SE3 motion = *best.model;
  result.status = RobustAlignmentStatus::degenerate;
  constexpr int most_steps = 15;
  for (int i = 0; i < most_steps; ++i) {
    const auto length = problem.step(motion);
    if (!length) return result;
    if (*length < 1e-6) break;
  }
  const std::optional<Matrix<6>> information = problem.information(motion);
  if (!information) return result;
  const auto factor = detail::factor_information(*information);
  if (!factor) return result;
  const RansacScore score = problem.score(motion, std::numeric_limits<double>::infinity());
  result.status = !detail::enough_inliers(score.inliers, pairs.size(), options)
                      ? RobustAlignmentStatus::no_consensus
                      : RobustAlignmentStatus::good;
  if (!result.good()) return result;
  result.T_target_source = motion;
  result.information = *information;
  result.covariance = factor->inverse();
  result.inlier_count = score.inliers;
  problem.inliers(motion, result.inliers);
  return result;
}

}}  // namespace cairn::CAIRN_ABI
