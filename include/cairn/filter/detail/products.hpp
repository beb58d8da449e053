// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The inner loops of the Gaussian filters, for matrices of a size known at compile time.
///
/// Below about 30 states general products lose most of their time in loads and loop ends. Here a column is a
/// few SIMD registers, padded with zeros, and every product is a sum of scaled columns; a covariance is its
/// own transpose, so its rows are columns too. Three habits keep it a covariance: results are symmetric bit
/// for bit, P is lowered by squares (W W^T) and never by unsymmetric products, and is_covariance() looks.
/// Run-time sizes go through Eigen (update.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/column_shapes.hpp>
#include <cairn/filter/detail/register_column.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// to[i] = row i of `a` times the matrix whose *rows* are given: sums of scaled columns.
template <class A, int N, int R, int C, class S>
[[gnu::always_inline]] inline void combine(const A& a, const Column<N, S> (&rows)[C], Column<N, S> (&to)[R]) {
  if constexpr (is_structured<A>) {
    each<R>([&](int i) { to[i].set_zero(); });
    unrolled<A::entries.size()>([&](auto e) {
      constexpr Entry entry = A::entries[e];
      constexpr bool first = e == 0 || A::entries[e == 0 ? 0 : e - 1].row != entry.row;
      if constexpr (first) to[entry.row] = rows[entry.column];
      if constexpr (first && entry.slot >= 0) to[entry.row].scale(a.template value<e>());
      if constexpr (!first && entry.slot < 0) to[entry.row].add(rows[entry.column]);
      if constexpr (!first && entry.slot >= 0) to[entry.row].add(rows[entry.column], a.template value<e>());
    });
  } else {
    each<R>([&](int i) {
      to[i] = rows[0];
      to[i].scale(a(i, 0));
      each<C>(1, C, [&](int k) { to[i].add(rows[k], a(i, k)); });
    });
  }
}

template <int N, class S>
[[gnu::always_inline]] inline void mirror_lower(Matrix<N, N, S>& a) {
  for (int j = 0; j < N; ++j)
    for (int i = j + 1; i < N; ++i) a(j, i) = a(i, j);
}

/// out = q + A U for U whose column j is u[j], where that is symmetric and small (a measurement's S): the
/// lower triangle number by number, mirrored.
template <class A, int N, int R, class S>
[[gnu::always_inline]] inline void symmetric_product(const A& a, const Column<N, S> (&u)[R],
                                                     const Matrix<R, R, S>& q, Matrix<R, R, S>& out) {
  if constexpr (is_structured<A>) {
    unrolled<static_cast<std::size_t>(R)>([&](auto row) __attribute__((always_inline)) {
      constexpr int i = static_cast<int>(row);
      each<R>(0, i + 1, [&](int j) {
        S sum = q(i, j);
        unrolled<A::entries.size()>([&](auto e) __attribute__((always_inline)) {
          constexpr Entry entry = A::entries[e];
          if constexpr (entry.row == i && entry.slot < 0) sum += u[j][entry.column];
          if constexpr (entry.row == i && entry.slot >= 0) sum += u[j][entry.column] * a.template value<e>();
        });
        out(i, j) = sum;
        out(j, i) = sum;
      });
    });
  } else {
    Column<R, S> of_a[N];
    for (int k = 0; k < N; ++k) of_a[k].load(a.data() + k * R);
    for (int j = 0; j < R; ++j) {
      Column<R, S> sum;
      sum.load(q.data() + j * R);
      for (int k = 0; k < N; ++k) sum.add(of_a[k], u[j][k]);
      sum.store(out.data() + j * R);
    }
    mirror_lower(out);
  }
}

/// The columns of a square matrix, structured or not.
template <int N, class Q, class S>
[[gnu::always_inline]] inline void load_columns(const Q& q, Column<N, S> (&columns)[N]) {
  if constexpr (is_structured<Q>) {
    unrolled<static_cast<std::size_t>(N)>([&](auto j) __attribute__((always_inline)) {
      columns[j] = column_of<static_cast<int>(j), false>(q);
    });
  } else {
    each<N>([&](int j) { columns[j].load(q.data() + j * N); });
  }
}

/// Which registers of a column of a structured matrix hold anything beyond the ones of the diagonal.
template <class A, int Width>
[[nodiscard]] constexpr bool holds_entries(int column, int lane) {
  for (const Entry& entry : A::entries)
    if (entry.column == column && entry.row / Width == lane && (entry.row != entry.column || entry.slot >= 0))
      return true;
  return false;
}

