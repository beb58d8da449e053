// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Grids in degrees of longitude and latitude, taken for flat.
#pragma once

#include <cmath>
#include <numbers>

#include <cairn/field/grid.hpp>

namespace correlation_navigation {

/// Spacings in metres of a grid in degrees around a latitude [degrees], on a sphere of the Earth's mean
/// radius: right to 0.6 % where the latitude is (the ellipsoid's degrees are longer towards the poles). Half
/// a degree further from the equator those to the east are shorter by 0.9 % tan(latitude).
[[nodiscard]] inline cairn::GridFrame frame_in_metres(double dx_degrees, double dy_degrees, double latitude) {
  constexpr double metres_a_degree = 6371008.8 * std::numbers::pi / 180.0;
  const double along_parallel = metres_a_degree * std::cos(latitude * std::numbers::pi / 180.0);
  return {0, 0, dx_degrees * along_parallel, dy_degrees * metres_a_degree};
}

}  // namespace correlation_navigation
