// words: cairn: a process says what steers it: using Control = cairn::NoControl; where nothing does
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>

struct Still {
  using State = cairn::Vector<2>;
  State propagate(const State& x, double) const { return x; }
  cairn::Matrix<2> noise(const State&, double) const { return cairn::Matrix<2>::Identity(); }
};
auto step(cairn::Gaussian<cairn::Vector<2>>& belief) {
  return cairn::Unscented{}.predict(belief, Still{}, 0.1);
}
