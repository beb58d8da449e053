// words: cairn: rate(x, u) of a process; Expected<3, 1, double>; Found<2, 1, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman_bucy.hpp>

#include "models.hpp"

struct Continuous : Process {
  cairn::Vector<3> rate(const State&, const Control&) const { return {}; }
  cairn::Matrix<3> rate_jacobian(const State&, const Control&) const { return {}; }
  cairn::Matrix<3> spectral_density(const State&, const Control&) const { return {}; }
};
struct Broken : Continuous {
  cairn::Vector<2> rate(const State&, const Control&) const { return {}; }
};

auto step(Belief& belief, const Broken& process, const cairn::Vector<2>& u) {
  return cairn::KalmanBucy{}.predict(belief, process, 1.0, u);
}
