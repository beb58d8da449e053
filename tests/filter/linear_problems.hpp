// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Random linear-Gaussian problems, on which every Gaussian filter must give the Kalman filter's answer.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/models/linear.hpp>

namespace cairn_test {

/// A random N x N covariance with eigenvalues between about `low` and 1.
template <int N, class S = double>
cairn::Matrix<N, N, S> random_covariance(cairn::Random& random, double low = 0.01) {
  cairn::Matrix<N, N, S> a;
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) a(i, j) = static_cast<S>(random.normal() / std::sqrt(double(N)));
  cairn::Matrix<N, N, S> p = a;
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j) {
      S sum = i == j ? static_cast<S>(low) : S(0);
      for (int k = 0; k < N; ++k) sum += a(i, k) * a(j, k);
      p(i, j) = p(j, i) = sum;
    }
  return p;
}

template <int R, int C, class S = double>
cairn::Matrix<R, C, S> random_matrix(cairn::Random& random, double scale = 1.0) {
  cairn::Matrix<R, C, S> a;
  for (int i = 0; i < R; ++i)
    for (int j = 0; j < C; ++j) a(i, j) = static_cast<S>(scale * random.normal());
  return a;
}

/// x' = F x + Q, z = H x + R with correlated Q and R. The last state is seen by nobody directly.
template <int N, int M, class S = double>
struct LinearProblem {
  cairn::LinearModel<N, S> process;
  cairn::LinearSensor<M, N, S> sensor;
  cairn::Gaussian<cairn::Vector<N, S>> prior;

  explicit LinearProblem(cairn::Random& random)
      : process{random_matrix<N, N, S>(random, 0.6 / std::sqrt(double(N))), random_covariance<N, S>(random)},
        sensor{random_matrix<M, N, S>(random), random_covariance<M, S>(random, 0.1)},
        prior{random_matrix<N, 1, S>(random), random_covariance<N, S>(random)} {
    for (int j = 0; N > 1 && j < M; ++j) sensor.design(j, N - 1) = S(0);
  }
  /// One whose state does not grow for ever, as that of one seed in a few does: for thousands of steps.
  [[nodiscard]] static LinearProblem lasting(cairn::Random& random) {
    LinearProblem problem(random);
    if (const S size = problem.process.transition.norm(); size > S(0.95))
      problem.process.transition *= S(0.95) / size;
    return problem;
  }
};

/// Level and slope of a line through three points, seen one by one with variance 0.25: where a filter that
/// starts from nothing must end.
struct LineFit {
  static constexpr int points = 3;
  cairn::Matrix<points, 2> design{{1, 0}, {1, 1}, {1, 2}};
  cairn::Vector<points> heights{1.0, 2.5, 3.0};
  cairn::Vector<2> solution{7.0 / 6.0, 1.0};  ///< of least squares

  [[nodiscard]] cairn::LinearSensor<1, 2> sensor(int i) const {
    return {design.row(i), cairn::Matrix<1>(0.25)};
  }
  [[nodiscard]] cairn::Vector<1> height(int i) const { return cairn::Vector<1>(heights(i)); }
};

/// Largest entry of |a - b|; infinity where one is no number or the sizes differ.
template <class A, class B>
double largest_difference(const A& a, const B& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return std::numeric_limits<double>::infinity();
  double largest = 0.0;
  for (Eigen::Index j = 0; j < a.cols(); ++j)
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
      const double d = std::abs(static_cast<double>(a(i, j) - b(i, j)));
      if (!(d <= largest)) largest = std::isnan(d) ? std::numeric_limits<double>::infinity() : d;
    }
  return largest;
}

/// Largest entry of |a - b| relative to the largest of |b|; infinity where one is no number.
template <class A, class B>
double relative_error(const A& a, const B& b) {
  double size = 1e-300;
  for (Eigen::Index j = 0; j < b.cols(); ++j)
    for (Eigen::Index i = 0; i < b.rows(); ++i) size = std::max(size, std::abs(static_cast<double>(b(i, j))));
  return largest_difference(a, b) / size;
}

}  // namespace cairn_test
