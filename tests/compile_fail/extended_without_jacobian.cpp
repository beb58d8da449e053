// words: cairn: this filter needs the model's jacobian(); numeric(model)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/extended.hpp>

#include "models.hpp"

struct Underived {
  using State = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  Measurement predict(const State& x) const { return x.head<2>(); }
  cairn::Matrix<2> noise(const State&) const { return {}; }
};

auto step(Belief& belief, const Underived& sensor, const cairn::Vector<2>& z) {
  return cairn::Extended{}.update(belief, sensor, z);
}
