// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What a careful user writes with Eigen and no library: the yardstick of the unscented rows.
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>

#include "problems.hpp"
#include "rivals.hpp"

namespace cairn_bench {
namespace {

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

double unscented_5_2(int count) {
  static const auto z = noise<2>(64, 0.1);
  const Beacon sensor;
  HandWrittenUnscented<5, 2> filter{vehicle_start(), cairn::Matrix<5>::Identity()};
  const auto h = [&](const cairn::Vector<5>& x) {
    const auto seen = sensor.predict(x);
    return cairn::Vector<2>(seen.part<0>()(0), seen.part<1>().angle());
  };
  for (int k = 0; k < count; ++k) {
    if (k % 64 == 0) filter.x = vehicle_start();
    filter.predict([](const cairn::Vector<5>& x) { return Vehicle{}.propagate(x, {}, time_step); },
                   Vehicle{}.noise(filter.x, {}, time_step).dense());
    filter.update(h, sensor.noise(filter.x).dense(), h(filter.x) + z[static_cast<std::size_t>(k % 64)]);
  }
  return filter.p.trace();
}
double unscented_9_3(int count) {
  static const auto z = noise<3>(64, 0.3);
  HandWrittenUnscented<9, 3> filter{cairn::Vector<9>::Zero(), cairn::Matrix<9>::Identity()};
  for (int k = 0; k < count; ++k) {
    filter.predict([](const cairn::Vector<9>& x) { return Coupled{}.propagate(x, {}, time_step); },
                   Coupled{}.noise(filter.x, {}, time_step).dense());
    filter.update([](const cairn::Vector<9>& x) { return CoupledSensor{}.predict(x); },
                  CoupledSensor{}.noise(filter.x).dense(), z[static_cast<std::size_t>(k % 64)]);
  }
  return filter.p.trace();
}

}  // namespace

Rival hand_written() {
  Rival rival{"hand-written Eigen"};
  rival.unscented_5_2 = unscented_5_2;
  rival.unscented_9_3 = unscented_9_3;
  return rival;
}

}  // namespace cairn_bench
