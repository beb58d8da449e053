// words: cairn: predict() of a sensor; Expected<2, 1, double>; Found<3, 1, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

#include "models.hpp"

struct Broken : Sensor {
  const State& predict(const State& x) const { return x; }
};

auto step(Belief& belief, const Broken& sensor, const cairn::Vector<2>& z) {
  return cairn::Unscented{}.update(belief, sensor, z);
}
