// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The only door to Eigen: the vector and matrix names that every other header uses.
///
/// Only Eigen/Core comes in here. A header that needs a decomposition of Eigen's includes it itself
/// (field/patch_noise.hpp takes Eigen/Eigenvalues), so that the price of #include stays with those who use
/// it; for symmetric matrices there is core/cholesky.hpp.
#pragma once

#include <Eigen/Core>

#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// Size known only at run time.
inline constexpr int dynamic = Eigen::Dynamic;

/// Column vector of N numbers (cairn::dynamic for run-time size).
template <int N, class Scalar = double>
using Vector = Eigen::Matrix<Scalar, N, 1>;

/// Matrix of R rows and C columns.
template <int R, int C = R, class Scalar = double>
using Matrix = Eigen::Matrix<Scalar, R, C>;

/// (A + A^T) / 2: removes the asymmetry that rounding left in a covariance. Plain loops compile in a fifth of
/// the time of the expression.
template <class Derived>
[[nodiscard]] auto symmetrised(const Eigen::MatrixBase<Derived>& a) {
  using Scalar = typename Derived::Scalar;
  typename Derived::PlainObject result = a;
  for (Eigen::Index j = 0; j < result.cols(); ++j)
    for (Eigen::Index i = 0; i < j; ++i)
      result(i, j) = result(j, i) = Scalar(0.5) * (result(i, j) + result(j, i));
  return result;
}

/// to += weight a^T b. Plain loops: an expression of Eigen's of more than 8 rows takes its general product,
/// which costs half a second of compiling for every shape. O(R C K).
template <int R, int C, int K, class S>
void add_transposed_product(Matrix<R, C, S>& to, const Matrix<K, R, S>& a, const Matrix<K, C, S>& b,
                            S weight = S(1)) {
  for (int c = 0; c < C; ++c)
    for (int r = 0; r < R; ++r) {
      S sum(0);
      for (int k = 0; k < K; ++k) sum += a(k, r) * b(k, c);
      to(r, c) += weight * sum;
    }
}

/// Skew-symmetric matrix of w: skew(w) * v = w x v.
template <class Derived>
[[nodiscard]] Matrix<3, 3, typename Derived::Scalar> skew(const Eigen::MatrixBase<Derived>& w) {
  using Scalar = typename Derived::Scalar;
  Matrix<3, 3, Scalar> result;
  result << Scalar(0), -w(2), w(1), w(2), Scalar(0), -w(0), -w(1), w(0), Scalar(0);
  return result;
}

}  // namespace cairn::inline CAIRN_ABI
