// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Equality constraints by projection: the belief, given that D d = c for the step d from its mean.
///
///   d = P D^T (D P D^T)^-1 c,   P <- P - P D^T (D P D^T)^-1 D P
/// (D. Simon, "Kalman filtering with state constraints", IET Control Theory and Applications 4, 2010, 2.4.)
/// Done in the units of the belief, d = L u with P = L L^T: the shortest u with D L u = c, by Householder
/// reflections of (D L)^T with column pivots, Q R = (D L)^T, and P <- (L Q_2)(L Q_2)^T with the columns Q_2
/// of Q that no constraint sees. That is a sum of squares, whatever the scales.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/array_update.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// Rows of D and numbers of c, as far as one of them knows when it is compiled.
template <class D, class C>
inline constexpr int common_rows = ShapeOf<D>::rows != dynamic ? ShapeOf<D>::rows
                                   : ShapeOf<C>::rows == 1     ? ShapeOf<C>::columns
                                                               : ShapeOf<C>::rows;

}  // namespace detail

/// Projects the belief onto the K constraints; for vectors D x = b is c = b - D mean. A constraint that
/// repeats others, or what the belief is certain of, and agrees with them changes nothing. Refused, and the
/// belief left: contradiction, where it does not agree; not_positive_definite, where constraints are so
/// nearly the same that their difference would not have three digits, or the covariance is none. O(n^2 K +
/// n^3).
template <Manifold X, int K>
Status constrain(Gaussian<X>& belief, const Matrix<K, dof<X>, ScalarOf<X>>& d,
                 const Vector<K, ScalarOf<X>>& c) {
  using S = ScalarOf<X>;
  using std::abs;
  using std::sqrt;
  constexpr int n = dof<X>;
  constexpr S digits = detail::digits_left<S>;
  if (!detail::has_size(d, c.size(), detail::common_size(belief.mean, belief.covariance)) || c.size() == 0)
    return Status::size_mismatch;
  const int ns = static_cast<int>(belief.covariance.rows()), ks = static_cast<int>(d.rows());
  if (!all_finite(d) || !all_finite(c) || !all_finite(belief.covariance)) return Status::not_finite;
  CovarianceOf<X> root = belief.covariance;
  if (!detail::checked_root<n, S>(belief.covariance, root)) return Status::not_positive_definite;
  Vector<n, S> sigma = Vector<n, S>::Zero(ns);
  for (int i = 0; i < ns; ++i) {
    S variance(0);
    for (int k = 0; k <= i; ++k) variance += root(i, k) * root(i, k);
    sigma(i) = sqrt(variance);
  }
  // A column for each constraint, in units of its terms' deviations: length 1 where nothing cancels.
  Matrix<n, K, S> a = transposed<K, n, S>(detail::column_product(d, root));
  Vector<K, S> wanted = c;
  Vector<K, S> waits = Vector<K, S>::Ones(ks);
  for (int j = 0; j < ks; ++j) {
    S size(0);
    for (int i = 0; i < ns; ++i) size += abs(d(j, i)) * sigma(i);
    if (size > S(0)) {
      for (int i = 0; i < ns; ++i) a(i, j) /= size;
      wanted(j) /= size;
    } else if (wanted(j) != S(0)) {
      return Status::contradiction;  // of what cannot vary
    } else {
      waits(j) = S(0);
    }
  }
  // Each pivot column is reflected onto one axis of u; `path` is R^-T c by rows as it arises.
  CovarianceOf<X> left = root;  // L times the reflections so far
  Vector<n, S> path = Vector<n, S>::Zero(ns);
  int rank = 0;
  for (; rank < ns && rank < ks; ++rank) {
    int best = -1;
    S most(0);
    for (int j = 0; j < ks; ++j) {
      S squares(0);
      for (int i = rank; i < ns; ++i) squares += a(i, j) * a(i, j);
      if (waits(j) > S(0) && squares > most) {
        most = squares;
        best = j;
      }
    }
    // Rounding of P itself hides deviations below the root of its own.
    if (best < 0 || !(most > detail::rounding_share<S>)) break;
    if (!(most > digits)) return Status::not_positive_definite;
    waits(best) = S(0);
    const S norm = sqrt(most);
    const S first = a(rank, best) + (a(rank, best) < S(0) ? -norm : norm);
    Vector<n, S> mirror = Vector<n, S>::Zero(ns);
    mirror(rank) = first;
    for (int i = rank + 1; i < ns; ++i) mirror(i) = a(i, best);
    const S scale = S(1) / (norm * abs(first));  // 2 / |mirror|^2
    const auto reflect = [&](auto&& entry) {
      S dot(0);
      for (int i = rank; i < ns; ++i) dot += mirror(i) * entry(i);
      dot *= scale;
      for (int i = rank; i < ns; ++i) entry(i) -= dot * mirror(i);
    };
    for (int j = 0; j < ks; ++j) reflect([&](int i) -> S& { return a(i, j); });
    for (int i = 0; i < ns; ++i) reflect([&](int k) -> S& { return left(i, k); });
    S sum = wanted(best);
    for (int i = 0; i < rank; ++i) sum -= a(i, best) * path(i);
    path(rank) = sum / a(rank, best);
  }
  S size(0);
  for (int i = 0; i < rank; ++i) size += path(i) * path(i);
  for (int j = 0; j < ks; ++j) {  // what is left must follow from what was taken
    if (!(waits(j) > S(0))) continue;
    S gap = wanted(j);
    for (int i = 0; i < rank; ++i) gap -= a(i, j) * path(i);
    if (!(abs(gap) <= sqrt(detail::rounding_share<S>) * (S(1) + sqrt(size)))) return Status::contradiction;
  }
  Tangent<X> step = Tangent<X>::Zero(ns);
  CovarianceOf<X> free = left;
  for (int i = 0; i < ns; ++i) {
    S squares(0);
    for (int k = 0; k < ns; ++k) {
      if (k < rank) step(i) += left(i, k) * path(k);
      if (k < rank) free(i, k) = S(0);
      squares += free(i, k) * free(i, k);
    }
    if (sqrt(squares) > digits * sigma(i)) continue;
    for (int k = 0; k < ns; ++k) free(i, k) = S(0);  // rounding: known exactly now
  }
  if (!all_finite(step)) return Status::not_positive_definite;
  belief.mean = retract(belief.mean, step);
  belief.covariance = detail::squared_root<n, S>(free);
  return Status::accepted;
}

/// The same for anything that stands for D and c.
template <Manifold X, class D, class C>
  requires(!std::same_as<D, Matrix<detail::common_rows<D, C>, dof<X>, ScalarOf<X>>> ||
           !std::same_as<C, Vector<detail::common_rows<D, C>, ScalarOf<X>>>) &&
          MatrixOf<D, detail::common_rows<D, C>, dof<X>, ScalarOf<X>> &&
          VectorOf<C, detail::common_rows<D, C>, ScalarOf<X>>
Status constrain(Gaussian<X>& belief, const D& d, const C& c) {
  using S = ScalarOf<X>;
  constexpr int k = detail::common_rows<D, C>;
  bool misfit = false;
  const Eigen::Index rows = k != dynamic ? k : d.rows();
  const int n = detail::common_size(belief.mean, belief.covariance);
  const Matrix<k, dof<X>, S> plain_d = detail::plain_matrix<k, dof<X>, S>(d, rows, n, misfit);
  const Vector<k, S> plain_c = detail::plain_vector<Vector<k, S>>(c, rows, misfit);
  return misfit ? Status::size_mismatch : constrain(belief, plain_d, plain_c);
}

}}  // namespace cairn::CAIRN_ABI
