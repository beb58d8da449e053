// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The rigid motion, or similarity, that carries one set of points onto another.
///
/// Minimises sum w |y - (c R x + t)|^2. With centred points and S = sum w x y^T, the rotation is the unit
/// quaternion q that maximises q^T N q, N the symmetric 4x4 matrix of S (B. Horn, "Closed-form solution of
/// absolute orientation using unit quaternions", JOSA A 4, 1987); the scale c = q^T N q / sum w |x|^2 and
/// t = y_mean - c R x_mean are those of S. Umeyama (IEEE T-PAMI 13, 1991), who reaches the same optimum by an
/// SVD.
///
/// The eigenvalues of N are s1+s2+s3, s1-s2-s3, -s1+s2-s3, -s1-s2+s3 with s1 >= s2 >= |s3| the singular
/// values of S, s3 < 0 where a reflection would fit better: rank and ambiguity are read from them. O(n).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/symmetric_eigen.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

enum class AlignmentStatus {
  good,
  ambiguous,  ///< fewer than three points, or points on a line or in one place: the rotation is not
              ///< determined
  mirrored    ///< a reflection fits far better than any rotation; the best rotation is returned
};

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(AlignmentStatus status) noexcept {
  switch (status) {
    case AlignmentStatus::good:
      return "good";
    case AlignmentStatus::ambiguous:
      return "ambiguous: fewer than three points, or points on a line, do not determine a rotation";
    case AlignmentStatus::mirrored:
      return "mirrored: a reflection fits far better than any rotation";
  }
  return "unknown status";
}

struct AlignmentOptions {
  bool with_scale = false;  ///< also estimate c; otherwise c = 1
  double tolerance = 1e-9;  ///< singular values below tolerance * s1 count as zero
};

/// Result: y ~ scale * R x + t with T_target_source = (R, t).
struct Alignment {
  SE3 T_target_source;
  double scale = 1;
  int rank = 0;  ///< of the point sets: 3 space, 2 plane, 1 line, 0 one place
  /// s2 + s3 [m^2]: one more turn by an angle a, about the axis that matters least (the line that the points
  /// are near to), adds 2 scale turn_cost (1 - cos a) to the squares.
  double turn_cost = 0;
  double rms = 0;       ///< root of the weighted mean squared distance that is left
  double variance = 0;  ///< estimated variance of a point of weight 1: weighted squares / (3n - 6 or 7)
  /// Of a right step (translation, rotation) of T_target_source, scale held, where w are inverse variances
  /// [1/m^2] per coordinate; with other weights multiply the covariance by `variance`.
  Matrix<6> information = Matrix<6>::Zero();
  std::optional<Matrix<6>> covariance;  ///< inverse of information, where that exists
  AlignmentStatus status = AlignmentStatus::ambiguous;
  [[nodiscard]] bool good() const noexcept { return status == AlignmentStatus::good; }
};

namespace detail {

/// Horn's matrix of S = sum w x y^T.
[[nodiscard]] inline Matrix<4> horn_matrix(const Matrix<3>& S) {
  Matrix<4> N;
  N << S(0, 0) + S(1, 1) + S(2, 2), S(1, 2) - S(2, 1), S(2, 0) - S(0, 2), S(0, 1) - S(1, 0),  //
      0, S(0, 0) - S(1, 1) - S(2, 2), S(0, 1) + S(1, 0), S(2, 0) + S(0, 2),                   //
      0, 0, S(1, 1) - S(0, 0) - S(2, 2), S(1, 2) + S(2, 1),                                   //
      0, 0, 0, S(2, 2) - S(0, 0) - S(1, 1);
  for (int i = 1; i < 4; ++i)
    for (int j = 0; j < i; ++j) N(i, j) = N(j, i);
  return N;
}

/// Sums over both point sets, centred.
struct AlignmentMoments {
  double weight = 0;
  Vector<3> source_mean = Vector<3>::Zero(), target_mean = Vector<3>::Zero();
  Matrix<3> cross = Matrix<3>::Zero();   // sum w x y^T
  Matrix<3> source = Matrix<3>::Zero();  // sum w x x^T
  double target_squares = 0;             // sum w |y|^2
};

using DoublePair = Lanes<double, 2>;

/// The sums behind AlignmentMoments, of two pairs of points at a time: accumulators in vectors stay in
/// registers, those in matrices would wait for memory.
class MomentSums {
public:
  MomentSums(const Vector<3>& source_mean, const Vector<3>& target_mean) noexcept {
    for (int k = 0; k < 3; ++k) {
      x0_[k] = source_mean(k) + DoublePair{};
      y0_[k] = target_mean(k) + DoublePair{};
    }
  }

