// words: Measurement
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

auto step(Belief& belief, const Sensor& sensor, const cairn::Vector<2>& z) {
  return cairn::Kalman{}.update(belief, z, sensor);
}
