// words: cairn: predict() of a sensor returns its Measurement
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/unscented.hpp>
#include <cairn/manifold/so2.hpp>

#include "models.hpp"

struct Broken {
  using State = cairn::Vector<3>;
  using Measurement = cairn::SO2;
  double predict(const State& x) const { return x(0); }
  cairn::Matrix<1> noise(const State&) const { return {}; }
};

auto step(Belief& belief, const Broken& sensor, const cairn::SO2& z) {
  return cairn::Unscented{}.update(belief, sensor, z);
}
