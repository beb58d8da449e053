// words: cairn: the measurement or control that was given; Expected<2, 1, double>; Found<2, 1, float>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

auto step(Belief& belief, const Process& process, const cairn::Vector<2, float>& u) {
  return cairn::Kalman{}.predict(belief, process, 1.0, u);
}
