// words: cairn: noise(x, u, dt) of a process; Expected<3, 3, double>; Found<3, 3, float>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

#include "models.hpp"

struct Broken : Process {
  cairn::Matrix<3, 3, float> noise(const State&, const Control&, double) const { return {}; }
};

auto step(Belief& belief, const Broken& process, const cairn::Vector<2>& u) {
  return cairn::Unscented{}.predict(belief, process, 1.0, u);
}
