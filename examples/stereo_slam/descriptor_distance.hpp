// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How unlike two descriptors are.
#pragma once

#include <cstddef>
#include <span>

namespace stereo_slam {

/// Squared Euclidean distance of descriptors of one length. Sixteen independent sums let the compiler use
/// vector registers.
[[nodiscard]] inline float squared_distance(std::span<const float> a, std::span<const float> b) noexcept {
  constexpr std::size_t lanes = 16;
  float sums[lanes] = {};
  std::size_t i = 0;
  for (; i + lanes <= a.size(); i += lanes)
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const float difference = a[i + lane] - b[i + lane];
      sums[lane] += difference * difference;
    }
  float sum = 0;
  for (const float part : sums) sum += part;
  for (; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

}  // namespace stereo_slam
