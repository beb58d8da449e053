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

#include <concepts>
#include <limits>
#include <optional>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/matrix_of.hpp>
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
/// and is not seen) or a matrix is not finite or R is not positive definite, or run-time sizes do not fit.
template <int N, int M, class S>
[[nodiscard]] std::optional<SteadyState<N, M, S>> steady_state(const Matrix<N, N, S>& f,
                                                               const Matrix<M, N, S>& h,
                                                               const Matrix<N, N, S>& q,
                                                               const Matrix<M, M, S>& r) {
  const int n = static_cast<int>(f.rows());
  const Eigen::Index m = h.rows();
  if (n == 0 || m == 0 || !detail::has_size(f, n, n) || !detail::has_size(h, m, n) ||
      !detail::has_size(q, n, n) || !detail::has_size(r, m, m))
    return std::nullopt;
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

namespace detail {

/// Of sizes that have to be equal, the first that is known when compiled.
[[nodiscard]] constexpr int known_size(int a, int b, int c = dynamic, int d = dynamic) {
  return a != dynamic ? a : b != dynamic ? b : c != dynamic ? c : d;
}

}  // namespace detail

/// The same for anything that stands for the four matrices.
template <class F, class H, class Q, class R, class S = typename detail::ShapeOf<F>::Scalar,
          int N = detail::known_size(detail::ShapeOf<F>::rows, detail::ShapeOf<F>::columns,
                                     detail::ShapeOf<Q>::rows, detail::ShapeOf<H>::columns),
          int M = detail::known_size(detail::ShapeOf<H>::rows, detail::ShapeOf<R>::rows,
                                     detail::ShapeOf<R>::columns)>
  requires MatrixOf<F, N, N, S> && MatrixOf<H, M, N, S> && MatrixOf<Q, N, N, S> && MatrixOf<R, M, M, S> &&
           (!std::same_as<F, Matrix<N, N, S>> || !std::same_as<H, Matrix<M, N, S>> ||
            !std::same_as<Q, Matrix<N, N, S>> || !std::same_as<R, Matrix<M, M, S>>)
[[nodiscard]] std::optional<SteadyState<N, M, S>> steady_state(const F& f, const H& h, const Q& q,
                                                               const R& r) {
  const Eigen::Index n = N != dynamic ? N : f.rows();
  const Eigen::Index m = M != dynamic ? M : h.rows();
  bool misfit = false;
  const Matrix<N, N, S> plain_f = detail::plain_matrix<N, N, S>(f, n, n, misfit);
  const Matrix<M, N, S> plain_h = detail::plain_matrix<M, N, S>(h, m, n, misfit);
  const Matrix<N, N, S> plain_q = detail::plain_matrix<N, N, S>(q, n, n, misfit);
  const Matrix<M, M, S> plain_r = detail::plain_matrix<M, M, S>(r, m, m, misfit);
  if (misfit) return std::nullopt;
  return steady_state(plain_f, plain_h, plain_q, plain_r);
}

}  // namespace cairn::inline CAIRN_ABI
