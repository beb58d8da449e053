// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// TinyEKF fixes its sizes by macros, one size a translation unit: here 15/6, where it is the fastest rival.
#include "rivals.hpp"

#ifdef CAIRN_BENCH_TINYEKF
#include "problems.hpp"
#define EKF_N 15
#define EKF_M 6
#define _float_t double
#include <tinyekf.h>

namespace cairn_bench {
namespace {

using RowMajor15 = Eigen::Matrix<double, 15, 15, Eigen::RowMajor>;

double extended_15_6(int steps) {
  const Inertial process;
  const auto z = noise<6>(64, 1.0);
  ekf_t filter;
  const cairn::Vector<15> ones = cairn::Vector<15>::Ones();
  ekf_initialize(&filter, ones.data());
  Eigen::Matrix<double, 6, 15, Eigen::RowMajor> h;
  h.setIdentity();
  const cairn::Matrix<6> r = cairn::Matrix<6>::Identity();
  for (int k = 0; k < steps; ++k) {
    const cairn::Vector<15> x = Eigen::Map<const cairn::Vector<15>>(filter.x);
    const RowMajor15 f = process.jacobian(x, {}, time_step).dense();
    const RowMajor15 q = process.noise(x, {}, time_step).dense();
    const cairn::Vector<15> next = process.propagate(x, {}, time_step);
    ekf_predict(&filter, next.data(), f.data(), q.data());
    const cairn::Vector<6> seen = Eigen::Map<const cairn::Vector<15>>(filter.x).head<6>();
    ekf_update(&filter, z[static_cast<std::size_t>(k % 64)].data(), seen.data(), h.data(), r.data());
  }
  double trace = 0.0;
  for (int i = 0; i < 15; ++i) trace += filter.P[i * 16];
  return trace;
}

}  // namespace

Rival tinyekf() {
  return {"TinyEKF", {}, {}, {}, extended_15_6};
}

}  // namespace cairn_bench
#else
cairn_bench::Rival cairn_bench::tinyekf() {
  return {"TinyEKF"};
}
#endif
