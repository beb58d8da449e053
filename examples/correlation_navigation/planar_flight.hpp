// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A flight with turns over a mapped field: acquisition, tracking, a blind stretch, re-acquisition.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <cairn/field/grid.hpp>
#include <cairn/field/patch.hpp>

namespace correlation_navigation {

struct PlanarFlight {
  cairn::PatchShape shape{};
  double velocity = 150;  ///< [m/s]
  double interval = 2;    ///< between frames [s]
  std::size_t frames = 160;
  double start_sigma = 700;     ///< of the position at the start: 3 sigmas are 2 km [m]
  double drift_sigma = 4;       ///< of dead reckoning's velocity [m/s]
  double drift_density = 0.02;  ///< of the noise that changes it [m^2/s^3]
  double heading_sigma = 0.01;  ///< [rad]
  double scale_sigma = 0.01;    ///< relative
  double sensor_noise = 0.1;    ///< white, as a share of the field's standard deviation
  std::size_t blind_from = 80;  ///< the sensor sees nothing, a gust changes the drift by gust_x, gust_y
  std::size_t blind_until = 110;
  double gust_x = 9, gust_y = -6;  ///< [m/s]
  std::uint64_t seed = 1;
  std::function<void()> on_frame{};  ///< called after each frame; what it throws ends the flight
};

struct PlanarPoint {
  double time = 0, truth_x = 0, truth_y = 0, x = 0, y = 0;
  double error = 0;  ///< [m]
  double sigma = 0;  ///< root of the summed variances of x and y [m]
  bool tracking = false, searched = false, fixed = false, blind = false;
};

struct PlanarResult {
  std::vector<PlanarPoint> points;
  double rms_error = 0;  ///< of frames that were tracked [m]
  double max_error = 0;
  std::size_t searches = 0;
  std::size_t frames_tracked = 0;
  bool reacquired = false;  ///< tracking again after the blind stretch
};

/// Throws cairn::Error when the field is too small for the flight.
[[nodiscard]] PlanarResult fly_planar(const cairn::FieldGrid& field, const PlanarFlight& flight);

}  // namespace correlation_navigation