  [[gnu::always_inline]] void add(const Vector<3>* x_of, const Vector<3>* y_of, std::size_t i, std::size_t j,
                                  DoublePair weight) noexcept {
    DoublePair x[3], y[3];
    for (int k = 0; k < 3; ++k) {
      x[k] = DoublePair{x_of[i](k), x_of[j](k)} - x0_[k];
      y[k] = DoublePair{y_of[i](k), y_of[j](k)} - y0_[k];
    }
    squares_ += weight * (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
    for (int row = 0, k = 0; row < 3; ++row) {
      const DoublePair weighted = weight * x[row];
      for (int column = 0; column < 3; ++column) cross_[3 * row + column] += weighted * y[column];
      for (int column = row; column < 3; ++column, ++k) source_[k] += weighted * x[column];
    }
  }

  void get(AlignmentMoments& m) const noexcept {
    for (int row = 0, k = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) m.cross(row, column) = sum(cross_[3 * row + column]);
      for (int column = row; column < 3; ++column, ++k)
        m.source(row, column) = m.source(column, row) = sum(source_[k]);
    }
    m.target_squares = sum(squares_);
  }

private:
  DoublePair x0_[3], y0_[3], cross_[9] = {}, source_[6] = {}, squares_ = {};
};

[[nodiscard]] inline AlignmentMoments alignment_moments(std::span<const Vector<3>> source,
                                                        std::span<const Vector<3>> target,
                                                        std::span<const double> weights) {
  AlignmentMoments m;
  const std::size_t n = source.size();
  const auto weight = [&](std::size_t i) { return weights.empty() ? 1.0 : weights[i]; };
  Vector<3> x = Vector<3>::Zero(), y = Vector<3>::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    m.weight += weight(i);
    x += weight(i) * source[i];
    y += weight(i) * target[i];
  }
  if (!(m.weight > 0)) return m;
  m.source_mean = x / m.weight;
  m.target_mean = y / m.weight;
  MomentSums sums(m.source_mean, m.target_mean);
  for (std::size_t i = 0; i + 1 < n; i += 2)
    sums.add(source.data(), target.data(), i, i + 1, DoublePair{weight(i), weight(i + 1)});
  if (n % 2 == 1) sums.add(source.data(), target.data(), n - 1, n - 1, DoublePair{weight(n - 1), 0});
  sums.get(m);
  return m;
}

[[noreturn, gnu::cold, gnu::noinline]] inline void refuse_alignment(std::span<const Vector<3>> source,
                                                                    std::span<const Vector<3>> target,
                                                                    std::span<const double> weights) {
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (!all_finite(source[i]) || !all_finite(target[i]))
      raise("align_points: expected finite coordinates, pair " + std::to_string(i) + " has others");
    if (!weights.empty() && !(weights[i] >= 0 && std::isfinite(weights[i])))
      raise("align_points: expected finite weights >= 0, pair " + std::to_string(i) + " has another");
  }
  raise("align_points: coordinates so large that their squares overflow");
}

