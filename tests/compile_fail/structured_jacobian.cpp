// words: cairn: jacobian(x, u, dt) of a process; Expected<3, 3, double>; Found<2, 2, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/square_root.hpp>

#include "models.hpp"

struct Broken : Process {
  cairn::Structured<"1* .1"> jacobian(const State&, const Control&, double dt) const { return {{dt}}; }
};

auto step(cairn::SquareRootGaussian<cairn::Vector<3>>& belief, const Broken& process,
          const cairn::Vector<2>& u) {
  return cairn::SquareRoot{}.predict(belief, process, 1.0, u);
}
