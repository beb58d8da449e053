// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What poses from wrong data have in common, be they of pixels or of points: which covariances are taken,
/// when there is a consensus, a Gauss-Newton step, and the way from a first pose to a verdict.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/ransac.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/simd/processor.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Whether `a` is finite, symmetric and positive semi-definite. Forgiven is what rounding, that of floats
/// too, may have done: both triangles, and the least eigenvalue and zero, may be a thousandth apart where
/// the diagonal is scaled to 1.
template <int N>
[[nodiscard]] bool nearly_semi_definite(const Matrix<N>& a) noexcept {
  constexpr double slack = 1e-3;
  constexpr double least = std::numeric_limits<double>::min();  // a pivot for rows of zeros
  double left[N][N];                                            // by the pivots before
  bool fine = true;
  each<N>([&](int j) CAIRN_INLINED {
    each<N>(j, N, [&](int i) CAIRN_INLINED {
      const double apart = a(i, j) - a(j, i);  // NaN for infinities, the diagonal's too
      fine &= apart * apart <= slack * slack * a(i, i) * a(j, j);
      left[i][j] = 0.5 * (a(i, j) + a(j, i));
    });
    left[j][j] += slack * left[j][j] + least;
  });
  each<N>([&](int j) CAIRN_INLINED {
    fine &= left[j][j] > 0;
    each<N>(j + 1, N, [&](int k) CAIRN_INLINED {
      const double factor = left[k][j] / left[j][j];
      each<N>(k, N, [&](int i) CAIRN_INLINED { left[i][k] -= factor * left[i][j]; });
    });
  });
  return fine;
}

/// Whether so many agree that it is a consensus, by the options' min_inliers and min_share.
template <class Options>
[[nodiscard]] bool enough_inliers(std::size_t inliers, std::size_t count, const Options& options) noexcept {
  return inliers >= options.min_inliers &&
         static_cast<double>(inliers) >= options.min_share * static_cast<double>(count);
}

/// Entry i, j of E[skew(n)^T W skew(n)] for noise n of covariance C: of the mixed cofactors of both.
template <class A, class B, class Sum>
[[gnu::always_inline]] inline void add_mixed_cofactor(const A& W, const B& C, int i, int j, Sum& sum) {
  const int a = (i + 1) % 3, b = (i + 2) % 3, e = (j + 1) % 3, f = (j + 2) % 3;
  sum += W(a, e) * C(b, f) + W(b, f) * C(a, e) - W(a, f) * C(b, e) - W(b, e) * C(a, f);
}

/// Cholesky factor of an information matrix; nothing where a direction is undetermined given the others.
[[nodiscard]] inline std::optional<Cholesky<6>> factor_information(const Matrix<6>& information) {
  constexpr double least_share = 1e-10;  // of a direction's information that the others do not explain
  const Cholesky<6> result(information);
  if (!(result.good() && result.least_share() > least_share)) return std::nullopt;
  return result;
}

/// J^T W J and -J^T W r of residuals r, for right steps.
struct NormalEquations {
  Matrix<6> information = Matrix<6>::Zero();
  Vector<6> gradient = Vector<6>::Zero();
};

/// Steps to where the equations vanish: how far in standard deviations, squared, or nothing where they leave
/// a direction undetermined.
[[nodiscard]] inline std::optional<double> newton_step(const NormalEquations& equations, SE3& pose) {
  const auto factor = factor_information(equations.information);
  if (!factor) return std::nullopt;
  const Vector<6> d = factor->solve(equations.gradient);
  pose = retract(pose, d);
  return d.dot(equations.gradient);
}

/// How well a pose is known, of a right step.
struct Certainty {
  Matrix<6> information, covariance;
};

/// Reweighted Gauss-Newton from `pose` to convergence, then verdict, covariance and mask. True where the
/// verdict is good.
template <class Problem, class Options, class Result>
bool settle(const Problem& problem, SE3& pose, const Options& options, Result& result) {
  using Status = decltype(result.status);
  result.status = Status::degenerate;
  constexpr int most_steps = 15;
  for (int step = 0; step < most_steps; ++step) {
    const auto length = problem.step(pose);
    if (!length) return false;
    if (*length < 1e-5) break;  // 0.003 standard deviations, and the next step would be far shorter
  }
  const std::optional<Certainty> certainty = problem.certainty(pose);
  if (!certainty) return false;
  const RansacScore score = problem.score(pose, std::numeric_limits<double>::infinity());
  if constexpr (requires { result.cost; }) result.cost = score.cost;
  result.status =
      enough_inliers(score.inliers, problem.size(), options) ? Status::good : Status::no_consensus;
  if (!result.good()) return false;
  result.information = certainty->information;
  result.covariance = certainty->covariance;
  result.inlier_count = score.inliers;
  problem.inliers(pose, result.inliers);
  return true;
}

}}}  // namespace cairn::CAIRN_ABI::detail
