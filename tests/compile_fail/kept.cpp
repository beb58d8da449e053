// compiles: the models beside this, whose promises are kept
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

auto predict(Belief& belief, const Process& process, const cairn::Vector<2>& u) {
  return cairn::Kalman{}.predict(belief, process, 1.0, u);
}
auto update(Belief& belief, const Sensor& sensor, const cairn::Vector<2>& z) {
  return cairn::Kalman{}.update(belief, sensor, z);
}
