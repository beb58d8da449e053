// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Textures that are sampled without aliasing.
///
/// An image pyramid is averaged over the footprint of a pixel, which perspective makes a long thin ellipse:
/// probes along the long axis, each trilinear at the level of the short one (the idea of P. Heckbert, "Survey
/// of texture mapping", IEEE CG&A 6(11), 1986, and of Feline, SIGGRAPH 1999).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stereo_slam {

/// Grey levels in rows; the centre of texel (i, j) lies at (i + 0.5, j + 0.5).
struct Texels {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> grey;

  [[nodiscard]] std::uint8_t& at(int x, int y) { return grey[index(x, y)]; }
  [[nodiscard]] std::uint8_t at(int x, int y) const { return grey[index(x, y)]; }

private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
};

/// A point of a texture and how it moves with the pixel: (u, v) and its derivatives, in texels.
struct Footprint {
  float u = 0, v = 0;
  float du_dx = 0, dv_dx = 0;
  float du_dy = 0, dv_dy = 0;
};

/// A picture with its pyramid. Const methods are safe concurrently.
class Texture {
public:
  explicit Texture(Texels base);

  /// Mean grey (0..255) over the footprint of one pixel; the border texels go on outside.
  [[nodiscard]] float sample(const Footprint& footprint) const;

private:
  // One level with a border of one repeated texel, so that interpolation needs no test.
  struct Level {
    float scale = 1;  // texels of this level a texel of the base
    float right = 0, bottom = 0;
    int stride = 0;
    std::vector<std::uint8_t> grey;
  };

  static Level padded(const Texels& texels, float scale);
  static float bilinear(const Level& level, float u, float v);

  std::vector<Level> levels_;
};

}  // namespace stereo_slam
