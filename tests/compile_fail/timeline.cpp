// words: cairn: noise(x) of a sensor; Expected<2, 2, double>; Found<1, 1, double>
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/timeline.hpp>

#include "models.hpp"

struct Broken : Sensor {
  cairn::Matrix<1> noise(const State&) const { return {}; }
};

using Line = cairn::Timeline<cairn::Kalman, Process, Broken>;
