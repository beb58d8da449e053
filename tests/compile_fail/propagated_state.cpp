// words: cairn: propagate() of a process; Expected<3, 1, double>; Found<2, 1, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

struct Broken : Process {
  cairn::Vector<2> propagate(const State& x, const Control&, double) const { return x.head<2>(); }
};

auto step(Belief& belief, const Broken& process, const cairn::Vector<2>& u) {
  return cairn::Kalman{}.predict(belief, process, 1.0, u);
}
