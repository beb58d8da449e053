// words: cairn: part_jacobian(x, part) of a sensor; Expected<2, 3, double>; Found<3, 2, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/rao_blackwell.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<1>;
  using Part = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  Measurement predict(const State&, const Part&) const { return {}; }
  cairn::Matrix<3, 2> part_jacobian(const State&, const Part&) const { return {}; }
  cairn::Matrix<2> noise(const State&, const Part&) const { return {}; }
};

auto step(cairn::ConditionalParticles<cairn::Vector<1>, cairn::Vector<3>>& belief, const Broken& sensor,
          const cairn::Vector<2>& z, cairn::Random& random) {
  return cairn::RaoBlackwell{}.update(belief, 0, sensor, z, random);
}
