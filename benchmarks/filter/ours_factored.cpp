// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/ud.hpp>

#include "rivals.hpp"
#include "runs.hpp"

namespace cairn_bench {
namespace {

double ud_6_3(int count) {
  static const auto z = noise<3>(64, 1.0);
  return run_linear(cairn::UDFilter{}, cairn::UDGaussian<cairn::Vector<6>>::from(unit_prior<6>()),
                    cairn::ConstantVelocity<3>{}, cairn::PositionSensor<3, 6>{}, z, count);
}
double ud_15_6(int count) {
  static const auto z = noise<6>(64, 1.0);
  return run_linear(cairn::UDFilter{}, cairn::UDGaussian<cairn::Vector<15>>::from(unit_prior<15>()),
                    Inertial{}, cairn::PositionSensor<6, 15>{}, z, count);
}

}  // namespace

Rival ours_factored() {
  Rival rival{"ours"};
  rival.factored_6_3 = ud_6_3;
  rival.factored_15_6 = ud_15_6;
  return rival;
}

}  // namespace cairn_bench
