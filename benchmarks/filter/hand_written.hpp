// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a careful user writes with Eigen and no library: the yardstick of the unscented rows.
#pragma once

#include <cairn/core/linalg.hpp>

namespace cairn_bench {

/// Additive unscented filter with weights W and points drawn anew for the update.
template <int N, int M>
struct HandWrittenUnscented {
  cairn::Vector<N> x;
  cairn::Matrix<N> p;

  static constexpr double lambda = 3.0 - N;
  static constexpr double central = lambda / (N + lambda);
  static constexpr double other = 0.5 / (N + lambda);

  [[nodiscard]] cairn::Matrix<N, 2 * N + 1> points() const {
    const cairn::Matrix<N> root = Eigen::LLT<cairn::Matrix<N>>(p).matrixL();
    cairn::Matrix<N, 2 * N + 1> s;
    s.col(0) = x;
    for (int i = 0; i < N; ++i) {
      s.col(1 + i) = x + std::sqrt(N + lambda) * root.col(i);
      s.col(1 + N + i) = x - std::sqrt(N + lambda) * root.col(i);
    }
    return s;
  }
  template <class F>
  void predict(const F& f, const cairn::Matrix<N>& q) {
    cairn::Matrix<N, 2 * N + 1> s = points();
    for (int i = 0; i <= 2 * N; ++i) s.col(i) = f(cairn::Vector<N>(s.col(i)));
    x = central * s.col(0) + other * s.template rightCols<2 * N>().rowwise().sum();
    p = q;
    for (int i = 0; i <= 2 * N; ++i) {
      const cairn::Vector<N> d = s.col(i) - x;
      p += (i == 0 ? central : other) * d * d.transpose();
    }
  }
  template <class H>
  void update(const H& h, const cairn::Matrix<M>& r, const cairn::Vector<M>& z) {
    const cairn::Matrix<N, 2 * N + 1> s = points();
    cairn::Matrix<M, 2 * N + 1> y;
    for (int i = 0; i <= 2 * N; ++i) y.col(i) = h(cairn::Vector<N>(s.col(i)));
    const cairn::Vector<M> mean = central * y.col(0) + other * y.template rightCols<2 * N>().rowwise().sum();
    cairn::Matrix<M> covariance = r;
    cairn::Matrix<N, M> cross = cairn::Matrix<N, M>::Zero();
    for (int i = 0; i <= 2 * N; ++i) {
      const double w = i == 0 ? central : other;
      const cairn::Vector<M> d = y.col(i) - mean;
      covariance += w * d * d.transpose();
      cross += w * (s.col(i) - x) * d.transpose();
    }
    const Eigen::LLT<cairn::Matrix<M>> root(covariance);
    const cairn::Matrix<N, M> gain = root.solve(cross.transpose()).transpose();
    x += gain * (z - mean);
    p -= gain * covariance * gain.transpose();
    p = (0.5 * (p + p.transpose())).eval();
  }
};

}  // namespace cairn_bench
