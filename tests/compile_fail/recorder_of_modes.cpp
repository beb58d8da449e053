// words: cairn: Timeline and Recorder run filters of one Gaussian belief and one process; Interacting
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/interacting.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/models/motion.hpp>

auto step(cairn::Recorder<cairn::Interacting<2, cairn::Kalman>, cairn::Vector<4>>& record) {
  return record.predict(cairn::ConstantVelocity<2>{}, 0.1);
}
