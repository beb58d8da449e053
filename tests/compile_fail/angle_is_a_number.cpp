// words: cairn: what was given does not convert; SO2(0.3)
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/extended.hpp>
#include <cairn/models/sensor.hpp>

auto step(cairn::Gaussian<cairn::SE2>& belief) {
  return cairn::Extended{}.update(belief, cairn::Compass{}, 0.3);
}
