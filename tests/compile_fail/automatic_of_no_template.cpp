// words: cairn: automatic(); template; numeric()
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>

#include "models.hpp"

auto step(Belief& belief, const Process& process) {
  return cairn::Extended{}.predict(belief, cairn::automatic(process), 0.1, cairn::Vector<2>(1, 2));
}
