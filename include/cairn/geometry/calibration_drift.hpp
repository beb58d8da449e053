// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Keeps a stereo rig calibrated while it is used: a Kalman filter on the five numbers that epipolar
/// residuals can see, and on how fast three of them change.
///
/// State: that of rig_correction.hpp, R = R0 exp(w) and the direction of the baseline t, which walk at
/// random; and the rate r at which w goes on turning where a camera works itself loose, an Ornstein-Uhlenbeck
/// process: at any time as large as its sigma says, and forgotten over its memory of so many frames. Over f
/// frames, with a = f / memory,
///   w += memory (1 - exp(-a)) r,   r *= exp(-a),   with noise of the covariance sigma^2 times
///   ww: memory^2 (2 a - 3 + 4 exp(-a) - exp(-2 a)),   wr: memory (1 - exp(-a))^2,   rr: 1 - exp(-2 a)  (2)
/// (G. E. Uhlenbeck, L. S. Ornstein, "On the theory of the Brownian motion", Physical Review 36, 1930). With
/// no rate a rig that turns steadily is followed with a lag, which a motion lays on the baseline.
///
/// Each match is one scalar measurement, the epipolar constraint e = a . (t x R b) = 0 divided by its
/// standard deviation, with
///   d e / d w = b x R^T (a x t),   d e / d t = R b x a                                   (1)
/// Vertical disparity sees w_x and w_z well, w_y only through x y and through the spread of depth: its
/// variance says so, and it is the one that ruins depth (d z = z^2 w_y / b). Motion sees it: update_moved().
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/motion_calibration.hpp>
#include <cairn/geometry/rig_correction.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A left and a right pixel of the same point.
struct PixelPair {
  Vector<2> left, right;
};

struct CalibrationDriftOptions {
  bool enabled = true;          ///< false: corrected() stays the rig given, bit for bit
  double initial_sigma = 1e-3;  ///< of each of the five numbers [rad]
  double walk_rotation = 3e-5;  ///< random walk of the rotation [rad / sqrt(frame)]
  double walk_baseline = 1e-5;  ///< of the baseline's direction [rad / sqrt(frame)]
  /// Of how fast the rotation goes on turning, about each axis [rad / frame]. 0: it only walks. With a rate
  /// use update_moved(), which alone sees the one about y: else the yaw is soon not known at all.
  double rate_sigma = 0;
  double rate_memory = 500;  ///< frames over which a rate is forgotten
  double pixel_sigma = 0.5;  ///< noise of a coordinate [pixels]
  /// Matches whose innovation exceeds this many deviations are left out; where most of at least twenty are,
  /// and one rig explains them, the rig was knocked and its correction starts again.
  double gate = 3.5;
  double unhealthy_distance =
      1.5;  ///< typical epipolar distance at which depth is not to be trusted [pixels]
};

/// What an update saw. Distances are robust: 1.4826 times the median of the absolute values.
struct CalibrationHealth {
  double distance_before = 0;  ///< typical epipolar distance with the correction so far [pixels]
  double distance_after = 0;   ///< with the correction updated
  std::size_t used = 0, gated = 0;
  bool healthy = true;  ///< distance_after below unhealthy_distance
};

/// The filter. Needs a rig with a baseline and options that are finite and not negative, with positive
/// initial_sigma, pixel_sigma and rate_memory.
class CalibrationDrift {
public:
  explicit CalibrationDrift(const StereoRig& nominal, const CalibrationDriftOptions& options = {})
      : correction_(nominal), options_(options), state_(State::Zero()) {
    for (const double least_zero : {options.walk_rotation, options.walk_baseline, options.rate_sigma})
      CAIRN_EXPECTS(std::isfinite(least_zero) && least_zero >= 0,
                    "CalibrationDrift: expected walks and a rate's sigma that are finite and not negative");
    for (const double positive : {options.initial_sigma, options.pixel_sigma, options.rate_memory})
      CAIRN_EXPECTS(std::isfinite(positive) && positive > 0,
                    "CalibrationDrift: expected positive sigmas and a memory of some frames");
    covariance_ = initial(options.initial_sigma, options.initial_sigma);
  }

