// words: cairn: Timeline and Recorder run filters of one Gaussian belief and one process; Interacting
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/interacting.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/timeline.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

using Line = cairn::Timeline<cairn::Interacting<2, cairn::Kalman>, cairn::ConstantVelocity<2>,
                             cairn::PositionSensor<2, 4>>;
static_assert(sizeof(Line) > 0);
