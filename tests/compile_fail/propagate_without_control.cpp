// words: cairn: a process needs `State propagate(const State&, const Control&, double dt) const`;
// cairn::NoControl SPDX-FileCopyrightText: 2026 The cairn authors SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<3>;
  using Control = cairn::NoControl;
  State propagate(const State& x, double) const { return x; }
  cairn::Matrix<3> noise(const State&, double) const { return {}; }
};

auto step(Belief& belief, const Broken& process) {
  return cairn::Unscented{}.predict(belief, process, 0.1);
}
