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
/// Run-time sizes go through Eigen (correct.hpp).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/structure.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI::detail {

/// Widest SIMD register of the target that N numbers can use, in bytes.
template <int N, class S>
inline constexpr int lane_bytes =
#if defined(__AVX512F__)
    N * sizeof(S) > 32 ? 64 :
#endif
#if defined(__AVX__)
    N * sizeof(S) > 16 ? 32
                       :
#endif
                       16;

template <class S, int Bytes>
struct LaneOf {
  using type = S;
};
template <int Bytes>
struct LaneOf<double, Bytes> {
  typedef double type __attribute__((vector_size(Bytes), may_alias));
};
template <int Bytes>
struct LaneOf<float, Bytes> {
  typedef float type __attribute__((vector_size(Bytes), may_alias));
};

/// N numbers in SIMD registers. Lanes beyond N hold zero after load() and are never read.
template <int N, class S>
struct Column {
  using Lane = typename LaneOf<S, lane_bytes<N, S>>::type;
  static constexpr int width = static_cast<int>(sizeof(Lane) / sizeof(S));
  static constexpr int count = (N + width - 1) / width;
  Lane lanes[static_cast<std::size_t>(count)];

  [[gnu::always_inline]] void set_zero() {
    for (int k = 0; k < count; ++k) lanes[k] = Lane{};
  }
  [[gnu::always_inline]] void load(const S* from) {
    if constexpr (width == 1) {
      for (int i = 0; i < N; ++i) lanes[i] = from[i];
    } else {
      constexpr int whole = N / width;
      for (int k = 0; k < whole; ++k) std::memcpy(&lanes[k], from + k * width, sizeof(Lane));
      if constexpr (whole < count) {
        lanes[whole] = Lane{};
        std::memcpy(&lanes[whole], from + whole * width, sizeof(S) * static_cast<std::size_t>(N % width));
      }
    }
  }
  [[gnu::always_inline]] void store(S* to) const {
    if constexpr (width == 1) {
      for (int i = 0; i < N; ++i) to[i] = lanes[i];
    } else {
      std::memcpy(to, lanes, sizeof(S) * static_cast<std::size_t>(N));
    }
  }
  [[gnu::always_inline]] const S& operator[](int i) const { return reinterpret_cast<const S*>(lanes)[i]; }
  [[gnu::always_inline]] void add(const Column& other) {
    for (int k = 0; k < count; ++k) lanes[k] += other.lanes[k];
  }
  [[gnu::always_inline]] void add(const Column& other, const S& factor) {
    for (int k = 0; k < count; ++k) lanes[k] += other.lanes[k] * factor;
  }
  [[gnu::always_inline]] void subtract(const Column& other, const S& factor) {
    for (int k = 0; k < count; ++k) lanes[k] -= other.lanes[k] * factor;
  }
  [[gnu::always_inline]] void scale(const S& factor) {
    for (int k = 0; k < count; ++k) lanes[k] *= factor;
  }
};

/// to[i] = row i of `a` times the matrix whose *rows* are given: sums of scaled columns.
template <class A, int N, int R, int C, class S>
[[gnu::always_inline]] inline void combine(const A& a, const Column<N, S> (&rows)[C], Column<N, S> (&to)[R]) {
  if constexpr (is_structured<A>) {
    for (int i = 0; i < R; ++i) to[i].set_zero();
    unrolled<A::entries.size()>([&](auto e) {
      constexpr Entry entry = A::entries[e];
      constexpr bool first = e == 0 || A::entries[e == 0 ? 0 : e - 1].row != entry.row;
      if constexpr (first) to[entry.row] = rows[entry.column];
      if constexpr (first && entry.slot >= 0) to[entry.row].scale(a.template value<e>());
      if constexpr (!first && entry.slot < 0) to[entry.row].add(rows[entry.column]);
      if constexpr (!first && entry.slot >= 0) to[entry.row].add(rows[entry.column], a.template value<e>());
    });
  } else {
    for (int i = 0; i < R; ++i) {
      to[i] = rows[0];
      to[i].scale(a(i, 0));
      for (int k = 1; k < C; ++k) to[i].add(rows[k], a(i, k));
    }
  }
}

template <int N, class S>
[[gnu::always_inline]] inline void mirror_lower(Matrix<N, N, S>& a) {
  for (int j = 0; j < N; ++j)
    for (int i = j + 1; i < N; ++i) a(j, i) = a(i, j);
}

