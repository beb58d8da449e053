// words: cairn: a process needs `State propagate(const State&, const Control&, double dt) const`
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<3>;
  using Control = cairn::NoControl;
  void propagate(State& x, const Control&, double) const { x *= 2; }
  cairn::Matrix<3> noise(const State&, const Control&, double) const { return {}; }
};

auto step(Belief& belief, const Broken& process) {
  return cairn::Unscented{}.predict(belief, process, 0.1);
}
