// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include <cairn/vision/image.hpp>

namespace stereo_slam {

/// Grey level between pixels, bilinear; the caller keeps (x, y) a pixel away from the right and lower rim.
[[nodiscard]] inline float grey_level(cairn::ImageView image, float x, float y) {
  const int column = static_cast<int>(x);
  const int line = static_cast<int>(y);
  const float fx = x - static_cast<float>(column);
  const float fy = y - static_cast<float>(line);
  const std::uint8_t* top = image.row(line) + column;
  const std::uint8_t* bottom = top + image.stride();
  const float above = static_cast<float>(top[0]) + fx * static_cast<float>(top[1] - top[0]);
  const float below = static_cast<float>(bottom[0]) + fx * static_cast<float>(bottom[1] - bottom[0]);
  return above + fy * (below - above);
}

}  // namespace stereo_slam