/// out = q + A U for U whose column j is u[j], where that is symmetric: the lower triangle is computed and
/// mirrored.
template <class A, int N, int R, class S>
[[gnu::always_inline]] inline void symmetric_product(const A& a, const Column<N, S> (&u)[R],
                                                     const Matrix<R, R, S>& q, Matrix<R, R, S>& out) {
  if constexpr (is_identity<A>) {
    for (int j = 0; j < R; ++j) {
      Column<R, S> sum;
      sum.load(q.data() + j * R);
      sum.add(u[j]);
      sum.store(out.data() + j * R);
    }
  } else if constexpr (is_structured<A>) {
    unrolled<static_cast<std::size_t>(R)>([&](auto row) {
      constexpr int i = static_cast<int>(row);
      for (int j = 0; j <= i; ++j) {
        S sum = q(i, j);
        unrolled<A::entries.size()>([&](auto e) {
          constexpr Entry entry = A::entries[e];
          if constexpr (entry.row == i && entry.slot < 0) sum += u[j][entry.column];
          if constexpr (entry.row == i && entry.slot >= 0) sum += u[j][entry.column] * a.template value<e>();
        });
        out(i, j) = sum;
        out(j, i) = sum;
      }
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

/// Eliminates the columns of a symmetric `a` one after the other (L D L^T without roots) and hands each to
/// keep(j, column, pivot) before it is used; column j is L d_j from row j on. False where `a` is not finite
/// or not positive semi-definite up to the rounding of its own diagonal. O(N^3 / 6).
template <int N, class S, class Keep>
[[gnu::always_inline]] [[nodiscard]] inline bool eliminate(const Matrix<N, N, S>& a, const Keep& keep) {
  constexpr S slack = S(64) * std::numeric_limits<S>::epsilon();
  Column<N, S> columns[N];
  for (int j = 0; j < N; ++j) columns[j].load(a.data() + j * N);
  bool good = true;
  for (int j = 0; j < N; ++j) {
    const S pivot = columns[j][j];
    const S floor = slack * a(j, j);
    if (!(pivot > floor)) [[unlikely]] {  // NaN, negative, or a direction without uncertainty
      good = good && pivot >= -floor && a(j, j) >= S(0) && a(j, j) < std::numeric_limits<S>::infinity();
      for (int k = j + 1; k < N; ++k)
        good = good && columns[j][k] * columns[j][k] <= S(4) * slack * a(j, j) * a(k, k);
      keep(j, columns[j], S(0));
      continue;
    }
    keep(j, columns[j], pivot);
    const S inverse = S(1) / pivot;
    for (int k = j + 1; k < N; ++k) columns[k].subtract(columns[j], columns[j][k] * inverse);
  }
  return good;
}

/// Symmetric `a` is finite and positive semi-definite.
template <int N, class S>
[[nodiscard]] inline bool is_covariance(const Matrix<N, N, S>& a) {
  return eliminate<N, S>(a, [](int, const Column<N, S>&, const S&) {});
}

/// Lower triangular root with root root^T = a; a direction without variance gives a column of zeros. False,
/// and no use, where `a` is no covariance.
template <int N, class S>
[[nodiscard]] inline bool covariance_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  using std::sqrt;
  return eliminate<N, S>(a, [&](int j, const Column<N, S>& column, const S& pivot) {
    const S factor = pivot > S(0) ? S(1) / sqrt(pivot) : S(0);
    for (int i = 0; i < N; ++i) root(i, j) = i < j ? S(0) : column[i] * factor;
  });
}

/// What M measured numbers do to N states: with S = H P H^T + R = L D L^T,
///   w[m] = column m of P H^T L^-T D^-1/2,   so that   P H^T S^-1 H P = sum w w^T   and   K r = sum w y(r).
template <int N, int M, class S>
struct Correction {
  Column<N, S> w[M];
  S lower[M][M];
  S inverse_root[M];

  /// Residual in units of its standard deviations, independent of one another: y = D^-1/2 L^-1 r.
  [[gnu::always_inline]] void whiten(const S* r, S* y) const {
    S raw[M];
    for (int j = 0; j < M; ++j) {
      raw[j] = r[j];
      for (int k = 0; k < j; ++k) raw[j] -= lower[j][k] * raw[k];
    }
    for (int j = 0; j < M; ++j) y[j] = raw[j] * inverse_root[j];
  }
};

/// L D L^T of `a` into unit lower L and D^-1/2. False where a pivot is not positive. Divisions stay on the
/// critical path, roots do not.
template <int M, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool factor(const Matrix<M, M, S>& a, S (&lower)[M][M],
                                                        S (&inverse_root)[M]) {
  using std::sqrt;
  bool good = true;
  S raw[M][M];
  for (int i = 0; i < M; ++i)
    for (int j = 0; j <= i; ++j) raw[i][j] = a(i, j);
  for (int j = 0; j < M; ++j) {
    good = good && raw[j][j] > S(0) && raw[j][j] <= std::numeric_limits<S>::max();
    const S inverse = S(1) / raw[j][j];
    inverse_root[j] = sqrt(inverse);
    for (int i = j + 1; i < M; ++i) lower[i][j] = raw[i][j] * inverse;
    for (int i = j + 1; i < M; ++i)
      for (int k = j + 1; k <= i; ++k) raw[i][k] -= lower[i][j] * raw[k][j];
  }
  return good;
}

/// Fills `covariance` = H P H^T + R and the correction. False where it is not positive definite.
template <class H, int N, int M, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool correction(const Column<N, S> (&p)[N], const H& h,
                                                            const Matrix<M, M, S>& r,
                                                            Matrix<M, M, S>& covariance,
                                                            Correction<N, M, S>& result) {
  Column<N, S> ph[M];
  combine(h, p, ph);
  symmetric_product(h, ph, r, covariance);
  const bool good = factor(covariance, result.lower, result.inverse_root);
  for (int j = 0; j < M; ++j) {
    for (int k = 0; k < j; ++k) ph[j].subtract(ph[k], result.lower[j][k]);
    result.w[j] = ph[j];
    result.w[j].scale(result.inverse_root[j]);
  }
  return good;
}

/// p -= sum w w^T, symmetric bit for bit where p is.
template <int N, int M, class S>
[[gnu::always_inline]] inline void lower_by_squares(Column<N, S> (&p)[N], const Column<N, S> (&w)[M]) {
  for (int j = 0; j < N; ++j)
    for (int m = 0; m < M; ++m) p[j].subtract(w[m], w[m][j]);
}

}  // namespace cairn::inline CAIRN_ABI::detail
