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
/// is lever too, so that J^T C^-1 J holds more of the rotation than there is to know, by the mixed cofactors
/// of C^-1 and C_p (detail/robust_pose.hpp). They are taken off; a direction that has less than four times as
/// much beside it is undetermined.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/alignment.hpp>
#include <cairn/geometry/detail/robust_pose.hpp>
#include <cairn/geometry/ransac.hpp>
#include <cairn/geometry/robust_loss.hpp>
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
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const PointMatch& pair = pairs[i];
      if (!all_finite(pair.source) || !all_finite(pair.target)) refuse_pair(i, "finite points");
      if (!nearly_semi_definite(pair.source_covariance) || !nearly_semi_definite(pair.target_covariance))
        refuse_pair(i, "covariances: finite, symmetric, positive semi-definite");
    }
    for (int axis = 0; axis < 3 && !pairs.empty(); ++axis) {  // of most: one wrong pair may be anywhere
      std::vector<double> places;
      for (const PointMatch& pair : pairs) places.push_back(pair.source(axis));
      centre_(axis) = median(std::move(places));
    }
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
    const SE3 to_centre(SO3(), centre_);
    SE3 there = motion * to_centre;
    const auto length = newton_step(linearise(motion, gate, options_.loss), there);
    if (length) motion = there * to_centre.inverse();
    return length;
  }
  [[nodiscard]] std::optional<double> step(SE3& motion) const { return step(motion, gate_); }

  /// By the pairs that agree, without what is noise; nothing where that leaves a direction undetermined.
  [[nodiscard]] std::optional<Certainty> certainty(const SE3& motion) const {
    constexpr double least_signal = 4;  // levers twice as long as their deviation
    Matrix<3> of_levers = Matrix<3>::Zero();
    const Matrix<6> information = linearise(motion, gate_, RobustLoss::none, &of_levers).information;
    Matrix<6> noise = Matrix<6>::Zero();
    put(noise, 3, 3, of_levers);
    if (!factor_information(information - (1 + least_signal) * noise)) return std::nullopt;
    const double efficiency =
        robust_efficiency(options_.loss, options_.loss_scale, options_.gate_probability, gate_, 3);
    const Matrix<6> seen = efficiency * (information - noise);
    const auto factor = factor_information(seen);
    if (!factor) return std::nullopt;
    const Matrix<6> to_origin = SE3(SO3(), centre_).adjoint(), to_centre = SE3(SO3(), -centre_).adjoint();
    const Certainty result{symmetrised(Matrix<6>(to_centre.transpose() * seen * to_centre)),
                           symmetrised(Matrix<6>(to_origin * factor->inverse() * to_origin.transpose()))};
    // So far away that these matrices hold nothing of what is known at the points.
    if (!Cholesky<6>(result.information).good() || !Cholesky<6>(result.covariance).good())
      return std::nullopt;
    return result;
  }

private:
  [[noreturn, gnu::cold, gnu::noinline]] static void refuse_pair(std::size_t index, const char* what) {
    raise("align_robustly: pair " + std::to_string(index) + ": expected " + what);
  }

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
          of_target(product_transposed(product(frame.R_source_target, pair.target_covariance),
                                       frame.R_source_target)),
          factor(Matrix<3>(pair.source_covariance + of_target)) {}
    // Infinite where the covariance is not positive definite: nothing can be said.
    [[nodiscard]] double chi_squared() const noexcept {
      return factor.good() ? factor.whiten(r).squaredNorm() : std::numeric_limits<double>::infinity();
    }
  };

  /// By (1), of the pairs below the gate, for right steps at the centre of the sources: from an origin far
  /// away all levers are alike, and their differences, which the rotation is known by, rounding. What the
  /// noise of the levers adds to the rotation goes to `of_levers`.
  [[nodiscard]] NormalEquations linearise(const SE3& motion, double gate, RobustLoss loss,
                                          Matrix<3>* of_levers = nullptr) const {
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
      const Matrix<3> lever = skew(Vector<3>(point - centre_)), weight_lever = product(weight, lever);
      const Vector<3> pull = product(weight, residual.r);
      translation += weight;
      coupling -= weight_lever;
      rotation += transposed_product(lever, weight_lever);
      force += pull;
      moment -= transposed_product(lever, pull);
      if (of_levers == nullptr) continue;
      const Matrix<3> spread = symmetrised(product(pair.source_covariance, share));  // C_p
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) add_mixed_cofactor(weight, spread, i, j, (*of_levers)(i, j));
    }
    NormalEquations e;
    put(e.information, 0, 0, translation);
    put(e.information, 0, 3, coupling);
    put(e.information, 3, 0, transposed(coupling));
    put(e.information, 3, 3, rotation);
    put(e.gradient, 0, 0, force);
    put(e.gradient, 3, 0, moment);
    e.information = symmetrised(e.information);
    return e;
  }

  std::span<const PointMatch> pairs_;
  RobustAlignmentOptions options_;
  double gate_;
  Vector<3> centre_ = Vector<3>::Zero();  ///< of the sources, by medians
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
  if (detail::settle(problem, motion, options, result)) result.T_target_source = motion;
  return result;
}

}}  // namespace cairn::CAIRN_ABI