  /// The rig with the correction so far.
  [[nodiscard]] StereoRig corrected() const {
    return options_.enabled ? correction_.rig(state()) : correction_.nominal();
  }

  /// The filter in `frames` frames in which it sees nothing.
  [[nodiscard]] CalibrationDrift ahead(int frames) const {
    CAIRN_EXPECTS(frames >= 0, "CalibrationDrift: cannot go back");
    CalibrationDrift then = *this;
    if (options_.enabled) then.walk(frames);
    return then;
  }

  /// The correction, see RigCorrection.
  [[nodiscard]] Vector<5> state() const { return part_of<5, 1>(state_, 0, 0); }
  [[nodiscard]] Matrix<5> covariance() const { return part_of<5, 5>(covariance_, 0, 0); }
  /// How fast the rotation changes [rad / frame].
  [[nodiscard]] Vector<3> rate() const { return part_of<3, 1>(state_, 5, 0); }
  [[nodiscard]] Matrix<3> rate_covariance() const { return part_of<3, 3>(covariance_, 5, 5); }

  /// Takes the pairs of one frame. Pairs without rays are ignored. Few pairs, or wrong ones, that the rig
  /// does not explain are gated, and the health tells. O(pairs).
  CalibrationHealth update(std::span<const PixelPair> pairs) {
    const std::vector<Rays> rays = normalise(pairs);
    CalibrationHealth health;
    health.distance_before = typical_distance(rays);
    if (options_.enabled && !rays.empty()) {
      walk(1);
      const double limit = surprised(rays) ? start_again(rays, health.distance_before)
                                           : std::numeric_limits<double>::infinity();
      for (const Rays& pair : rays) (absorb(pair, limit) ? health.used : health.gated) += 1;
      covariance_ = symmetrised(covariance_);
    }
    health.distance_after = typical_distance(rays);
    health.healthy = health.distance_after < options_.unhealthy_distance;
    return health;
  }

  /// Takes points seen before and after a motion, `frames` frames apart; `guess` is about the motion. Sees
  /// the yaw. The epipolar constraints of these points are part of it: do not give them to update() as well.
  /// Points that the foreseen rig cannot explain, or of which another one explains more by a twentieth, were
  /// seen after a knock: the correction starts again from them alone. O(points).
  MotionCalibration update_moved(std::span<const MovedPair> pairs, const SE3& guess, int frames = 1,
                                 const MotionCalibrationOptions& options = {}) {
    CAIRN_EXPECTS(frames > 0, "CalibrationDrift: expected a motion of at least one frame");
    if (!options_.enabled) return {state(), covariance(), guess};
    walk(frames);
    const auto told = [&](const State& state, const Covariance& covariance) {
      return detail::calibrate_from_motion<numbers>(correction_, state, covariance, pairs, frames, guess,
                                                    options);
    };
    auto result = told(state_, covariance_);
    const bool foreseen = result.good() && !is_knock(result.state - state_);
    // A robust estimate may stay where it was and take for wrong the points that say otherwise, tens of them.
    const std::size_t few = pairs.size() / 20;
    if (!foreseen || pairs.size() - result.inliers > 2 * few) {
      State unmoved = state_;
      unmoved.tail<3>().setZero();
      // As vague as it takes, up to this [rad].
      constexpr double largest = 0.1;
      for (double sigma = options_.initial_sigma; sigma < largest; sigma *= 4) {
        const auto anew = told(unmoved, initial(sigma, options_.initial_sigma));
        const Vector<3> turn = part_of<3, 1>(State(anew.state - unmoved), 0, 0);
        if (!anew.good() || turn.cwiseAbs().maxCoeff() > 2 * sigma) continue;
        if (foreseen && anew.inliers <= result.inliers + few) continue;
        result = anew;
        break;
      }
    }
    state_ = result.state;
    covariance_ = result.covariance;
    return {state(), covariance(), result.T_before_after, result.inliers, result.status};
  }

private:
  static constexpr int numbers = 8;  // the correction, then how fast w changes
  using State = Vector<numbers>;
  using Covariance = Matrix<numbers>;

  struct Rays {
    Vector<2> left, right;  // normalised coordinates
  };