/// Row i of A has a '1' on the diagonal for every i: most transitions are I + something.
template <class A>
[[nodiscard]] constexpr bool unit_diagonal() {
  int ones = 0;
  for (const Entry& entry : A::entries) ones += entry.row == entry.column && entry.slot < 0 ? 1 : 0;
  return ones == A::row_count && ones == A::column_count;
}

/// No entry of A below its diagonal.
template <class A>
[[nodiscard]] constexpr bool upper_triangular() {
  if constexpr (is_structured<A>) {
    for (const Entry& entry : A::entries)
      if (entry.row > entry.column) return false;
    return true;
  } else {
    return false;
  }
}

/// Rows of column j that a product is wanted for; the other rows are left with anything.
enum class ProductRows { lower, all };

/// sum[j] += A u[j] for square A. The columns of a structured A stay in registers and those that are empty
/// are never multiplied.
template <ProductRows Wanted, class A, int N, class S>
[[gnu::always_inline]] inline void add_product(const A& a, const Column<N, S> (&u)[N],
                                               Column<N, S> (&sum)[N]) {
  constexpr int width = Column<N, S>::width;
  constexpr int count = Column<N, S>::count;
  Column<N, S> of_a[N];
  if constexpr (is_structured<A>) {
    constexpr bool unit = unit_diagonal<A>();
    unrolled<static_cast<std::size_t>(N)>([&](auto column) __attribute__((always_inline)) {
      of_a[column] = column_of<static_cast<int>(column), unit>(a);
    });
    each<N>([&](int j) __attribute__((always_inline)) {
      if constexpr (unit) sum[j].add(u[j]);
      unrolled<static_cast<std::size_t>(N * count)>([&](auto pair) __attribute__((always_inline)) {
        constexpr int k = static_cast<int>(pair) / count;
        constexpr int lane = static_cast<int>(pair) % count;
        if constexpr (holds_entries<A, width>(k, lane) || (!unit && k / width == lane)) {
          if (Wanted == ProductRows::all || lane >= j / width)
            sum[j].lanes[lane] += of_a[k].lanes[lane] * u[j][k];
        }
      });
    });
  } else {
    load_columns(a, of_a);
    each<N>([&](int j) {
      each<N>([&](int k) {
        for (int lane = Wanted == ProductRows::all ? 0 : j / width; lane < count; ++lane)
          sum[j].lanes[lane] += of_a[k].lanes[lane] * u[j][k];
      });
    });
  }
}

/// p += value I.
template <int N, class S>
[[gnu::always_inline]] inline void add_to_diagonal(Column<N, S> (&p)[N], const S& value) {
  each<N>([&](int j) {
    S numbers[N]{};
    numbers[j] = value;
    Column<N, S> column;
    column.gather(numbers);
    p[j].add(column);
  });
}

/// out = A P A^T + Q for square A, symmetric P and Q, symmetric bit for bit.
template <class A, int N, class S, class Q>
[[gnu::always_inline]] inline void congruence(const A& a, const Column<N, S> (&p)[N], const Q& q,
                                              Column<N, S> (&out)[N]) {
  Column<N, S> u[N];  // u[i] = P a_i
  combine(a, p, u);
  load_columns(q, out);
  if constexpr (is_identity<A>) {
    each<N>([&](int j) { out[j].add(u[j]); });
  } else {
    add_product<ProductRows::lower>(a, u, out);
    mirror_lower(out);
  }
}

/// Where the triangular factor of a symmetric structured matrix may hold anything: its pattern on and below
/// the diagonal, filled in by the elimination of its first columns.
template <class Q, int N>
[[nodiscard]] consteval auto filled_below() {
  std::array<std::array<bool, N>, N> filled{};
  for (const Entry& entry : Q::entries)
    filled[static_cast<std::size_t>(entry.row)][static_cast<std::size_t>(entry.column)] = true;
  for (std::size_t j = 0; j < N; ++j)
    for (std::size_t i = j + 1; i < N; ++i)
      for (std::size_t k = j + 1; k <= i; ++k) filled[i][k] = filled[i][k] || (filled[i][j] && filled[k][j]);
  return filled;
}

/// No row of a symmetric pattern has more than one entry beside the diagonal: a covariance of single numbers
/// and of pairs, as of positions with their velocities.
template <class Q>
  requires(is_structured<Q>)
[[nodiscard]] consteval bool in_pairs() {
  std::array<int, static_cast<std::size_t>(Q::row_count)> beside{};
  for (const Entry& entry : Q::entries)
    if (entry.row != entry.column && ++beside[static_cast<std::size_t>(entry.row)] > 1) return false;
  return true;
}

template <class Q>
[[nodiscard]] consteval bool in_pairs() {
  return false;
}

