// words: cairn: a filter holds models as const: write "const" behind propagate(...)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/extended.hpp>

#include "models.hpp"

struct Broken : Process {
  State propagate(const State& x, const Control&, double) { return x; }
};

auto step(Belief& belief, const Broken& process) {
  return cairn::Extended{}.predict(belief, process, 0.1, cairn::Vector<2>(1, 2));
}