  struct Innovation {
    double value;     // epipolar residual over its standard deviation
    double variance;  // 1 + H P H^T
    State H, PHt;
  };

  [[nodiscard]] std::vector<Rays> normalise(std::span<const PixelPair> pairs) const {
    std::vector<Rays> rays;
    const StereoRig& rig = correction_.nominal();
    rays.reserve(pairs.size());
    for (const PixelPair& pair : pairs) {
      const auto l = rig.left.normalise(pair.left), r = rig.right.normalise(pair.right);
      if (l && r) rays.push_back({*l, *r});
    }
    return rays;
  }

  /// Of a correction that nothing has been seen of.
  [[nodiscard]] Covariance initial(double rotation, double baseline) const {
    Covariance result = Covariance::Zero();
    for (int i = 0; i < numbers; ++i)
      result(i, i) = i < 3 ? squared(rotation) : i < 5 ? squared(baseline) : rate_variance();
    return result;
  }

  /// Whether an estimate lies where what was foreseen does not reach: once in 1e9 by chance. On recorded
  /// drives whose rig stands still up to 32 was seen, after knocks of 4 mrad 60 to 350.
  [[nodiscard]] bool is_knock(const State& step) const {
    const double distance = step.dot(Cholesky<numbers>(covariance_).solve(step));
    return distance > chi_square_quantile(1 - 1e-9, numbers);
  }

  /// A rate that is known keeps the covariance positive definite.
  [[nodiscard]] double rate_variance() const noexcept {
    constexpr double least = 1e-12;
    return squared(std::max(options_.rate_sigma, least));
  }

  /// The rotation goes on at its rate, which is forgotten by and by (2), and walks besides.
  void walk(int frames) {
    const double t = frames, memory = options_.rate_memory, a = t / memory, kept = std::exp(-a);
    const double integral = -memory * std::expm1(-a);  // of what is kept of a rate, over the frames
    Covariance F = Covariance::Identity();
    for (int i = 0; i < 3; ++i) {
      F(i, 5 + i) = integral;
      F(5 + i, 5 + i) = kept;
    }
    state_ = product(F, state_);
    covariance_ = product_transposed(product(F, covariance_), F);
    const double rotation = squared(options_.walk_rotation), baseline = squared(options_.walk_baseline),
                 rate = rate_variance();
    for (int i = 0; i < 5; ++i) covariance_(i, i) += t * (i < 3 ? rotation : baseline);
    const double cross = rate * integral * integral / memory;
    for (int i = 0; i < 3; ++i) {
      covariance_(i, i) += rate * spread(t, memory);
      covariance_(i, 5 + i) += cross;
      covariance_(5 + i, i) += cross;
      covariance_(5 + i, 5 + i) += -rate * std::expm1(-2 * a);
    }
    covariance_ = symmetrised(covariance_);
  }

  /// memory^2 (2 a - 3 + 4 exp(-a) - exp(-2 a)) for a = t / memory, also where the square overflows. In the
  /// brackets is two thirds of a^3 where a is small.
  [[nodiscard]] static double spread(double t, double memory) noexcept {
    const double a = t / memory, lost = memory * std::expm1(-a);
    return a < 1e-2 ? t * t * a * (2.0 / 3 - a / 2) : 2 * memory * (t + lost) - lost * lost;
  }

  [[nodiscard]] Innovation innovation(const Rays& pair) const {
    const Vector<3> a(pair.left(0), pair.left(1), 1), b(pair.right(0), pair.right(1), 1),
        t = correction_.direction(state());
    const Matrix<3> R = correction_.rotation(state()).matrix();
    const Vector<3> m = detail::cross<double>(a, t), Rb = product(R, b);
    const Vector<3> left_line = detail::cross<double>(t, Rb), right_line = transposed_product(R, m);
    const PinholeCamera &left = correction_.nominal().left, &right = correction_.nominal().right;
    const double fx_l = left.fx(), fy_l = left.fy(), fx_r = right.fx(), fy_r = right.fy();
    const double sigma =
        options_.pixel_sigma * std::sqrt(squared(left_line(0) / fx_l) + squared(left_line(1) / fy_l) +
                                         squared(right_line(0) / fx_r) + squared(right_line(1) / fy_r));
    const Vector<3> by_rotation = detail::cross<double>(b, right_line);  // (1)
    const Vector<2> by_direction =
        transposed_product(correction_.direction_jacobian(), detail::cross<double>(Rb, a));
    Innovation result;
    result.value = -a.dot(left_line) / std::max(sigma, 1e-12);
    result.H << by_rotation(0), by_rotation(1), by_rotation(2), by_direction(0), by_direction(1), 0, 0, 0;
    result.H /= std::max(sigma, 1e-12);
    result.PHt = product(covariance_, result.H);
    result.variance = 1 + result.H.dot(result.PHt);
    return result;
  }

