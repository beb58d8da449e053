// words: cairn: a Measurement has the number type of the State; double; float
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

struct Broken : Sensor {
  using Measurement = cairn::Vector<2, float>;
  Measurement predict(const State&) const { return {}; }
  cairn::Matrix<2, 2, float> noise(const State&) const { return {}; }
};

auto step(Belief& belief, const Broken& sensor, const cairn::Vector<2, float>& z) {
  return cairn::Kalman{}.update(belief, sensor, z);
}
