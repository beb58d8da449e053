// words: cairn: Kalman; linear = true; Extended
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

struct Curved {
  using State = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  Measurement predict(const State& x) const { return x.head<2>(); }
  cairn::Matrix<2, 3> jacobian(const State&) const { return {}; }
  cairn::Matrix<2> noise(const State&) const { return {}; }
};

auto step(Belief& belief, const Curved& sensor, const cairn::Vector<2>& z) {
  return cairn::Kalman{}.update(belief, sensor, z);
}
