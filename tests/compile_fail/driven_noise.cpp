// words: cairn: noise(x, u, dt) of a process; Expected<2, 2, double>; Found<3, 3, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/ensemble.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<3>;
  using Control = cairn::Vector<2>;
  using Noise = cairn::Vector<2>;
  State propagate(const State& x, const Control&, const Noise&, double) const { return x; }
  cairn::Matrix<3> noise(const State&, const Control&, double) const { return {}; }
};

auto step(cairn::Ensemble<cairn::Vector<3>>& belief, const Broken& process, const cairn::Vector<2>& u,
          cairn::Random& random) {
  return cairn::EnsembleKalman{}.predict(belief, process, 1.0, random, u);
}
