// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The gain that a Kalman filter of constant matrices settles to, for filters that must cost nothing.
///
/// The predicted covariance solves the discrete algebraic Riccati equation
///   P = F P F^T - F P H^T (H P H^T + R)^-1 H P F^T + Q,
/// here by doubling: each round squares the number of steps taken (B. Anderson, J. Moore, "Optimal
/// Filtering", 1979, 6.7), so some ten rounds replace a thousand.
#pragma once

#include <limits>
#include <optional>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// What a Kalman filter settles to.
template <int N, int M, class S = double>
struct SteadyState {
  Matrix<N, N, S> predicted;  ///< covariance before an update
  Matrix<N, N, S> updated;    ///< covariance after it
  Matrix<N, M, S> gain;       ///< x <- x + gain (z - H x)
};

/// Steady state of x' = F x + noise(Q), z = H x + noise(R); nothing where there is none (a state that grows
/// and is not seen) or a matrix is not finite or R is not positive definite.
template <int N, int M, class S>
[[nodiscard]] std::optional<SteadyState<N, M, S>> steady_state(const Matrix<N, N, S>& f,
                                                               const Matrix<M, N, S>& h,
                                                               const Matrix<N, N, S>& q,
                                                               const Matrix<M, M, S>& r) {
  const int n = static_cast<int>(f.rows());
  const Cholesky<M, S> root_r(r);
  if (!root_r.good()) return std::nullopt;
  const Matrix<N, N, S> identity = Matrix<N, N, S>::Identity(n, n);
  Matrix<N, N, S> a = transposed<N, N, S>(f);           // transition of the adjoint, 2^k steps
  Matrix<N, N, S> g = h.transpose() * root_r.solve(h);  // information of 2^k measurements
  Matrix<N, N, S> p = q;                                // covariance after 2^k steps from certainty
  bool settled = false;
  for (int round = 0; round < 60 && !settled; ++round) {
    Matrix<N, N, S> inverse_a = a;
    Matrix<N, N, S> inverse_g = g;
    const Matrix<N, N, S> w = identity + g * p;
    if (!detail::solve_square<N, N, S>(w, inverse_a) || !detail::solve_square<N, N, S>(w, inverse_g))
      return std::nullopt;
    const Matrix<N, N, S> growth = symmetrised(a.transpose() * p * inverse_a);
    g = symmetrised(g + a * inverse_g * a.transpose());
    a = (a * inverse_a).eval();
    p += growth;
    if (!all_finite(p) || !all_finite(g)) return std::nullopt;
    settled =
        growth.cwiseAbs().maxCoeff() <= S(4) * std::numeric_limits<S>::epsilon() * p.cwiseAbs().maxCoeff();
  }
  if (!settled) return std::nullopt;
  const Matrix<N, M, S> ph = p * h.transpose();
  const Cholesky<M, S> root_s(symmetrised(h * ph + r));
  SteadyState<N, M, S> result{p, p, root_s.solve(Matrix<M, N, S>(ph.transpose())).transpose()};
  result.updated = symmetrised(p - result.gain * ph.transpose());
  return result;
}

}  // namespace cairn::inline CAIRN_ABI
