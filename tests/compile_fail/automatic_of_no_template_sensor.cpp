// words: cairn: automatic(); template; numeric()
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>

#include "models.hpp"

auto step(Belief& belief, const Sensor& sensor, const cairn::Vector<2>& z) {
  return cairn::Extended{}.update(belief, cairn::automatic(sensor), z);
}
