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

/// Constraints on the u of a step L u: a column of numbers each, of length 1 where nothing cancels, and what
/// its product with u has to be.
template <int N, int K, class S>
class ScaledConstraints {
public:
  /// D (L u) = c, each row divided by what its terms deviate by; `sigma` are the deviations of L u. False for
  /// a constraint that wants another value of what cannot vary.
  [[nodiscard]] bool fill(const Matrix<K, N, S>& d, const Vector<K, S>& c, const Matrix<N, N, S>& root,
                          const Vector<N, S>& sigma) {
    using std::abs;
    const int n = static_cast<int>(root.rows()), k = static_cast<int>(d.rows());
    columns_ = transposed<K, N, S>(column_product(d, root));
    wanted_ = c;
    waits_ = Vector<K, S>::Ones(k);
    path_ = Vector<N, S>::Zero(n);
    for (int j = 0; j < k; ++j) {
      S size(0);
      for (int i = 0; i < n; ++i) size += abs(d(j, i)) * sigma(i);
      if (!(size > S(0))) {
        if (wanted_(j) != S(0)) return false;
        waits_(j) = S(0);
        continue;
      }
      for (int i = 0; i < n; ++i) columns_(i, j) /= size;
      wanted_(j) /= size;
    }
    return true;
  }

  /// Reflects the longest column that waits onto the next axis of u, until what is left of them is rounding;
  /// path() is R^-T c by rows as it arises, and `left` becomes L times the reflections. False where a column
  /// is left that is neither rounding nor has three digits.
  [[nodiscard]] bool reflect(Matrix<N, N, S>& left) {
    const int n = static_cast<int>(columns_.rows()), k = static_cast<int>(columns_.cols());
    for (; rank_ < n && rank_ < k; ++rank_) {
      S most(0);
      const int best = longest(most);
      // Rounding of P itself hides deviations below the root of its own.
      if (best < 0 || !(most > rounding_share<S>)) break;
      if (!(most > digits_left<S>)) return false;
      waits_(best) = S(0);
      reflect_onto_axis(best, most, left);
      S sum = wanted_(best);
      for (int i = 0; i < rank_; ++i) sum -= columns_(i, best) * path_(i);
      path_(rank_) = sum / columns_(rank_, best);
    }
    return true;
  }

  /// What still waits follows from what was taken.
  [[nodiscard]] bool agree() const {
    using std::abs;
    using std::sqrt;
    S size(0);
    for (int i = 0; i < rank_; ++i) size += path_(i) * path_(i);
    for (int j = 0; j < static_cast<int>(columns_.cols()); ++j) {
      if (!(waits_(j) > S(0))) continue;
      S gap = wanted_(j);
      for (int i = 0; i < rank_; ++i) gap -= columns_(i, j) * path_(i);
      if (!(abs(gap) <= sqrt(rounding_share<S>) * (S(1) + sqrt(size)))) return false;
    }
    return true;
  }

  [[nodiscard]] int rank() const noexcept { return rank_; }
  /// The shortest u, along the reflected axes 0 ... rank() - 1.
  [[nodiscard]] const Vector<N, S>& path() const noexcept { return path_; }

private:
  /// The column that waits of which most is left; -1 where none is.
  [[nodiscard]] int longest(S& most) const {
    int best = -1;
    for (int j = 0; j < static_cast<int>(columns_.cols()); ++j) {
      S squares(0);
      for (int i = rank_; i < static_cast<int>(columns_.rows()); ++i)
        squares += columns_(i, j) * columns_(i, j);
      if (waits_(j) > S(0) && squares > most) {
        most = squares;
        best = j;
      }
    }
    return best;
  }

  /// Householder's reflection of column `pivot`, whose squares from row rank_ on sum up to `squares`.
  void reflect_onto_axis(int pivot, S squares, Matrix<N, N, S>& left) {
    using std::abs;
    using std::sqrt;
    const int n = static_cast<int>(columns_.rows());
    const S norm = sqrt(squares);
    const S first = columns_(rank_, pivot) + (columns_(rank_, pivot) < S(0) ? -norm : norm);
    Vector<N, S> mirror = Vector<N, S>::Zero(n);
    mirror(rank_) = first;
    for (int i = rank_ + 1; i < n; ++i) mirror(i) = columns_(i, pivot);
    const S scale = S(1) / (norm * abs(first));  // 2 / |mirror|^2
    const auto reflect_entries = [&](auto&& entry) {
      S dot(0);
      for (int i = rank_; i < n; ++i) dot += mirror(i) * entry(i);
      dot *= scale;
      for (int i = rank_; i < n; ++i) entry(i) -= dot * mirror(i);
    };
    for (int j = 0; j < static_cast<int>(columns_.cols()); ++j)
      reflect_entries([&](int i) -> S& { return columns_(i, j); });
    for (int i = 0; i < n; ++i) reflect_entries([&](int k) -> S& { return left(i, k); });
  }

  Matrix<N, K, S> columns_;
  Vector<K, S> wanted_, waits_;  // 1 where a constraint has not been taken, nor is empty
  Vector<N, S> path_;
  int rank_ = 0;
};

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
  using std::sqrt;
  constexpr int n = dof<X>;
  if (!detail::has_size(d, c.size(), detail::common_size(belief.mean, belief.covariance)) || c.size() == 0)
    return Status::size_mismatch;
  const int ns = static_cast<int>(belief.covariance.rows());
  if (!all_finite(d) || !all_finite(c) || !all_finite(belief.covariance) ||
      !detail::finite_state(belief.mean))
    return Status::not_finite;
  CovarianceOf<X> root = belief.covariance;
  if (!detail::checked_root<n, S>(belief.covariance, root)) return Status::not_positive_definite;
  Vector<n, S> sigma = Vector<n, S>::Zero(ns);
  for (int i = 0; i < ns; ++i) {
    S variance(0);
    for (int k = 0; k <= i; ++k) variance += root(i, k) * root(i, k);
    sigma(i) = sqrt(variance);
  }
  detail::ScaledConstraints<n, K, S> constraints;
  if (!constraints.fill(d, c, root, sigma)) return Status::contradiction;
  CovarianceOf<X> free = root;
  if (!constraints.reflect(free)) return Status::not_positive_definite;
  if (!constraints.agree()) return Status::contradiction;
  Tangent<X> step = Tangent<X>::Zero(ns);
  for (int i = 0; i < ns; ++i) {
    S squares(0);
    for (int k = 0; k < ns; ++k) {
      if (k < constraints.rank()) {
        step(i) += free(i, k) * constraints.path()(k);
        free(i, k) = S(0);
      }
      squares += free(i, k) * free(i, k);
    }
    if (sqrt(squares) > detail::digits_left<S> * sigma(i)) continue;
    for (int k = 0; k < ns; ++k) free(i, k) = S(0);  // rounding: known exactly now
  }
  if (!all_finite(step)) return Status::not_positive_definite;
  const X mean = retract(belief.mean, step);
  if (!detail::finite_state(mean)) return Status::not_finite;
  belief.mean = mean;
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
