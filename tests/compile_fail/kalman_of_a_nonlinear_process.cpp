// words: cairn: Kalman; linear = true; Extended
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

struct Curved : Process {
  static constexpr bool linear = false;
};

auto step(Belief& belief, const Curved& process) {
  return cairn::Kalman{}.predict(belief, process, 0.1, cairn::Vector<2>(1, 2));
}
