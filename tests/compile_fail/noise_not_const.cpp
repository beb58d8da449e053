// words: cairn: a filter holds models as const: write "const" behind noise(...)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

struct Broken : Sensor {
  cairn::Matrix<2> noise(const State&) { return {}; }
};

auto step(Belief& belief, const Broken& sensor, const cairn::Vector<2>& z) {
  return cairn::Kalman{}.update(belief, sensor, z);
}
