// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Linear equations in plain loops of long double, which share nothing with the library: what tests hold it
/// against. One function for all sizes: Eigen's decompositions take the compiler seconds for each.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <cairn/core/linalg.hpp>

namespace cairn_test {

/// A dense matrix of long double.
struct LongMatrix {
  int rows = 0, cols = 0;
  std::vector<long double> numbers;

  LongMatrix(int r, int c) : rows(r), cols(c), numbers(static_cast<std::size_t>(r * c)) {}
  template <class Derived>
  explicit LongMatrix(const Eigen::DenseBase<Derived>& m)
      : LongMatrix(static_cast<int>(m.rows()), static_cast<int>(m.cols())) {
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < cols; ++j) at(i, j) = static_cast<long double>(m.derived().coeff(i, j));
  }
  long double& at(int i, int j) { return numbers[static_cast<std::size_t>(i * cols + j)]; }
  [[nodiscard]] long double at(int i, int j) const { return numbers[static_cast<std::size_t>(i * cols + j)]; }

  template <int R, int C>
  [[nodiscard]] cairn::Matrix<R, C> rounded() const {
    cairn::Matrix<R, C> m(rows, cols);
    for (int j = 0; j < cols; ++j)
      for (int i = 0; i < rows; ++i) m.coeffRef(i, j) = static_cast<double>(at(i, j));
    return m;
  }
};

/// a x = b by elimination along the largest pivot of each column; NaN where there is none.
inline LongMatrix eliminated(LongMatrix a, LongMatrix b) {
  const int n = a.rows;
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (std::fabs(a.at(i, k)) > std::fabs(a.at(pivot, k))) pivot = i;
    for (int j = 0; j < n; ++j) std::swap(a.at(k, j), a.at(pivot, j));
    for (int j = 0; j < b.cols; ++j) std::swap(b.at(k, j), b.at(pivot, j));
    const long double inverse =
        a.at(k, k) == 0 ? std::numeric_limits<long double>::quiet_NaN() : 1 / a.at(k, k);
    for (int j = 0; j < n; ++j) a.at(k, j) *= inverse;
    for (int j = 0; j < b.cols; ++j) b.at(k, j) *= inverse;
    for (int i = 0; i < n; ++i) {
      const long double factor = a.at(i, k);
      if (i == k || factor == 0) continue;
      for (int j = 0; j < n; ++j) a.at(i, j) -= factor * a.at(k, j);
      for (int j = 0; j < b.cols; ++j) b.at(i, j) -= factor * b.at(k, j);
    }
  }
  return b;
}

/// The x of a x = b.
template <class A, class B>
cairn::Matrix<B::RowsAtCompileTime, B::ColsAtCompileTime> solved(const A& a, const Eigen::MatrixBase<B>& b) {
  return eliminated(LongMatrix(a), LongMatrix(b))
      .template rounded<B::RowsAtCompileTime, B::ColsAtCompileTime>();
}

template <class A>
cairn::Matrix<A::RowsAtCompileTime, A::ColsAtCompileTime> inverse_of(const A& a) {
  LongMatrix one(static_cast<int>(a.rows()), static_cast<int>(a.rows()));
  for (int i = 0; i < one.rows; ++i) one.at(i, i) = 1;
  return eliminated(LongMatrix(a), one).template rounded<A::RowsAtCompileTime, A::ColsAtCompileTime>();
}

/// e^T P^{-1} e.
template <class P, class E>
double normalised_square(const P& covariance, const Eigen::MatrixBase<E>& error) {
  const LongMatrix e(error), x = eliminated(LongMatrix(covariance), e);
  long double sum = 0;
  for (int i = 0; i < e.rows; ++i) sum += e.at(i, 0) * x.at(i, 0);
  return static_cast<double>(sum);
}

/// The lower triangle whose square is `a`; NaN where it has none.
template <class A>
cairn::Matrix<A::RowsAtCompileTime, A::ColsAtCompileTime> lower_root(const A& a) {
  LongMatrix l(a);
  for (int j = 0; j < l.cols; ++j) {
    for (int k = 0; k < j; ++k) l.at(j, j) -= l.at(j, k) * l.at(j, k);
    l.at(j, j) = std::sqrt(l.at(j, j));
    for (int i = 0; i < j; ++i) l.at(i, j) = 0;
    for (int i = j + 1; i < l.rows; ++i) {
      for (int k = 0; k < j; ++k) l.at(i, j) -= l.at(i, k) * l.at(j, k);
      l.at(i, j) /= l.at(j, j);
    }
  }
  return l.template rounded<A::RowsAtCompileTime, A::ColsAtCompileTime>();
}

}  // namespace cairn_test
