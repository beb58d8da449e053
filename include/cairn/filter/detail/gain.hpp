// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a measurement does to a state, for sizes known at compile time: S = L D L^T, and the columns W with
/// P H^T S^-1 H P = W W^T. Every Gaussian filter that keeps P itself ends here.
#pragma once

#include <cmath>
#include <limits>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/register_column.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// L D L^T of `a` into unit lower L and D^-1/2. False where a pivot is not positive and finite. `loss` is by
/// how much the smallest share of a diagonal element that is left for its pivot multiplies rounding: 1 or
/// above. Divisions stay on the critical path, roots do not.
template <int M, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool factor(const Matrix<M, M, S>& a, S (&lower)[M][M],
                                                        S (&inverse_root)[M], S& loss) {
  using std::sqrt;
  S sum(0);  // of the D^-1/2: no number where a pivot is none or negative, infinite where one is zero
  S least(1);
  S raw[M][M];
  each<M>([&](int i)
              __attribute__((always_inline)) { each<M>(0, i + 1, [&](int j) { raw[i][j] = a(i, j); }); });
  loss = S(1);
  each<M>([&](int j) __attribute__((always_inline)) {
    const S inverse = S(1) / raw[j][j];
    inverse_root[j] = sqrt(inverse);
    sum += inverse_root[j];
    least = lesser(least, inverse_root[j]);
    if (j > 0) {  // the first pivot is its diagonal element
      const S share = inverse * a(j, j);
      loss = share > loss ? share : loss;
    }
    each<M>(j + 1, M, [&](int i) { lower[i][j] = raw[i][j] * inverse; });
    each<M>(j + 1, M, [&](int i) __attribute__((always_inline)) {
      each<M>(j + 1, i + 1, [&](int k) { raw[i][k] -= lower[i][j] * raw[k][j]; });
    });
  });
  return (sum <= std::numeric_limits<S>::max()) & (least > S(0));
}

/// What M measured numbers do to N states: with S = H P H^T + R = L D L^T,
///   w[m] = column m of P H^T L^-T D^-1/2,   so that   P H^T S^-1 H P = sum w w^T   and   K r = sum w y(r).
template <int N, int M, class S>
struct Correction {
  Column<N, S> w[M];
  S lower[M][M];
  S inverse_root[M];
  S loss;  ///< see factor()

  /// From S and the columns of P H^T (the cross-covariance). False where factor() is.
  [[gnu::always_inline]] [[nodiscard]] bool fill(const Matrix<M, M, S>& covariance,
                                                 Column<N, S> (&cross)[M]) {
    const bool good = factor(covariance, lower, inverse_root, loss);
    each<M>([&](int j) __attribute__((always_inline)) {
      each<M>(0, j, [&](int k) { cross[j].subtract(cross[k], lower[j][k]); });
      w[j] = cross[j];
      w[j].scale(inverse_root[j]);
    });
    return good;
  }

  /// Moves `step` by K r and returns r^T S^-1 r.
  [[gnu::always_inline]] S take(const S* r, Column<N, S>& step) const {
    S y[M];
    whiten(r, y);
    S nis(0);
    step.set_zero();
    each<M>([&](int m) {
      nis += y[m] * y[m];
      step.add(w[m], y[m]);
    });
    return nis;
  }

  /// Residual in units of its standard deviations, independent of one another: y = D^-1/2 L^-1 r.
  [[gnu::always_inline]] void whiten(const S* r, S* y) const {
    S raw[M];
    each<M>([&](int j) __attribute__((always_inline)) {
      raw[j] = r[j];
      each<M>(0, j, [&](int k) { raw[j] -= lower[j][k] * raw[k]; });
    });
    each<M>([&](int j) { y[j] = raw[j] * inverse_root[j]; });
  }
};

/// Fills `covariance` = H P H^T + R and the correction. False where factor() of it is.
template <class H, int N, int M, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool correction(const Column<N, S> (&p)[N], const H& h,
                                                            const Matrix<M, M, S>& r,
                                                            Matrix<M, M, S>& covariance,
                                                            Correction<N, M, S>& result) {
  Column<N, S> ph[M];
  combine(h, p, ph);
  symmetric_product(h, ph, r, covariance);
  return result.fill(covariance, ph);
}

/// p -= sum w w^T, symmetric bit for bit where p is.
template <int N, int M, class S>
[[gnu::always_inline]] inline void lower_by_squares(Column<N, S> (&p)[N], const Column<N, S> (&w)[M]) {
  each<N>([&](int j) { each<M>([&](int m) { p[j].subtract(w[m], w[m][j]); }); });
}

}}}  // namespace cairn::CAIRN_ABI::detail
