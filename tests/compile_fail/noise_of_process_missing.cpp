// words: cairn: a process needs `noise(const State&, const Control&, double dt) const`
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/extended.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<3>;
  using Control = cairn::NoControl;
  State propagate(const State& x, const Control&, double) const { return x; }
  cairn::Matrix<3> jacobian(const State&, const Control&, double) const { return {}; }
};

auto step(Belief& belief, const Broken& process) {
  return cairn::Extended{}.predict(belief, process, 0.1);
}
