// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The gain that a Kalman filter of constant matrices settles to, for filters that must cost nothing.
///
/// The predicted covariance solves the discrete algebraic Riccati equation
///   P = F P F^T - F P H^T (H P H^T + R)^-1 H P F^T + Q,
/// here by the doubling that keeps its structure: with A = F^T, G = H^T R^-1 H and P = Q at first,
///   A <- A W A,   G <- G + A W G A^T,   P <- P + A^T P W A,   W = (I + G P)^-1 of the old ones,
/// so that each round squares the number of steps taken and A, the closed loop's transition over all of them,
/// falls to nothing (E. Chu, H. Fan, W. Lin, C. Wang, "Structure-preserving algorithms for periodic
/// discrete-time algebraic Riccati equations", Int. J. Control 77, 2004). States are taken in units of their
/// own deviations, so that a small one settles as far as a large one does.
///
/// What rounding left is corrected by Newton's method: with K the gain of P and D what the equation says
/// above P,
///   P <- P + X,   X = A X A^T + D,   A = F (I - K H),
/// by the doubling X <- X + A X A^T, A <- A A (G. Hewer, "An iterative technique for the computation of the
/// steady state gains for the discrete optimal regulator", IEEE Trans. Automatic Control 16, 1971). X is what
/// P was wrong by, where D is small of a filter that forgets slowly too.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/array_update.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What a Kalman filter settles to. Where it is not accepted the matrices are of no use.
template <int N, int M, class S = double>
struct [[nodiscard]] SteadyState {
  Matrix<N, N, S> predicted;  ///< covariance before an update
  Matrix<N, N, S> updated;    ///< covariance after it
  Matrix<N, M, S> gain;       ///< x <- x + gain (z - H x)
  Status status = Status::accepted;

  [[nodiscard]] bool accepted() const noexcept { return status == Status::accepted; }
};

namespace detail {

/// Rounds of doubling until every variance has settled and the closed loop has forgotten its start.
template <int N, class S>
[[nodiscard]] Status riccati_by_doubling(Matrix<N, N, S> a, Matrix<N, N, S> g, Matrix<N, N, S>& p) {
  using std::abs;
  constexpr S epsilon = std::numeric_limits<S>::epsilon();
  const int n = static_cast<int>(a.rows());
  for (int round = 0; round < 64; ++round) {
    Matrix<N, N, S> w = column_product(g, p), inverse_a = a, inverse_g = g;
    for (int i = 0; i < n; ++i) w(i, i) += S(1);
    if (!solve_square<N, N, S>(w, inverse_a) || !solve_square<N, N, S>(w, inverse_g))
      return Status::not_converged;
    const Matrix<N, N, S> at = transposed<N, N, S>(a);
    const Matrix<N, N, S> growth = symmetrised(column_product(at, column_product(p, inverse_a)));
    g = symmetrised(g + column_product(a, column_product(inverse_g, at)));
    a = column_product(a, inverse_a);
    bool settled = true;
    for (int i = 0; i < n; ++i) {
      settled = settled && growth(i, i) <= S(4) * epsilon * p(i, i);
      for (int j = 0; j < n; ++j) settled = settled && abs(a(i, j)) <= epsilon;
    }
    p += growth;
    if (!all_finite(p) || !all_finite(g) || !all_finite(a)) return Status::not_converged;
    if (settled) return Status::accepted;
  }
  return Status::not_converged;
}

/// Solves x = a x a^T + x0 for the x0 that x holds, in units of `deviation`; false where `a` does not fall to
/// nothing.
template <int N, class S>
[[nodiscard]] bool sum_of_congruences(Matrix<N, N, S> a, const Vector<N, S>& deviation, Matrix<N, N, S>& x) {
  using std::abs;
  const int n = static_cast<int>(a.rows());
  for (int round = 0; round < 64; ++round) {
    x = symmetrised(x + column_product(a, column_product(x, transposed<N, N, S>(a))));
    a = column_product(a, a);
    if (!all_finite(x) || !all_finite(a)) return false;
    bool settled = true;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)  // what has no deviation has no error either
        settled = settled && (!(deviation(i) > S(0)) || abs(a(i, j)) * deviation(j) <=
                                                            std::numeric_limits<S>::epsilon() * deviation(i));
    if (settled) return true;
  }
  return false;
}