/// Inverse of the centred information: translation and rotation decouple at the centroid of R^T (y - t).
inline void alignment_covariance(const AlignmentMoments& m, double scale, bool determined,
                                 Alignment& result) {
  const Vector<3> centre = scale * m.source_mean;
  const Matrix<3> lever = skew(centre), lever_squared = product(lever, lever);
  const double trace = scale * scale * m.source.trace();
  Matrix<3> rotation;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const double unit = i == j ? 1 : 0;
      rotation(i, j) = unit * trace - scale * scale * m.source(i, j);
      result.information(i, j) = unit * m.weight;
      result.information(i, 3 + j) = -m.weight * lever(i, j);
      result.information(3 + i, j) = m.weight * lever(i, j);
      result.information(3 + i, 3 + j) = rotation(i, j) - m.weight * lever_squared(i, j);
    }
  if (!determined) return;
  const Matrix<3> c = Cholesky<3>(rotation).inverse(), lever_c = product(lever, c),
                  lever_c_lever = product(lever_c, lever);
  Matrix<6> covariance;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      covariance(i, j) = (i == j ? 1 / m.weight : 0) - lever_c_lever(i, j);
      covariance(i, 3 + j) = covariance(3 + j, i) = lever_c(i, j);
      covariance(3 + i, 3 + j) = c(i, j);
    }
  result.covariance = symmetrised(covariance);
}

}  // namespace detail

/// The motion that carries `source` onto `target`, pair by pair, with optional weights >= 0 (one each).
/// Throws Error, naming the pair, where a number is not finite.
[[nodiscard]] inline Alignment align_points(std::span<const Vector<3>> source,
                                            std::span<const Vector<3>> target,
                                            std::span<const double> weights = {},
                                            const AlignmentOptions& options = {}) {
  CAIRN_EXPECTS(source.size() == target.size(), "align_points: both sets need the same number of points");
  CAIRN_EXPECTS(weights.empty() || weights.size() == source.size(), "align_points: one weight a pair");
  Alignment result;
  if (source.empty()) return result;
  const detail::AlignmentMoments m = detail::alignment_moments(source, target, weights);
  const double squares = m.source.trace() + m.target_squares;
  if (!(std::isfinite(squares) && m.weight >= 0 && all_finite(m.cross)))
    detail::refuse_alignment(source, target, weights);
  for (const double weight : weights)
    if (!(weight >= 0)) detail::refuse_alignment(source, target, weights);
  if (m.weight == 0) return result;

  Matrix<4> N = detail::horn_matrix(m.cross);
  std::array<double, 4> values;
  std::array<double, 16> q;  // the first four numbers belong to the largest value
  if (!symmetric_eigen(std::span<double, 16>(N.data(), 16), std::span(values), std::span(q)))
    detail::refuse_alignment(source, target, weights);
  const SO3 R = SO3::from_quaternion(q[0], q[1], q[2], q[3]);
  const double s1 = 0.5 * (values[0] + values[1]), s2 = 0.5 * (values[0] + values[2]),
               s3 = 0.5 * (values[0] + values[3]);
  const double fit = values[0], source_squares = m.source.trace(), zero = options.tolerance * s1;
  if (options.with_scale && source_squares > 0 && fit > 0) result.scale = fit / source_squares;
  result.T_target_source = SE3(R, m.target_mean - result.scale * R.rotate(m.source_mean));

  // Sets far from the origin have moments of rounding size: they are one place.
  const double far = std::max(m.source_mean.squaredNorm(), m.target_mean.squaredNorm());
  const bool one_place = !(s1 > 1e-28 * m.weight * far);
  result.rank = one_place ? 0 : 1 + (s2 > zero) + (std::abs(s3) > zero);
  const double left =
      std::max(0.0, m.target_squares - 2 * result.scale * fit + result.scale * result.scale * source_squares);
  const double reflected = std::max(0.0, left + 4 * result.scale * std::min(s3, 0.0));
  const double dof = 3.0 * static_cast<double>(source.size()) - (options.with_scale ? 7 : 6);
  result.turn_cost = std::max(0.0, s2 + s3);
  result.rms = std::sqrt(left / m.weight);
  result.variance = left / std::max(dof, 1.0);

  const bool determined = !one_place && s2 + s3 > zero;  // half the gap between the two largest eigenvalues
  if (determined)
    result.status =
        s3 < -1e-3 * s1 && reflected < 0.25 * left ? AlignmentStatus::mirrored : AlignmentStatus::good;
  detail::alignment_covariance(m, result.scale, determined, result);
  return result;
}

}}  // namespace cairn::CAIRN_ABI
