// words: cairn: a filter holds models as const: write "const" behind predict(...)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

#include "models.hpp"

struct Broken : Sensor {
  Measurement predict(const State& x) { return x.head<2>(); }
};

auto step(Belief& belief, const Broken& sensor, const cairn::Vector<2>& z) {
  return cairn::Unscented{}.update(belief, sensor, z);
}
