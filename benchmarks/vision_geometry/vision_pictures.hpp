// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Photographs, plane maps between two of them, and changed copies whose map is known exactly.
#pragma once

#include <array>
#include <filesystem>

#include <cairn/vision/image.hpp>

namespace vision_bench {

struct Place {
  double x, y;
};

/// A plane projective map, row by row.
struct Homography {
  std::array<double, 9> h{1, 0, 0, 0, 1, 0, 0, 0, 1};

  [[nodiscard]] Place operator()(Place at) const;
  [[nodiscard]] Homography inverse() const;
  /// Square root of the area that a unit square at this place is mapped to.
  [[nodiscard]] double scale(Place at) const;
};

/// Two images of one plane; `map` takes places of the first to the second.
struct Pair {
  cairn::Image first, second;
  Homography map;
};

/// An 8-bit grey image from a PNG file (luminance of ITU-R BT.601). Throws cairn::Error.
cairn::Image read_png(const std::filesystem::path& path);

cairn::Image cropped(const cairn::Image& image, int left, int top, int width, int height);

/// Turned about its middle by `degrees`, zoomed by `factor`; smoothed before where it shrinks.
Pair similar(const cairn::Image& image, double degrees, double factor);

/// Smoothed by a Gaussian.
Pair blurred(const cairn::Image& image, double sigma);

/// gain * level + offset, rounded and cut to 0..255.
Pair relit(const cairn::Image& image, double gain, double offset);

}  // namespace vision_bench
