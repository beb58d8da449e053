// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Cholesky factor of a small matrix, in plain loops.
///
/// Eigen's LLT is made for matrices of any size: each fixed size that an inline function mentions costs
/// whoever includes the header about a second of compiling, whether the function is called or not. These
/// loops cost next to nothing, and the compiler unrolls them.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A = L L^T of a symmetric matrix of N rows (or cairn::dynamic); G. Golub, C. Van Loan, "Matrix
/// computations", algorithm 4.2.1.
template <int N, class S = double>
class Cholesky {
public:
  /// Reads the lower triangle of `a`. O(N^3 / 6).
  explicit Cholesky(const Matrix<N, N, S>& a) : lower_(a), good_(a.rows() == a.cols()) {
    using std::sqrt;
    const int n = good_ ? size() : 0;
    for (int j = 0; j < n; ++j) {
      const S diagonal = lower_(j, j);
      for (int k = 0; k < j; ++k) {
        const S factor = lower_(j, k);
        for (int i = j; i < n; ++i) lower_(i, j) -= lower_(i, k) * factor;
      }
      const S pivot = lower_(j, j);
      good_ = pivot > S(0) && pivot - pivot == S(0);  // false for NaN and infinity
      if (!good_) break;
      least_share_ = std::min(least_share_, pivot / diagonal);
      const S root = sqrt(pivot), inverse = S(1) / root;
      lower_(j, j) = root;
      for (int i = j + 1; i < n; ++i) lower_(i, j) *= inverse;
      for (int i = 0; i < j; ++i) lower_(i, j) = S(0);
    }
    if (!good_) lower_.setConstant(lower_.rows(), lower_.rows(), S(std::numeric_limits<double>::quiet_NaN()));
  }

  /// False where the matrix is not square, finite and positive definite; then all that is asked below is NaN.
  [[nodiscard]] bool good() const noexcept { return good_; }

  [[nodiscard]] const Matrix<N, N, S>& lower() const noexcept { return lower_; }

  /// Smallest share of a row's diagonal element that the rows before it do not explain, in (0, 1]: near the
  /// rounding of S where the matrix is nearly singular, however its rows are scaled.
  [[nodiscard]] S least_share() const noexcept { return least_share_; }

  /// A^-1 b. O(N^2) a column.
  [[nodiscard]] Vector<N, S> solve(Vector<N, S> b) const {
    forward(b);
    backward(b);
    return b;
  }
  template <int C>
  [[nodiscard]] Matrix<N, C, S> solve(Matrix<N, C, S> b) const {
    forward(b);
    backward(b);
    return b;
  }

  /// L^-1 b: its squared length is b^T A^-1 b.
  [[nodiscard]] Vector<N, S> whiten(Vector<N, S> b) const {
    forward(b);
    return b;
  }
  template <int C>
  [[nodiscard]] Matrix<N, C, S> whiten(Matrix<N, C, S> b) const {
    forward(b);
    return b;
  }

  /// L^-T b: what whiten() and this make of b is A^-1 b.
  template <int C>
  [[nodiscard]] Matrix<N, C, S> unwhiten(Matrix<N, C, S> b) const {
    backward(b);
    return b;
  }

  /// Natural logarithm of det A. O(N).
  [[nodiscard]] S log_determinant() const {
    using std::log;
    S sum(0);
    for (int i = 0; i < size(); ++i) sum += log(lower_(i, i));
    return S(2) * sum;
  }

  /// A^-1, symmetric bit for bit. O(N^3).
  [[nodiscard]] Matrix<N, N, S> inverse() const {
    Matrix<N, N, S> result = lower_;
    const int n = size();
    result.setIdentity();
    forward(result);
    backward(result);
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < j; ++i) result(i, j) = result(j, i);
    return result;
  }

private:
  [[nodiscard]] int size() const noexcept { return static_cast<int>(lower_.rows()); }

  template <class B>
  void forward(B& b) const {
    const int n = size();
    for (int c = 0; c < static_cast<int>(b.cols()); ++c)
      for (int j = 0; j < n; ++j) {
        b(j, c) /= lower_(j, j);
        for (int i = j + 1; i < n; ++i) b(i, c) -= lower_(i, j) * b(j, c);
      }
  }
  template <class B>
  void backward(B& b) const {
    const int n = size();
    for (int c = 0; c < static_cast<int>(b.cols()); ++c)
      for (int j = n - 1; j >= 0; --j) {
        for (int i = j + 1; i < n; ++i) b(j, c) -= lower_(i, j) * b(i, c);
        b(j, c) /= lower_(j, j);
      }
  }

  Matrix<N, N, S> lower_;
  S least_share_ = S(1);
  bool good_ = true;
};

}}  // namespace cairn::CAIRN_ABI
