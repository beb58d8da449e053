// words: cairn: this process has a Control, which is not zero by default: give it as the last argument
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

auto step(Belief& belief, const Process& process) {
  return cairn::Kalman{}.predict(belief, process, 1.0);
}
