// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Odometry wherever it has its origin, as numbers that do not depend on it.
#pragma once

#include <cmath>

#include <cairn/manifold/se2.hpp>

namespace grid_slam {

/// A pose of odometry seen from an earlier one, to a micrometre and a microradian (2^-20): the same bits
/// wherever odometry has its origin, but for one pose in some millions. Without the rounding the last digits
/// differ, and a filter that draws and resamples makes another path of that after a thousand scans.
[[nodiscard]] inline cairn::SE2 seen_from(const cairn::SE2& first, const cairn::SE2& pose) {
  constexpr double fine = 1 << 20;
  const auto rounded = [](double number) { return std::round(number * fine) / fine; };
  const cairn::SE2 seen = first.inverse() * pose;
  return {rounded(seen.x()), rounded(seen.y()), rounded(seen.angle())};
}

}  // namespace grid_slam
