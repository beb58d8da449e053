// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The inner loops of the UD filter: factorisation, Thornton's orthogonalisation and Bierman's recursion.
///
/// All three run along columns of U. Gram-Schmidt by columns needs no sums across a register: the inner
/// products of row j with all rows at once are a sum of scaled columns.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/column_shapes.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/register_column.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// U diag(d) U^T = root root^T for any root, by reflections, last row first.
template <int N, class S>
void ud_of_root(const Matrix<N, N, S>& root, Matrix<N, N, S>& u, Vector<N, S>& d) {
  Matrix<N, N, S> array;
  for (int j = 0; j < N; ++j)
    for (int k = 0; k < N; ++k) array(k, N - 1 - j) = root(j, k);
  triangularise(view(array));
  u.setIdentity();
  for (int j = 0; j < N; ++j) {
    const S deviation = array(N - 1 - j, N - 1 - j);
    d(j) = deviation * deviation;
    for (int i = 0; i < j; ++i) u(i, j) = deviation > S(0) ? array(N - 1 - j, N - 1 - i) / deviation : S(0);
  }
}

/// a = U diag(d) U^T for a covariance that elimination in the given order cannot be trusted with. False where
/// `a` is none.
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool singular_ud_factor(const Matrix<N, N, S>& a, Matrix<N, N, S>& u,
                                                                Vector<N, S>& d) {
  PivotedRoot<N, S> pivoted;
  if (!pivoted_root<N, S>(a, pivoted)) return false;
  ud_of_root<N, S>(pivoted.root, u, d);
  return true;
}

/// a = U diag(d) U^T for a symmetric positive semi-definite a, from the last column on. False where it is
/// none.
template <int N, class S>
[[nodiscard]] bool ud_factor(const Matrix<N, N, S>& a, Matrix<N, N, S>& u, Vector<N, S>& d) {
  Column<N, S> columns[N];
  for (int j = 0; j < N; ++j) columns[j].load(a.data() + j * N);
  u.setIdentity();
  for (int j = N - 1; j >= 0; --j) {
    const S pivot = columns[j][j];
    if (!(pivot > rounding_share<S> * a(j, j)) || !(pivot <= std::numeric_limits<S>::max()))
      return singular_ud_factor<N, S>(a, u, d);
    d(j) = pivot;
    const S inverse = S(1) / pivot;
    for (int i = 0; i < j; ++i) {
      u(i, j) = columns[j][i] * inverse;
      columns[i].subtract(columns[j], u(i, j));
    }
  }
  return true;
}

/// Where the factor U of a structured matrix may hold anything: its pattern above the diagonal, filled in by
/// the elimination.
template <class Q, int N>
[[nodiscard]] consteval auto filled_pattern() {
  std::array<std::array<bool, N>, N> filled{};
  for (const Entry& entry : Q::entries)
    filled[static_cast<std::size_t>(entry.row)][static_cast<std::size_t>(entry.column)] = true;
  for (std::size_t j = N; j-- > 0;)
    for (std::size_t i = 0; i < j; ++i)
      for (std::size_t k = 0; k <= i; ++k) filled[k][i] = filled[k][i] || (filled[k][j] && filled[i][j]);
  return filled;
}

