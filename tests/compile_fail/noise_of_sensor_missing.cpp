// words: cairn: a sensor needs `noise(const State&) const`
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  Measurement predict(const State& x) const { return x.head<2>(); }
};

auto step(Belief& belief, const Broken& sensor, const cairn::Vector<2>& z) {
  return cairn::Unscented{}.update(belief, sensor, z);
}
