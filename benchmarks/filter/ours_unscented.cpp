// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>
#include <cairn/filter/vectorised.hpp>

#include "rivals.hpp"
#include "runs.hpp"

namespace cairn_bench {
namespace {

// kappa = 3 - n, as the hand-written filter and the textbooks have it.
double unscented_5_2(int count) {
  return run_vehicle(cairn::Unscented{.points = {.alpha = 1, .beta = 0, .kappa = -2}},
                     cairn::vectorised(Vehicle{}), cairn::vectorised(Beacon{}), count);
}
double unscented_9_3(int count) {
  static const auto z = noise<3>(64, 0.3);
  return run_linear(cairn::Unscented{.points = {.alpha = 1, .beta = 0, .kappa = -6}}, unit_prior<9>(),
                    cairn::vectorised(Coupled{}), cairn::vectorised(CoupledSensor{}), z, count);
}

}  // namespace

Rival ours_unscented() {
  Rival rival{"ours"};
  rival.unscented_5_2 = unscented_5_2;
  rival.unscented_9_3 = unscented_9_3;
  return rival;
}

}  // namespace cairn_bench
