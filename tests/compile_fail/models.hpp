// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Models that keep their promises; each file beside this breaks one.
#pragma once

#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>

struct Process {
  using State = cairn::Vector<3>;
  using Control = cairn::Vector<2>;
  static constexpr bool linear = true;
  State propagate(const State& x, const Control&, double) const { return x; }
  cairn::Matrix<3> jacobian(const State&, const Control&, double) const { return {}; }
  cairn::Matrix<3> noise(const State&, const Control&, double) const { return {}; }
};

struct Sensor {
  using State = cairn::Vector<3>;
  using Measurement = cairn::Vector<2>;
  static constexpr bool linear = true;
  Measurement predict(const State& x) const { return x.head<2>(); }
  cairn::Matrix<2, 3> jacobian(const State&) const { return {}; }
  cairn::Matrix<2> noise(const State&) const { return {}; }
};

using Belief = cairn::Gaussian<cairn::Vector<3>>;
