// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/batch.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/kalman.hpp>

#include "rivals.hpp"
#include "runs.hpp"

namespace cairn_bench {
namespace {

double kalman_6_3(int count) {
  static const auto z = noise<3>(64, 1.0);
  return run_linear(cairn::Kalman{}, unit_prior<6>(), cairn::ConstantVelocity<3>{},
                    cairn::PositionSensor<3, 6>{}, z, count);
}
double landmark_3_3(int count) {
  static const auto z = noise<3>(64, 1.0);
  return run_linear(cairn::Kalman{}, unit_prior<3>(), Still{}, cairn::PositionSensor<3, 3>{}, z, count);
}
double extended_5_2(int count) {
  return run_vehicle(cairn::Extended{}, Vehicle{}, Beacon{}, count);
}
double extended_15_6(int count) {
  static const auto z = noise<6>(64, 1.0);
  return run_linear(cairn::Extended{}, unit_prior<15>(), Inertial{}, cairn::PositionSensor<6, 15>{}, z,
                    count);
}

}  // namespace

Rival ours() {
  return {"ours", kalman_6_3, landmark_3_3, extended_5_2, extended_15_6};
}

double batch_of_1000(int rounds) {
  cairn::GaussianBatch<3> batch(1000, unit_prior<3>());
  static const cairn::GaussianBatch<3> seen(1000, unit_prior<3>());
  const cairn::Matrix<3> q = Still{}.q;
  std::size_t kept = 0;
  for (int k = 0; k < rounds; ++k) {
    static_cast<void>(cairn::BatchKalman{}.drift(batch, q));
    kept += cairn::BatchKalman{}.update(batch, seen);
  }
  if (kept != 1000U * static_cast<std::size_t>(rounds)) fail("a lane of the batch was refused");
  double sum = 0.0;
  for (std::size_t i = 0; i < batch.size(); ++i) sum += batch.get(i).covariance.trace();
  return sum / 1000.0;
}

}  // namespace cairn_bench