  /// One scalar Kalman update; false where the gate refuses the pair, or it is off by more than `limit` noise
  /// deviations.
  bool absorb(const Rays& pair, double limit) {
    const Innovation z = innovation(pair);
    if (!(z.value * z.value <= options_.gate * options_.gate * z.variance && std::abs(z.value) <= limit))
      return false;
    state_ += z.PHt * (z.value / z.variance);
    covariance_ -= product_transposed(z.PHt, z.PHt) / z.variance;
    return true;
  }

  /// Whether most pairs fall out of the gate, more of them than a few wrong ones: the rig moved by more than
  /// the walk foresees.
  [[nodiscard]] bool surprised(const std::vector<Rays>& rays) const {
    constexpr std::size_t enough = 20;  // of five numbers four times over
    if (rays.size() < enough) return false;
    std::size_t outside = 0;
    for (const Rays& pair : rays) {
      const Innovation z = innovation(pair);
      outside += z.value * z.value > options_.gate * options_.gate * z.variance;
    }
    return 2 * outside > rays.size();
  }

  /// Makes the covariance as wide as the residuals are, and leads the state into the basin of most pairs:
  /// reweighted least squares (Cauchy) whose scale follows the median residual down. Nothing where it does
  /// not come down to half of the `distance` there was: no rig explains them. By how many noise deviations a
  /// pair may be off from there: the wide covariance would let through wrong ones as well.
  double start_again(const std::vector<Rays>& rays, double distance) {
    const State known = state_;
    const Covariance known_covariance = covariance_;
    const double focal = 0.5 * (correction_.nominal().left.fy() + correction_.nominal().right.fy());
    const double sigma = std::max(options_.initial_sigma, 2 * typical_distance(rays) / focal);
    covariance_ = initial(sigma, sigma);
    state_.tail<3>().setZero();
    const State before = state_;
    std::vector<double> sizes(rays.size());
    const auto typical_size = [&] {
      for (std::size_t i = 0; i < rays.size(); ++i) sizes[i] = std::abs(innovation(rays[i]).value);
      return std::max(1.0, 1.4826 * median(sizes));
    };
    for (int step = 0; step < 10; ++step) {
      const double scale = typical_size();
      Covariance information = Covariance::Identity() / (sigma * sigma);
      State gradient = (before - state_) / (sigma * sigma);
      for (const Rays& pair : rays) {
        const Innovation z = innovation(pair);
        const double weight = 1 / (1 + squared(z.value / scale));
        information += weight * product_transposed(z.H, z.H);
        gradient += (weight * z.value) * z.H;
      }
      state_ += Cholesky<numbers>(information).solve(gradient);
    }
    if (typical_distance(rays) > 0.5 * distance) {
      state_ = known;
      covariance_ = known_covariance;
      return std::numeric_limits<double>::infinity();
    }
    return options_.gate * typical_size();
  }

  [[nodiscard]] double typical_distance(const std::vector<Rays>& rays) const {
    if (rays.empty()) return 0;
    const EpipolarConstraint constraint(corrected());
    std::vector<double> distances;
    distances.reserve(rays.size());
    for (const Rays& pair : rays) distances.push_back(std::abs(constraint.distance(pair.left, pair.right)));
    return 1.4826 * median(std::move(distances));
  }

  [[nodiscard]] static double squared(double value) noexcept { return value * value; }

  RigCorrection correction_;
  CalibrationDriftOptions options_;
  State state_;
  Covariance covariance_;
};

}}  // namespace cairn::CAIRN_ABI