/// What a filter whose predicted covariance is result.predicted does at its next measurement.
template <int N, int M, class S>
[[nodiscard]] Status settled_update(const Matrix<M, N, S>& h, const Matrix<M, M, S>& r,
                                    SteadyState<N, M, S>& result) {
  const int n = static_cast<int>(h.cols()), m = static_cast<int>(h.rows());
  ArrayUpdate<N, M, S> update;
  const Status status = update_by_roots<N, M, S>(result.predicted, h, r, Vector<M, S>::Zero(m), update);
  if (status != Status::accepted) return status;
  result.updated = squared_root<N, S>(update.root);
  for (int i = 0; i < n; ++i)  // K = white root_s^-1
    for (int j = m - 1; j >= 0; --j) {
      S sum = update.white(i, j);
      for (int k = j + 1; k < m; ++k) sum -= result.gain(i, k) * update.root_s(k, j);
      result.gain(i, j) = sum / update.root_s(j, j);
    }
  return Status::accepted;
}

/// Whether result.updated means something. P is at best what a last digit more or less of noise at every step
/// makes of it, and a measurement far better than P leaves the difference of two numbers nearly equal: where
/// what remains of those digits after a measurement exceeds a thousandth of `updated`, it is made of them.
template <int N, int M, class S>
[[nodiscard]] bool outlives_rounding(const Matrix<N, N, S>& loop, const Matrix<M, N, S>& h,
                                     const Vector<N, S>& deviation, const SteadyState<N, M, S>& result) {
  const int n = static_cast<int>(h.cols());
  Matrix<N, N, S> lost = Matrix<N, N, S>::Zero(n, n);
  for (int i = 0; i < n; ++i) lost(i, i) = std::numeric_limits<S>::epsilon() * result.predicted(i, i);
  if (!sum_of_congruences<N, S>(loop, deviation, lost)) return false;
  const Matrix<N, N, S> left = Matrix<N, N, S>::Identity(n, n) - column_product(result.gain, h);
  lost = column_product(left, column_product(lost, transposed<N, N, S>(left)));
  for (int i = 0; i < n; ++i)
    if (lost(i, i) > S(1e-3) * result.updated(i, i)) return false;
  return true;
}

/// Newton's method from a P that is nearly right, which result.predicted is.
template <int N, int M, class S>
[[nodiscard]] Status settle(const Matrix<N, N, S>& f, const Matrix<M, N, S>& h, const Matrix<N, N, S>& q,
                            const Matrix<M, M, S>& r, SteadyState<N, M, S>& result) {
  using std::abs;
  using std::cbrt;
  using std::sqrt;
  const int n = static_cast<int>(f.rows());
  const S tolerance = cbrt(std::numeric_limits<S>::epsilon());
  for (int round = 0; round < 8; ++round) {
    const Status status = settled_update(h, r, result);
    if (status != Status::accepted) return status;
    const Matrix<N, N, S> a = f - column_product(Matrix<N, M, S>(column_product(f, result.gain)), h);
    Matrix<N, N, S> x = symmetrised(
        column_product(f, column_product(result.updated, transposed<N, N, S>(f))) + q - result.predicted);
    Vector<N, S> deviation = Vector<N, S>::Zero(n);
    for (int i = 0; i < n; ++i) deviation(i) = sqrt(result.predicted(i, i));
    if (!all_finite(deviation) || !sum_of_congruences<N, S>(a, deviation, x)) return Status::not_converged;
    bool small = true;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) small = small && abs(x(i, j)) <= tolerance * deviation(i) * deviation(j);
    result.predicted += x;
    if (!(round > 0 && small)) continue;
    const Status last = settled_update(h, r, result);
    if (last != Status::accepted) return last;
    return outlives_rounding<N, M, S>(a, h, deviation, result) ? Status::accepted : Status::not_converged;
  }
  return Status::not_converged;
}

}  // namespace detail

