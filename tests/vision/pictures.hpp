// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Images made for tests, and exact changes of images.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/vision/image.hpp>

namespace cairn_test {

inline std::uint8_t grey(double level) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(level, 0.0, 255.0)));
}

/// Grey 128 with one Gaussian of the given height added.
inline cairn::Image blob(int width, int height, double x, double y, double sigma, double contrast) {
  cairn::Image image(width, height);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const double squared = (column - x) * (column - x) + (row - y) * (row - y);
      image(column, row) = grey(128 + contrast * std::exp(-0.5 * squared / (sigma * sigma)));
    }
  return image;
}

/// Bright and dark Gaussian blobs of many sizes on grey, levels within 128 +- `range`.
inline cairn::Image texture(int width, int height, std::uint64_t seed, double range = 120) {
  cairn::Random random(seed);
  std::vector<double> levels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0.0);
  const int blobs = width * height / 50;
  for (int i = 0; i < blobs; ++i) {
    const double sigma = 1.3 * std::exp2(3.5 * random.uniform() * random.uniform());
    const double x = random.uniform(0, width), y = random.uniform(0, height);
    const double contrast = random.uniform(-60, 60);
    const double aspect = random.uniform(0.6, 1.6);
    const int reach = static_cast<int>(4 * sigma);
    for (int row = std::max(0, static_cast<int>(y) - reach);
         row < std::min(height, static_cast<int>(y) + reach); ++row)
      for (int column = std::max(0, static_cast<int>(x) - reach);
           column < std::min(width, static_cast<int>(x) + reach); ++column) {
        const double dx = (column - x) / aspect, dy = (row - y) * aspect;
        levels[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
               static_cast<std::size_t>(column)] +=
            contrast * std::exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma));
      }
  }
  cairn::Image image(width, height);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column)
      image(column, row) =
          grey(128 + std::clamp(levels[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                                       static_cast<std::size_t>(column)],
                                -range, range));
  return image;
}

/// Every pixel drawn by itself.
inline cairn::Image noise(int width, int height, std::uint64_t seed) {
  cairn::Random random(seed);
  cairn::Image image(width, height);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column)
      image(column, row) = static_cast<std::uint8_t>(random.below(256));
  return image;
}

/// Image of which pixel (x, y) is source(x, y) of any callable.
template <class Source>
cairn::Image picture(int width, int height, Source&& source) {
  cairn::Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image(x, y) = source(x, y);
  return image;
}

/// Turned by a quarter from +x towards +y: what was at (x, y) is at (height - 1 - y, x).
inline cairn::Image quarter_turn(const cairn::Image& image) {
  return picture(image.height(), image.width(),
                 [&](int x, int y) { return image(y, image.height() - 1 - x); });
}

inline cairn::Image inverted(const cairn::Image& image) {
  return picture(image.width(), image.height(),
                 [&](int x, int y) { return static_cast<std::uint8_t>(255 - image(x, y)); });
}

}  // namespace cairn_test
