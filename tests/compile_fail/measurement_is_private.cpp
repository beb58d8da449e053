// words: Measurement; Broken
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

#include "models.hpp"

class Broken {
  using State = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  Measurement predict(const State& x) const { return x.head<2>(); }
  cairn::Matrix<2> noise(const State&) const { return {}; }
};

auto step(Belief& belief, const Broken& sensor, const cairn::Vector<2>& z) {
  return cairn::Unscented{}.update(belief, sensor, z);
}