/// ud_factor() for a structured matrix: number by number, without its zeros, in registers. False says no more
/// than that a pivot is rounding, or none: ud_factor() of the dense matrix must look.
template <class Q, int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool ud_factor(const Q& q, Column<N, S> (&u)[N], S (&d)[N]) {
  static constexpr auto filled = filled_pattern<Q, N>();
  constexpr S slack = rounding_share<S>;
  const auto holds = [](int i, int j) __attribute__((always_inline)) {
    return filled[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  };
  S a[N][N]{};  // a[j][i] = Q(i, j) on and above the diagonal
  unrolled<Q::entries.size()>([&](auto e) __attribute__((always_inline)) {
    constexpr Entry entry = Q::entries[e];
    if constexpr (entry.row <= entry.column) a[entry.column][entry.row] = q.template value<e>();
  });
  S original[N];
  each<N>([&](int j) { original[j] = a[j][j]; });
  bool good = true;
  each<N>([&](int back) __attribute__((always_inline)) {
    const int j = N - 1 - back;
    const S pivot = a[j][j];
    const bool regular = pivot > slack * original[j];
    d[j] = regular ? pivot : S(0);
    const S inverse = regular ? S(1) / pivot : S(0);
    S column[N]{};
    column[j] = S(1);
    each<N>(0, j, [&](int i) {
      if (holds(i, j)) column[i] = a[j][i] * inverse;
    });
    if (!regular) [[unlikely]] {  // a state without noise: nothing stands above its pivot
      good = good && pivot == S(0);
      each<N>(0, j, [&](int i) { good = good && (!holds(i, j) || a[j][i] == S(0)); });
    }
    each<N>(0, j, [&](int i) __attribute__((always_inline)) {
      each<N>(0, i + 1, [&](int k) {
        if (holds(i, j) && holds(k, j)) a[i][k] -= column[i] * a[j][k];
      });
    });
    u[j].gather(column);
  });
  return good;
}

/// Column j of a unit upper triangular matrix: `above` before row j, 1 there, 0 after.
template <int N, class S>
[[gnu::always_inline]] inline void cut_below(Column<N, S>& above, int j) {
  each<Column<N, S>::count>([&](int k) {
    constexpr int width = Column<N, S>::width;
    if constexpr (width == 1)
      above.lanes[k] = k < j ? above.lanes[k] : S(k == j ? 1 : 0);
    else {
      const auto row = lane_numbers<S, width>() + S(k * width);
      above.lanes[k] =
          row < S(j) ? above.lanes[k]
                     : (row == S(j) ? typename Column<N, S>::Lane{} + S(1) : typename Column<N, S>::Lane{});
    }
  });
}

/// U and D with U D U^T = sum d_k w_k w_k^T (Thornton), the w_k given as columns; of the second N columns,
/// number N + k is zero below row k, and where Triangular so is column k of the first N. Those never take
/// part before row k's turn.
template <bool Triangular, int N, class S>
[[gnu::always_inline]] inline void weighted_gram_schmidt(Column<N, S> (&w)[2 * N], const S (&weights)[2 * N],
                                                         Column<N, S> (&u)[N], Column<N, S>& d) {
  constexpr int width = Column<N, S>::width;
  S diagonal[N];
  each<N>([&](int back) __attribute__((always_inline)) {
    const int j = N - 1 - back;
    const int top = j / width + 1;  // registers that hold rows up to j
    const int first = Triangular ? j : 0;
    Column<N, S> products;
    products.set_zero();
    const auto accumulate = [&](int k) __attribute__((always_inline)) {
      const S factor = weights[k] * w[k][j];
      for (int lane = 0; lane < top; ++lane) products.lanes[lane] += w[k].lanes[lane] * factor;
    };
    each<N>(first, N, accumulate);
    each<N>(j, N, [&](int k) __attribute__((always_inline)) { accumulate(N + k); });
    const S length = products[j];
    diagonal[j] = length;
    u[j].set_zero();
    if (length > S(0)) [[likely]] {
      products.scale(S(1) / length);
      for (int lane = 0; lane < top; ++lane) u[j].lanes[lane] = products.lanes[lane];
      const auto reduce = [&](int k) __attribute__((always_inline)) {
        const S factor = w[k][j];
        for (int lane = 0; lane < top; ++lane) w[k].lanes[lane] -= products.lanes[lane] * factor;
      };
      each<N>(first, N, reduce);
      each<N>(j, N, [&](int k) __attribute__((always_inline)) { reduce(N + k); });
    }
    cut_below(u[j], j);
  });
  d.load(diagonal);
}

/// One scalar measurement (Bierman): f = U^T h and the noise variance r > 0 are given; gain = P h (unscaled).
/// Returns the innovation variance. f is that of the old U, so that all divisions are done side by side.
template <int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline S bierman(Column<N, S> (&u)[N], Column<N, S>& d,
                                                      const Column<N, S>& f, const S& r, Column<N, S>& gain) {
  constexpr int width = Column<N, S>::width;
  constexpr int count = Column<N, S>::count;
  Column<N, S> v = d;
  each<count>([&](int k) { v.lanes[k] *= f.lanes[k]; });
  S before[N], after[N];
  S alpha = r;
  each<N>([&](int j) {
    before[j] = alpha;
    alpha += f[j] * v[j];
    after[j] = alpha;
  });
  Column<N, S> old_alpha, new_alpha, lambda;
  old_alpha.gather(before);
  new_alpha.gather(after);
  each<count>([&](int k) {
    lambda.lanes[k] = f.lanes[k] / old_alpha.lanes[k];
    d.lanes[k] *= old_alpha.lanes[k] / new_alpha.lanes[k];
  });
  gain.set_zero();
  each<N>([&](int j) {
    for (int lane = 0; lane <= j / width; ++lane) {
      const auto old = u[j].lanes[lane];
      u[j].lanes[lane] -= gain.lanes[lane] * lambda[j];
      gain.lanes[lane] += old * v[j];
    }
  });
  return alpha;
}

/// The same for any r >= 0, number by number.
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] S bierman_without_noise(Column<N, S> (&columns)[N], Column<N, S>& d,
                                                                const Column<N, S>& f, const S& r,
                                                                Column<N, S>& gain) {
  S u[N][N], b[N]{}, diagonal[N];
  for (int j = 0; j < N; ++j)
    for (int i = 0; i < N; ++i) u[j][i] = columns[j][i];
  S alpha = r;
  for (int j = 0; j < N; ++j) {
    const S v = d[j] * f[j];
    const S before = alpha;
    alpha += f[j] * v;
    b[j] = v;
    diagonal[j] = before > S(0) ? d[j] * (before / alpha) : (alpha > S(0) ? S(0) : d[j]);
    for (int i = 0; i < j; ++i) {
      const S old = u[j][i];
      if (before > S(0)) u[j][i] -= b[i] * (f[j] / before);  // else nothing was seen yet: U keeps its column
      b[i] += old * v;
    }
  }
  for (int j = 0; j < N; ++j) columns[j].load(u[j]);
  d.load(diagonal);
  gain.load(b);
  return alpha;
}

}}}  // namespace cairn::CAIRN_ABI::detail
