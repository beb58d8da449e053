// words: cairn: this filter needs the model's jacobian(); numeric(model)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/square_root.hpp>

#include "models.hpp"

struct Curved {
  using State = cairn::Vector<3>;
  using Control = cairn::NoControl;
  State propagate(const State& x, const Control&, double) const { return x; }
  cairn::Matrix<3> noise(const State&, const Control&, double) const { return {}; }
};

auto step(cairn::SquareRootGaussian<cairn::Vector<3>>& belief, const Curved& process) {
  return cairn::SquareRoot{}.predict(belief, process, 0.1);
}
