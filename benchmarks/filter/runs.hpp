// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The loops that every filter of cairn is timed in.
#pragma once

#include <cstddef>
#include <cstdio>
#include <cstdlib>

#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/manifold.hpp>

#include "problems.hpp"

namespace cairn_bench {

[[noreturn]] inline void fail(const char* what) {
  std::fprintf(stderr, "scoreboard_filter: %s\n", what);
  std::exit(1);
}

template <class Filter, class Belief, class F, class H, class Z>
double run_linear(const Filter& filter, Belief belief, const F& process, const H& sensor, const Z& z,
                  int count) {
  int refused = 0;
  for (int k = 0; k < count; ++k) {
    refused += filter.predict(belief, process, time_step) != cairn::Status::accepted ? 1 : 0;
    refused += filter.update(belief, sensor, z[static_cast<std::size_t>(k % 64)]).accepted() ? 0 : 1;
  }
  if (refused != 0) fail("a step was refused");
  if constexpr (requires { belief.covariance(); })
    return belief.covariance().trace();
  else
    return belief.covariance.trace();
}

/// The vehicle restarts every 64 steps, so that all filters stay near the same states.
template <class Filter, class F, class H>
double run_vehicle(const Filter& filter, const F& process, const H& sensor, int count) {
  static const auto z = noise<2>(64, 0.1);
  cairn::Gaussian<cairn::Vector<5>> belief{vehicle_start(), cairn::Matrix<5>::Identity()};
  int refused = 0;
  for (int k = 0; k < count; ++k) {
    if (k % 64 == 0) belief.mean = vehicle_start();
    refused += filter.predict(belief, process, time_step) != cairn::Status::accepted ? 1 : 0;
    const auto seen = cairn::retract(Beacon{}.predict(belief.mean), z[static_cast<std::size_t>(k % 64)]);
    refused += filter.update(belief, sensor, seen).accepted() ? 0 : 1;
  }
  if (refused != 0) fail("a step of the vehicle was refused");
  return belief.covariance.trace();
}

template <int N>
cairn::Gaussian<cairn::Vector<N>> unit_prior() {
  return {cairn::Vector<N>::Zero(), cairn::Matrix<N>::Identity()};
}

}  // namespace cairn_bench
