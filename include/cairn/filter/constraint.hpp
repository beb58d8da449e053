// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Equality constraints by projection: the belief, given that D d = c for the step d from its mean.
///
///   d = P D^T (D P D^T)^-1 c,   P <- P - P D^T (D P D^T)^-1 D P
/// (D. Simon, "Kalman filtering with state constraints", IET Control Theory and Applications 4, 2010, 2.4.)
#pragma once

#include <concepts>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

namespace detail {

/// Rows of D and numbers of c, as far as one of them knows when it is compiled.
template <class D, class C>
inline constexpr int common_rows = ShapeOf<D>::rows != dynamic ? ShapeOf<D>::rows
                                   : ShapeOf<C>::rows == 1     ? ShapeOf<C>::columns
                                                               : ShapeOf<C>::rows;

}  // namespace detail

/// Projects the belief onto the K constraints; for vectors D x = b is c = b - D mean. Refused, and the belief
/// left, where a constraint fixes what the belief is already certain of, or constraints repeat one another.
template <Manifold X, int K>
Status constrain(Gaussian<X>& belief, const Matrix<K, dof<X>, ScalarOf<X>>& d,
                 const Vector<K, ScalarOf<X>>& c) {
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  if (!detail::has_size(d, c.size(), detail::common_size(belief.mean, belief.covariance)) || c.size() == 0)
    return Status::size_mismatch;
  if (!all_finite(d) || !all_finite(c) || !all_finite(belief.covariance)) return Status::not_finite;
  const Matrix<n, K, S> pd = belief.covariance * d.transpose();
  const Matrix<K, K, S> s = symmetrised(d * pd);
  const Cholesky<K, S> root(s);
  if (!root.good()) return Status::not_positive_definite;
  const Tangent<X> step = pd * root.solve(c);
  Matrix<n, n, S> next = symmetrised(belief.covariance - pd * root.solve(Matrix<K, n, S>(pd.transpose())));
  for (int i = 0; i < static_cast<int>(next.rows());
       ++i)  // what is now known exactly must not round below zero
    if (next(i, i) < S(0)) next(i, i) = S(0);
  if (!all_finite(step) || !all_finite(next)) return Status::not_positive_definite;
  belief.mean = retract(belief.mean, step);
  belief.covariance = next;
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

}  // namespace cairn::inline CAIRN_ABI
