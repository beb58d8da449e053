// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The UD filter: P = U D U^T with unit upper triangular U and diagonal D, without a square root anywhere.
///
///   predict   Thornton's weighted Gram-Schmidt on [F U, U_q] with weights (D, D_q)
///   update    Bierman's recursion, one number of the measurement after the other
/// (G. Bierman, "Factorization Methods for Discrete Sequential Estimation", 1977, chapters V and VI.) The
/// most accurate of the forms here, in float as in double, and the cheapest of the factored ones.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/correct.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kernels.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// Truth = retract(mean, d), d ~ N(0, U diag(D) U^T). Sizes are fixed at compile time.
template <Manifold X>
struct UDGaussian {
  using State = X;
  using Scalar = ScalarOf<X>;
  static_assert(dof<X> != dynamic, "the UD form is for states of fixed size");

  X mean;
  CovarianceOf<X> upper;  ///< U: ones on the diagonal, zeros below
  Tangent<X> diagonal;    ///< D >= 0

  [[nodiscard]] static UDGaussian from(const Gaussian<X>& belief);
  [[nodiscard]] CovarianceOf<X> covariance() const {
    const CovarianceOf<X> scaled = upper * diagonal.asDiagonal();
    return symmetrised(scaled * upper.transpose());
  }
  [[nodiscard]] Gaussian<X> gaussian() const { return {mean, covariance()}; }
};

namespace detail {

/// a = U diag(d) U^T for a symmetric positive semi-definite a, from the last column on. False where a pivot
/// is negative beyond rounding, or not finite.
template <int N, class S>
[[nodiscard]] bool ud_factor(const Matrix<N, N, S>& a, Matrix<N, N, S>& u, Vector<N, S>& d) {
  constexpr S slack = S(64) * std::numeric_limits<S>::epsilon();
  Column<N, S> columns[N];
  for (int j = 0; j < N; ++j) columns[j].load(a.data() + j * N);
  u.setIdentity();
  for (int j = N - 1; j >= 0; --j) {
    const S pivot = columns[j][j];
    const bool regular = pivot > slack * a(j, j);
    if (!regular && !(pivot >= -slack * a(j, j) && a(j, j) < std::numeric_limits<S>::infinity()))
      return false;
    d(j) = regular ? pivot : S(0);
    if (!regular) continue;
    const S inverse = S(1) / pivot;
    for (int i = 0; i < j; ++i) {
      u(i, j) = columns[j][i] * inverse;
      columns[i].subtract(columns[j], u(i, j));
    }
  }
  return true;
}

template <int K, class S>
[[gnu::always_inline]] inline S dot(const Column<K, S>& a, const Column<K, S>& b) {
  typename Column<K, S>::Lane sum = a.lanes[0] * b.lanes[0];
  for (int k = 1; k < Column<K, S>::count; ++k) sum += a.lanes[k] * b.lanes[k];
  if constexpr (Column<K, S>::width == 1) {
    return sum;
  } else {
    S total(0);
    for (int k = 0; k < Column<K, S>::width; ++k) total += sum[k];
    return total;
  }
}

/// Rows w and weights d become U and D with U D U^T = sum d_k w_k w_k^T (Thornton).
template <int N, int K, class S>
void weighted_gram_schmidt(Column<K, S> (&rows)[N], const Column<K, S>& weights, Matrix<N, N, S>& u,
                           Vector<N, S>& d) {
  u.setIdentity();
  for (int j = N - 1; j >= 0; --j) {
    Column<K, S> weighted = rows[j];
    for (int k = 0; k < Column<K, S>::count; ++k) weighted.lanes[k] *= weights.lanes[k];
    const S length = dot(rows[j], weighted);
    d(j) = length;
    if (!(length > S(0))) continue;
    const S inverse = S(1) / length;
    for (int i = 0; i < j; ++i) {
      const S factor = dot(rows[i], weighted) * inverse;
      u(i, j) = factor;
      rows[i].subtract(rows[j], factor);
    }
  }
}

/// One scalar measurement with row h and noise variance r (Bierman). gain = P h (unscaled); returns the
/// innovation variance.
template <int N, class S>
[[nodiscard]] S bierman(Matrix<N, N, S>& u, Vector<N, S>& d, const Vector<N, S>& h, const S& r,
                        Vector<N, S>& gain) {
  S alpha = r;
  for (int j = 0; j < N; ++j) {
    S f = h(j);
    for (int i = 0; i < j; ++i) f += u(i, j) * h(i);
    const S v = d(j) * f;
    const S before = alpha;
    alpha += f * v;
    gain(j) = v;
    if (!(before > S(0))) {  // r = 0 and nothing seen yet: U keeps its column
      if (alpha > S(0)) d(j) = S(0);
      for (int i = 0; i < j; ++i) gain(i) += u(i, j) * v;
      continue;
    }
    d(j) *= before / alpha;
    const S lambda = -f / before;
    for (int i = 0; i < j; ++i) {
      const S old = u(i, j);
      u(i, j) += gain(i) * lambda;
      gain(i) += old * v;
    }
  }
  return alpha;
}

}  // namespace detail

template <Manifold X>
UDGaussian<X> UDGaussian<X>::from(const Gaussian<X>& belief) {
  UDGaussian result{belief.mean, {}, Tangent<X>::Zero()};
  if (!detail::ud_factor<dof<X>, Scalar>(belief.covariance, result.upper, result.diagonal))
    raise("UDGaussian: the covariance is not finite and positive semi-definite");
  return result;
}

