// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What a careful user writes with Eigen and no library: the yardstick of the unscented rows, and what the
// registers of the others gain over a textbook's lines, which check nothing.
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>

#include "problems.hpp"
#include "rivals.hpp"

namespace cairn_bench {
namespace {

/// The extended Kalman filter as textbooks write it, F dense as it is there.
template <int N, int M, class Process>
double textbook(const Process& process, int count) {
  static const auto z = noise<M>(64, 1.0);
  const cairn::PositionSensor<M, N> sensor;
  const cairn::Matrix<M, N> h = sensor.jacobian({}).dense();
  const cairn::Matrix<M>& r = sensor.covariance;
  cairn::Vector<N> x = cairn::Vector<N>::Zero();
  cairn::Matrix<N> p = cairn::Matrix<N>::Identity();
  for (int k = 0; k < count; ++k) {
    const cairn::Matrix<N> f = process.jacobian(x, {}, time_step);
    const cairn::Matrix<N> q = process.noise(x, {}, time_step);
    x = process.propagate(x, {}, time_step);
    p = f * p * f.transpose() + q;
    const cairn::Matrix<M, N> hp = h * p;
    const cairn::Matrix<M> s = hp * h.transpose() + r;
    const Eigen::LLT<cairn::Matrix<M>> root(s);
    const cairn::Matrix<N, M> gain = root.solve(hp).transpose();
    x += gain * (z[static_cast<std::size_t>(k % 64)] - h * x);
    p -= gain * hp;
  }
  return p.trace();
}

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
  rival.kalman_6_3 = [](int count) { return textbook<6, 3>(cairn::ConstantVelocity<3>{}, count); };
  rival.landmark_3_3 = [](int count) { return textbook<3, 3>(Still{}, count); };
  rival.extended_15_6 = [](int count) { return textbook<15, 6>(Inertial{}, count); };
  rival.unscented_5_2 = unscented_5_2;
  rival.unscented_9_3 = unscented_9_3;
  return rival;
}

}  // namespace cairn_bench
