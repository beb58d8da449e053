// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Is a matrix a covariance, and what is its root: symmetric elimination along columns, for sizes known at
/// compile time.
#pragma once

#include <cmath>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/column_shapes.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/register_column.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Eliminates the columns of a symmetric matrix one after the other (L D L^T without roots) and hands each to
/// keep(j, column, pivot) before it is used; column j is L d_j from row j on. For a matrix whose every pivot
/// is well above the rounding of its own diagonal, with one branch at the end; false says nothing about the
/// matrix but that core/factor.hpp must look at it. Only rows on and below the diagonal are kept up.
/// O(N^3 / 6).
template <int N, class S, class Keep>
[[gnu::always_inline]] [[nodiscard]] inline bool eliminate_regular(Column<N, S> (&columns)[N],
                                                                   const Keep& keep) {
  constexpr S slack = rounding_share<S>;
  constexpr int width = Column<N, S>::width;
  S diagonal[N];
  each<N>([&](int j) { diagonal[j] = columns[j][j]; });
  bool regular = true;
  each<N>([&](int j) __attribute__((always_inline)) {
    const S pivot = columns[j][j];
    regular &= pivot > slack * diagonal[j];
    keep(j, columns[j], pivot);
    const S inverse = S(1) / pivot;
    each<N>(j + 1, N, [&](int k) {
      const S factor = columns[j][k] * inverse;
      for (int lane = k / width; lane < Column<N, S>::count; ++lane)
        columns[k].lanes[lane] -= columns[j].lanes[lane] * factor;
    });
  });
  return regular;
}

/// Every pivot is well above rounding; uses up `work`.
template <int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool is_regular(Column<N, S> (&work)[N]) {
  return eliminate_regular(work, [](int, const Column<N, S>&, const S&) {});
}
/// Symmetric `a` is finite and positive semi-definite up to the rounding of its own diagonal.
template <int N, class S>
[[nodiscard]] inline bool is_covariance(const Matrix<N, N, S>& a) {
  Column<N, S> work[N];
  load_columns(a, work);
  return is_regular(work) || is_semi_definite<N, S>(a);
}
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool is_semi_definite(const Column<N, S> (&p)[N]) {
  Matrix<N, N, S> a;
  for (int j = 0; j < N; ++j) p[j].store(a.data() + j * N);
  return is_semi_definite<N, S>(a);
}
template <int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool is_covariance(const Column<N, S> (&p)[N]) {
  Column<N, S> work[N];
  each<N>([&](int j) { work[j] = p[j]; });
  return is_regular(work) || is_semi_definite(p);
}

/// Lower triangular root with root root^T = a for any covariance; false, and no use, where `a` is none.
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] bool careful_root(const Matrix<N, N, S>& a, Column<N, S> (&root)[N]) {
  Matrix<N, N, S> lower;
  if (!singular_root<N, S>(a, lower)) return false;
  load_columns(lower, root);
  return true;
}
template <int N, class S>
[[gnu::always_inline]] [[nodiscard]] inline bool covariance_root(const Matrix<N, N, S>& a,
                                                                 Column<N, S> (&root)[N]) {
  using std::sqrt;
  Column<N, S> work[N];
  load_columns(a, work);
  const bool regular = eliminate_regular(
      work, [&](int j, const Column<N, S>& column, const S& pivot) __attribute__((always_inline)) {
        root[j] = column;
        root[j].scale(S(1) / sqrt(pivot));
        clear_before(root[j], j);
      });
  return regular || careful_root(a, root);
}
template <int N, class S>
[[nodiscard]] inline bool covariance_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  Column<N, S> columns[N];
  const bool good = covariance_root(a, columns);
  each<N>([&](int j) { columns[j].store(root.data() + j * N); });
  return good;
}

/// Lower triangular L with L L^T = a for a symmetric positive semi-definite a; false, and zeros, where it is
/// none.
template <int N, class S>
[[nodiscard]] bool checked_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  bool good = false;
  if constexpr (N != dynamic)
    good = covariance_root<N, S>(a, root);
  else
    good = dense_root<N, S>(a, root);
  if (!good) root.setZero();
  return good;
}

template <int N, class S>
[[nodiscard]] inline bool is_valid_covariance(const Matrix<N, N, S>& a) {
  if constexpr (N != dynamic) {
    return is_covariance<N, S>(a);
  } else {
    Matrix<N, N, S> lower = a;
    return eliminate_root(view(a), view(lower)) || is_semi_definite<N, S>(a);
  }
}

/// What is the matter with a noise that does not look like a covariance at first sight, if anything.
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] Status judge_noise(const Matrix<N, N, S>& q) {
  if (!finite_numbers<S>(view(q))) return Status::not_finite;
  return is_semi_definite<N, S>(q) ? Status::accepted : Status::not_positive_definite;
}

/// Why this matrix is no noise, if it is none; in all likelihood it is one.
template <int N, class S>
[[nodiscard]] Status check_noise(const Matrix<N, N, S>& q) {
  if (!all_finite(q)) return Status::not_finite;
  return is_valid_covariance<N, S>(q) ? Status::accepted : Status::not_positive_definite;
}

/// The root of what is known to be a covariance.
template <int N, class S>
[[nodiscard]] Matrix<N, N, S> semi_definite_root(const Matrix<N, N, S>& a) {
  Matrix<N, N, S> root = a;
  static_cast<void>(checked_root<N, S>(a, root));
  return root;
}

}}}  // namespace cairn::CAIRN_ABI::detail
