// words: cairn: a sensor needs `Measurement predict(const State&) const`
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/square_root.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  Measurement measure(const State& x) const { return x.head<2>(); }
  cairn::Matrix<2, 3> jacobian(const State&) const { return {}; }
  cairn::Matrix<2> noise(const State&) const { return {}; }
};

auto step(cairn::SquareRootGaussian<cairn::Vector<3>>& belief, const Broken& sensor,
          const cairn::Vector<2>& z) {
  return cairn::SquareRoot{}.update(belief, sensor, z);
}
