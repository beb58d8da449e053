// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// OpenKF computes in float; its own header of types is replaced so that it computes in double as all others
// do.
#include "rivals.hpp"

#ifdef CAIRN_BENCH_OPENKF
#include <cstdint>

#include <Eigen/Dense>

#include "problems.hpp"
#define OPENKF_TYPES_H
namespace kf {
using float32_t = double;
template <int32_t ROW, int32_t COL>
using Matrix = Eigen::Matrix<double, ROW, COL>;
template <int32_t ROW>
using Vector = Eigen::Matrix<double, ROW, 1>;
}  // namespace kf
#include <kalman_filter/kalman_filter.h>

namespace cairn_bench {
namespace {

double kalman_6_3(int steps) {
  const cairn::ConstantVelocity<3> process;
  const auto z = noise<3>(64, 1.0);
  kf::KalmanFilter<6, 3> filter;
  filter.matP().setIdentity();
  const cairn::Matrix<6> f = process.jacobian({}, {}, time_step);
  const cairn::Matrix<6> q = process.noise({}, {}, time_step);
  const cairn::Matrix<3, 6> h = cairn::Matrix<3, 6>::Identity();
  const cairn::Matrix<3> r = cairn::Matrix<3>::Identity();
  for (int k = 0; k < steps; ++k) {
    filter.predictLKF(f, q);
    filter.correctLKF(z[static_cast<std::size_t>(k % 64)], r, h);
  }
  return filter.matP().trace();
}

double landmark_3_3(int steps) {
  const auto z = noise<3>(64, 1.0);
  kf::KalmanFilter<3, 3> filter;
  filter.matP().setIdentity();
  const cairn::Matrix<3> one = cairn::Matrix<3>::Identity();
  const cairn::Matrix<3> q = Still{}.q;
  for (int k = 0; k < steps; ++k) {
    filter.predictLKF(one, q);
    filter.correctLKF(z[static_cast<std::size_t>(k % 64)], one, one);
  }
  return filter.matP().trace();
}

double extended_5_2(int steps) {
  const Vehicle process;
  const Beacon sensor;
  const auto z = noise<2>(64, 0.1);
  kf::KalmanFilter<5, 2> filter;
  filter.vecX() << 0, 0, 0, 1, 0.1;
  filter.matP().setIdentity();
  for (int k = 0; k < steps; ++k) {
    if (k % 64 == 0) filter.vecX() << 0, 0, 0, 1, 0.1;
    const cairn::Vector<5> x = filter.vecX();
    filter.predictEkf([&](const auto& s) { return process.propagate(s, {}, time_step); },
                      process.jacobian(x, {}, time_step).dense(), process.noise(x, {}, time_step).dense());
    const auto h = [&](const auto& s) {
      const auto seen = sensor.predict(s);
      return cairn::Vector<2>(seen.template part<0>()(0), seen.template part<1>().angle());
    };
    const cairn::Vector<2> seen = h(filter.vecX()) + z[static_cast<std::size_t>(k % 64)];
    filter.correctEkf(h, seen, sensor.noise(x).dense(), sensor.jacobian(filter.vecX()).dense());
  }
  return filter.matP().trace();
}

double extended_15_6(int steps) {
  const Inertial process;
  const auto z = noise<6>(64, 1.0);
  kf::KalmanFilter<15, 6> filter;
  filter.matP().setIdentity();
  const cairn::Matrix<6, 15> h = cairn::Matrix<6, 15>::Identity();
  const cairn::Matrix<6> r = cairn::Matrix<6>::Identity();
  for (int k = 0; k < steps; ++k) {
    const cairn::Vector<15> x = filter.vecX();
    filter.predictEkf([&](const auto& s) { return process.propagate(s, {}, time_step); },
                      process.jacobian(x, {}, time_step).dense(), process.noise(x, {}, time_step).dense());
    filter.correctEkf([&](const auto& s) { return (h * s).eval(); }, z[static_cast<std::size_t>(k % 64)], r,
                      h);
  }
  return filter.matP().trace();
}

}  // namespace

Rival openkf() {
  return {"OpenKF", kalman_6_3, landmark_3_3, extended_5_2, extended_15_6};
}

}  // namespace cairn_bench
#else
cairn_bench::Rival cairn_bench::openkf() {
  return {"OpenKF"};
}
#endif