/// Such a matrix is a covariance, up to the rounding of its diagonal: q_ij^2 <= q_ii q_jj. False says
/// nothing.
template <class Q>
[[gnu::always_inline]] [[nodiscard]] inline bool covaries_in_pairs(const Q& q) {
  using S = typename Q::Scalar;
  S diagonal[static_cast<std::size_t>(Q::row_count)]{};
  bool good = true;
  unrolled<Q::entries.size()>([&](auto e) __attribute__((always_inline)) {
    constexpr Entry entry = Q::entries[e];
    if constexpr (entry.row == entry.column) {
      diagonal[entry.row] = q.template value<e>();
      good = good && diagonal[entry.row] >= S(0);
    }
  });
  unrolled<Q::entries.size()>([&](auto e) __attribute__((always_inline)) {
    constexpr Entry entry = Q::entries[e];
    if constexpr (entry.row > entry.column) {
      const S beside = q.template value<e>();
      const S most = diagonal[entry.row] * diagonal[entry.column] * (S(1) + rounding_share<S>);
      const bool in_range = most >= std::numeric_limits<S>::min() && most <= std::numeric_limits<S>::max();
      good = good && ((in_range && beside * beside <= most) || beside == S(0));
    }
  });
  return good;
}

/// Elimination of a symmetric structured matrix meets pivots alone that are well above rounding, or zeros in
/// a column of zeros: it is a covariance. False says nothing. Number by number, without its zeros.
template <class Q>
[[gnu::always_inline]] [[nodiscard]] inline bool eliminates(const Q& q) {
  using S = typename Q::Scalar;
  constexpr int n = Q::row_count;
  [[maybe_unused]] static constexpr auto filled = filled_below<Q, n>();
  S a[n][n]{};  // a[j][i] = Q(i, j) on and below the diagonal
  unrolled<Q::entries.size()>([&](auto e) __attribute__((always_inline)) {
    constexpr Entry entry = Q::entries[e];
    if constexpr (entry.row >= entry.column) a[entry.column][entry.row] = q.template value<e>();
  });
  S least[n];
  each<n>([&](int j) { least[j] = rounding_share<S> * a[j][j]; });
  bool good = true;
  unrolled<static_cast<std::size_t>(n)>([&](auto column) __attribute__((always_inline)) {
    constexpr std::size_t j = column;
    bool alone = true;  // nothing below the diagonal
    unrolled<static_cast<std::size_t>(n)>([&](auto row) __attribute__((always_inline)) {
      if constexpr (row > j && filled[row][j]) alone = alone && a[j][row] == S(0);
    });
    const bool regular = a[j][j] > least[j];
    good = good && (regular || (a[j][j] == S(0) && alone));
    const S inverse = regular ? S(1) / a[j][j] : S(0);
    unrolled<static_cast<std::size_t>(n)>([&](auto row) __attribute__((always_inline)) {
      if constexpr (row > j && filled[row][j]) {
        const S factor = a[j][row] * inverse;
        unrolled<static_cast<std::size_t>(n)>([&](auto k) __attribute__((always_inline)) {
          if constexpr (k > j && k <= row && filled[k][j]) a[k][row] -= factor * a[j][k];
        });
      }
    });
  });
  return good;
}

/// cairn::product() for matrices of states, column by column in registers.
template <int R, int C, int K, class S>
[[nodiscard]] Matrix<R, K, S> column_product(const Matrix<R, C, S>& a, const Matrix<C, K, S>& b) {
  if constexpr (R == dynamic || C == dynamic || K == dynamic) {
    return product(a, b);
  } else {
    Matrix<R, K, S> out;
    for (int k = 0; k < K; ++k) {
      Column<R, S> sum, column;
      sum.set_zero();
      for (int j = 0; j < C; ++j) {
        column.load(a.data() + j * R);
        sum.add(column, b(j, k));
      }
      sum.store(out.data() + k * R);
    }
    return out;
  }
}

/// A P A^T + Q for symmetric P and Q, symmetric bit for bit. A is R x C.
template <class A, int C, int R, class S>
[[nodiscard]] Matrix<R, R, S> congruence(const A& a, const Matrix<C, C, S>& p, const Matrix<R, R, S>& q) {
  Column<C, S> columns[C];
  for (int j = 0; j < C; ++j) columns[j].load(p.data() + j * C);
  Column<C, S> u[R];  // u[i] = P a_i
  combine(a, columns, u);
  Matrix<R, R, S> out;
  symmetric_product(a, u, q, out);
  return out;
}

}}}  // namespace cairn::CAIRN_ABI::detail