/// Kalman and extended Kalman filter in UD form. Options only.
struct UDFilter {
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0

  template <LinearisedProcess F>
  Status predict(UDGaussian<typename F::State>& belief, const F& process, const typename F::Control& control,
                 double dt) const {
    using X = typename F::State;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    CovarianceOf<X> upper_q;
    Tangent<X> d_q = Tangent<X>::Zero();
    const CovarianceOf<X> q = process.noise(belief.mean, control, dt);
    if (!detail::ud_factor<n, S>(q, upper_q, d_q))
      return detail::all_finite(q) ? Status::not_positive_definite : Status::not_finite;
    const CovarianceOf<X> fu = product(process.jacobian(belief.mean, control, dt), belief.upper);
    detail::Column<2 * n, S> rows[n];
    detail::Column<2 * n, S> weights;
    S buffer[2 * n];
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < n; ++k) {
        buffer[k] = fu(i, k);
        buffer[n + k] = upper_q(i, k);
      }
      rows[i].load(buffer);
    }
    for (int k = 0; k < n; ++k) {
      buffer[k] = belief.diagonal(k);
      buffer[n + k] = d_q(k);
    }
    weights.load(buffer);
    UDGaussian<X> next{process.propagate(belief.mean, control, dt), {}, {}};
    detail::weighted_gram_schmidt<n, 2 * n, S>(rows, weights, next.upper, next.diagonal);
    if (!detail::all_finite(next.upper) || !detail::all_finite(next.diagonal) ||
        !detail::finite_state(next.mean))
      return Status::not_finite;
    belief = next;
    return Status::accepted;
  }
  template <LinearisedProcess F>
    requires std::same_as<typename F::Control, NoControl>
  Status predict(UDGaussian<typename F::State>& belief, const F& process, double dt) const {
    return predict(belief, process, NoControl{}, dt);
  }

  template <LinearisedMeasurement H>
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      UDGaussian<typename H::State>& belief, const H& sensor, const typename H::Measurement& z) const {
    using X = typename H::State;
    using Z = typename H::Measurement;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    constexpr int m = dof<Z>;
    const Matrix<m, m, S> r = sensor.noise(belief.mean);
    Matrix<m, n, S> h = detail::dense_of(sensor.jacobian(belief.mean));
    Vector<m, S> left = local(Z(sensor.predict(belief.mean)), z);
    Innovation<m, S> in = detail::fresh_innovation<m, S>(left, r);
    const Matrix<n, m, S> hu = (h * belief.upper).transpose();
    in.covariance += symmetrised(hu.transpose() * belief.diagonal.asDiagonal() * hu);
    Matrix<m, m, S> upper_r;
    Vector<m, S> d_r = Vector<m, S>::Zero();
    if (!detail::ud_factor<m, S>(r, upper_r, d_r)) {
      in.status = detail::all_finite(r) ? Status::not_positive_definite : Status::not_finite;
      return in;
    }
    UDGaussian<X> next = belief;
    Vector<n, S> step = Vector<n, S>::Zero();
    Vector<n, S> gain;
    bool regular = true;
    for (int j = m - 1; j >= 0; --j) {  // U_r^-1 makes the numbers independent, last one first
      for (int k = j + 1; k < m; ++k) {
        h.row(j) -= upper_r(j, k) * h.row(k);
        left(j) -= upper_r(j, k) * left(k);
      }
      const Vector<n, S> row = h.row(j).transpose();
      const S variance = detail::bierman<n, S>(next.upper, next.diagonal, row, d_r(j), gain);
      regular = regular && variance > S(0);
      const S error = left(j) - row.dot(step);
      step += gain * (error / variance);
      in.nis += error * error / variance;
    }
    in.status = verdict(in, regular, next, step);
    if (in.status == Status::accepted) {
      next.mean = retract(belief.mean, step);
      belief = next;
    }
    return in;
  }

private:
  template <int M, class S, Manifold X>
  Status verdict(const Innovation<M, S>& in, bool regular, const UDGaussian<X>& next,
                 const Tangent<X>& step) const {
    if (!(gate > 0.0)) return Status::bad_option;
    if (!detail::all_finite(in.residual) || !detail::all_finite(in.covariance) ||
        !detail::finite_state(next.mean))
      return Status::not_finite;
    if (!regular || !detail::all_finite(step) || !detail::all_finite(next.upper) ||
        !detail::all_finite(next.diagonal))
      return Status::not_positive_definite;
    return in.nis <= static_cast<S>(gate) ? Status::accepted : Status::gated;
  }

  template <class A, int N, class S>
  [[nodiscard]] static Matrix<N, N, S> product(const A& f, const Matrix<N, N, S>& u) {
    if constexpr (detail::is_structured<A>) {
      Matrix<N, N, S> fu = Matrix<N, N, S>::Zero();
      detail::unrolled<A::entries.size()>([&](auto e) {
        constexpr detail::Entry entry = A::entries[e];
        for (int k = entry.column; k < N; ++k) fu(entry.row, k) += f.template value<e>() * u(entry.column, k);
      });
      return fu;
    } else {
      return f * u;
    }
  }
};

}  // namespace cairn::inline CAIRN_ABI
