// words: cairn: noise(x) of a sensor; Expected<2, 2, double>; Found<3, 3, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/information.hpp>

#include "models.hpp"

struct Broken : Sensor {
  cairn::Matrix<3> noise(const State&) const { return {}; }
};

auto step(cairn::InformationBelief<cairn::Vector<3>>& belief, const Broken& sensor,
          const cairn::Vector<2>& z) {
  return cairn::InformationFilter{}.update(belief, sensor, z);
}
