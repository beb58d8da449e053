// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The only door to Eigen: the vector and matrix names that every other header uses.
///
/// Only Eigen/Core comes in here, and no header takes a decomposition of Eigen's, so that nobody pays for
/// including them: for symmetric matrices there are core/cholesky.hpp and core/symmetric_eigen.hpp. A program
/// that writes m.inverse(), a.cross(b) or a decomposition includes Eigen/Dense itself; the linker misses them
/// otherwise.
#pragma once

#include <Eigen/Core>

#include <cairn/simd/matrix_product.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

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

namespace detail {

/// The R x C matrix whose entries are sums of term(r, k, c) over k below K.
template <int R, int K, int C, class S, class Term>
[[nodiscard, gnu::always_inline]] inline Matrix<R, C, S> sums(const Term& term) {
  Matrix<R, C, S> result;
#pragma GCC unroll 8
  for (int c = 0; c < C; ++c)
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) {
      S sum = term(r, 0, c);
#pragma GCC unroll 8
      for (int k = 1; k < K; ++k) sum += term(r, k, c);
      result(r, c) = sum;
    }
  return result;
}

}  // namespace detail

namespace detail {

/// A B of run-time sizes (registers side by side, matrix_product.hpp). Numbers that are no float or double go
/// the same way one by one.
template <int R, int K, int C, class S>
[[nodiscard]] Matrix<R, C, S> run_time_product(const Matrix<R, K, S>& a, const Matrix<K, C, S>& b) {
  Matrix<R, C, S> result(a.rows(), b.cols());
  multiply(a.data(), b.data(), result.data(), a.rows(), a.cols(), b.cols());
  return result;
}

}  // namespace detail

/// A^T, entry by entry: gcc 12 calls a matrix that is constructed from an Eigen transpose uninitialised.
template <int R, int C, class S>
[[nodiscard]] Matrix<C, R, S> transposed(const Matrix<R, C, S>& a) {
  Matrix<C, R, S> result(a.cols(), a.rows());
  for (Eigen::Index j = 0; j < a.cols(); ++j)
    for (Eigen::Index i = 0; i < a.rows(); ++i) result(j, i) = a(i, j);
  return result;
}

/// A B. This and the three below are plain loops, which the compiler unrolls where sizes are small: each
/// shape of a product of Eigen's costs whoever includes it a tenth of a second of compiling, called or not,
/// of more than 8 rows half a second, and of run-time sizes more than one. O(R K C).
template <int R, int K, int C, class S>
[[nodiscard]] Matrix<R, C, S> product(const Matrix<R, K, S>& a, const Matrix<K, C, S>& b) {
  if constexpr (R == dynamic || K == dynamic || C == dynamic)
    return detail::run_time_product(a, b);
  else
    return detail::sums<R, K, C, S>([&](int r, int k, int c) { return a(r, k) * b(k, c); });
}

/// A^T B, see product().
template <int R, int K, int C, class S>
[[nodiscard]] Matrix<R, C, S> transposed_product(const Matrix<K, R, S>& a, const Matrix<K, C, S>& b) {
  if constexpr (R == dynamic || K == dynamic || C == dynamic)
    return detail::run_time_product(transposed(a), b);
  else
    return detail::sums<R, K, C, S>([&](int r, int k, int c) { return a(k, r) * b(k, c); });
}

/// A B^T, see product().
template <int R, int K, int C, class S>
[[nodiscard]] Matrix<R, C, S> product_transposed(const Matrix<R, K, S>& a, const Matrix<C, K, S>& b) {
  if constexpr (R == dynamic || K == dynamic || C == dynamic)
    return detail::run_time_product(a, transposed(b));
  else
    return detail::sums<R, K, C, S>([&](int r, int k, int c) { return a(r, k) * b(c, k); });
}

/// to += weight A^T B, see product().
template <int R, int C, int K, class S>
void add_transposed_product(Matrix<R, C, S>& to, const Matrix<K, R, S>& a, const Matrix<K, C, S>& b,
                            S weight = S(1)) {
  const Matrix<R, C, S> sum = transposed_product(a, b);
  for (Eigen::Index c = 0; c < sum.cols(); ++c)
    for (Eigen::Index r = 0; r < sum.rows(); ++r) to(r, c) += weight * sum(r, c);
}

/// The R x C part of a matrix that begins at this row and column.
template <int R, int C, int Rows, int Columns, class S>
[[nodiscard]] Matrix<R, C, S> part_of(const Matrix<Rows, Columns, S>& from, int row, int column) {
  Matrix<R, C, S> part;
  for (int j = 0; j < C; ++j)
    for (int i = 0; i < R; ++i) part(i, j) = from(row + i, column + j);
  return part;
}

/// Writes `part` into a matrix from this row and column on.
template <int Rows, int Columns, int R, int C, class S>
void put(Matrix<Rows, Columns, S>& to, int row, int column, const Matrix<R, C, S>& part) {
  for (Eigen::Index j = 0; j < part.cols(); ++j)
    for (Eigen::Index i = 0; i < part.rows(); ++i) to(row + i, column + j) = part(i, j);
}

/// Whether every number is finite.
template <class Derived>
[[nodiscard]] bool all_finite(const Eigen::DenseBase<Derived>& a) {
  using S = typename Derived::Scalar;
  S zero(0);
  for (Eigen::Index j = 0; j < a.cols(); ++j)
    for (Eigen::Index i = 0; i < a.rows(); ++i) zero += a.derived().coeff(i, j) - a.derived().coeff(i, j);
  return zero == S(0);
}

/// Skew-symmetric matrix of w: skew(w) * v = w x v.
template <class Derived>
[[nodiscard]] Matrix<3, 3, typename Derived::Scalar> skew(const Eigen::MatrixBase<Derived>& w) {
  static_assert(Derived::SizeAtCompileTime == 3, "skew() takes a vector of three numbers");
  using Scalar = typename Derived::Scalar;
  Matrix<3, 3, Scalar> result;
  result << Scalar(0), -w(2), w(1), w(2), Scalar(0), -w(0), -w(1), w(0), Scalar(0);
  return result;
}

}}  // namespace cairn::CAIRN_ABI
