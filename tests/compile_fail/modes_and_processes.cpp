// words: cairn: Interacting<R, Filter> takes a std::tuple of R processes; OneProcessForEachMode<2, 3>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <tuple>

#include <cairn/filter/interacting.hpp>
#include <cairn/filter/kalman.hpp>

#include "models.hpp"

auto step(cairn::ModeBelief<cairn::Vector<3>, 2>& belief, const Process& process, const cairn::Vector<2>& u) {
  return cairn::Interacting<2, cairn::Kalman>{}.predict(belief, std::tuple(process, process, process), 0.1,
                                                        u);
}