/// Steady state of x' = F x + noise(Q), z = H x + noise(R). Refused: not_converged, where no filter settles
/// (a state that does not decay and is not seen, or is not driven), P is not known to a third of the digits,
/// in deviations, or rounding moves `updated` by more than 1e-3; not_positive_definite, where R is not, or Q
/// is no covariance.
template <int N, int M, class S>
[[nodiscard]] SteadyState<N, M, S> steady_state(const Matrix<N, N, S>& f, const Matrix<M, N, S>& h,
                                                const Matrix<N, N, S>& q, const Matrix<M, M, S>& r) {
  const int n = static_cast<int>(f.rows()), m = static_cast<int>(h.rows());
  SteadyState<N, M, S> result{q, q, Matrix<N, M, S>::Zero(n, m)};
  const auto refused = [&](Status status) {
    result.status = status;
    return result;
  };
  if (n == 0 || m == 0 || f.cols() != n || h.cols() != n || q.rows() != n || q.cols() != n || r.rows() != m ||
      r.cols() != m)
    return refused(Status::size_mismatch);
  if (!all_finite(f) || !all_finite(h) || !all_finite(r)) return refused(Status::not_finite);
  const Status noise = detail::check_noise<N, S>(q);
  if (noise != Status::accepted) return refused(noise);
  const Cholesky<M, S> root_r(r);
  if (!root_r.good()) return refused(Status::not_positive_definite);
  Vector<N, S> unit = Vector<N, S>::Ones(n);  // powers of two
  Matrix<N, N, S> a = transposed<N, N, S>(f), g = a, p = q;
  Status status = Status::accepted;
  for (int attempt = 0; attempt < 8; ++attempt) {
    Matrix<M, N, S> scaled_h = h;
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        a(j, i) = f(i, j) / unit(i) * unit(j);
        p(i, j) = q(i, j) / unit(i) / unit(j);
      }
      for (int i = 0; i < m; ++i) scaled_h(i, j) = h(i, j) * unit(j);
    }
    const Matrix<M, N, S> white = root_r.whiten(scaled_h);
    g.setZero();
    add_transposed_product(g, white, white);
    status = detail::riccati_by_doubling<N, S>(a, g, p);
    if (status != Status::accepted) break;
    bool balanced = true;
    for (int i = 0; i < n; ++i)
      for (S variance = p(i, i); variance > S(4) || (variance < S(0.25) && variance > S(0));) {
        const S factor = variance > S(4) ? S(2) : S(0.5);
        unit(i) *= factor;
        variance /= factor * factor;
        balanced = false;
      }
    if (balanced) break;
  }
  if (status != Status::accepted) return refused(status);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) result.predicted(i, j) = p(i, j) * unit(i) * unit(j);
  status = detail::settle<N, M, S>(f, h, q, r, result);
  if (status != Status::accepted) return refused(status);
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
[[nodiscard]] SteadyState<N, M, S> steady_state(const F& f, const H& h, const Q& q, const R& r) {
  const Eigen::Index n = N != dynamic ? N : f.rows();
  const Eigen::Index m = M != dynamic ? M : h.rows();
  bool misfit = false;
  const Matrix<N, N, S> plain_f = detail::plain_matrix<N, N, S>(f, n, n, misfit);
  const Matrix<M, N, S> plain_h = detail::plain_matrix<M, N, S>(h, m, n, misfit);
  const Matrix<N, N, S> plain_q = detail::plain_matrix<N, N, S>(q, n, n, misfit);
  const Matrix<M, M, S> plain_r = detail::plain_matrix<M, M, S>(r, m, m, misfit);
  if (misfit) return {plain_q, plain_q, Matrix<N, M, S>::Zero(n, m), Status::size_mismatch};
  return steady_state(plain_f, plain_h, plain_q, plain_r);
}

}}  // namespace cairn::CAIRN_ABI
