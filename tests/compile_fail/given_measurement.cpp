// words: cairn: the measurement or control that was given; Expected<2, 1, double>; Found<3, 1, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

auto step(Belief& belief, const Sensor& sensor, const cairn::Vector<3>& z) {
  return cairn::Kalman{}.update(belief, sensor, z);
}
