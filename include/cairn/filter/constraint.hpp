// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Equality constraints by projection: the belief, given that D d = c for the step d from its mean.
///
///   d = P D^T (D P D^T)^-1 c,   P <- P - P D^T (D P D^T)^-1 D P
/// (D. Simon, "Kalman filtering with state constraints", IET Control Theory and Applications 4, 2010, 2.4.)
#pragma once

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// Projects the belief onto the K constraints; for vectors D x = b is c = b - D mean. Refused, and the belief
/// left, where a constraint fixes what the belief is already certain of, or constraints repeat one another.
template <Manifold X, int K>
Status constrain(Gaussian<X>& belief, const Matrix<K, dof<X>, ScalarOf<X>>& d,
                 const Vector<K, ScalarOf<X>>& c) {
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  if (d.cols() != belief.covariance.rows() || d.rows() != c.size()) return Status::size_mismatch;
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

}  // namespace cairn::inline CAIRN_ABI
