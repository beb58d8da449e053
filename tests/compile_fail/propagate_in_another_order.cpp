// words: cairn: a process needs `State propagate(const State&, const Control&, double dt) const`
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<3>;
  using Control = cairn::Vector<2>;
  State propagate(const State& x, double, const Control&) const { return x; }
  cairn::Matrix<3> noise(const State&, const Control&, double) const { return {}; }
};

auto step(Belief& belief, const Broken& process, const cairn::Vector<2>& u) {
  return cairn::Unscented{}.predict(belief, process, 0.1, u);
}
