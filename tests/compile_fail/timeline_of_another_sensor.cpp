// words: cairn: this Timeline knows no sensor of this type; PlanarPosition
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/extended.hpp>
#include <cairn/filter/timeline.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

auto step(cairn::Timeline<cairn::Extended, cairn::Unicycle, cairn::Compass>& line) {
  return line.measure(cairn::PlanarPosition{}, cairn::Vector<2>(1, 1), 0.1);
}
