// words: cairn: jacobian(x) of a sensor; Expected<2, 3, double>; Found<1, 3, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

struct Broken : Sensor {
  cairn::Matrix<1, 3> jacobian(const State&) const { return {}; }
};

auto step(Belief& belief, const Broken& sensor, const cairn::Vector<2>& z) {
  return cairn::Kalman{}.update(belief, sensor, z);
}
