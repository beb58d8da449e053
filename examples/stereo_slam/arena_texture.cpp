// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "arena_texture.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace stereo_slam {
namespace {

// The next level of a pyramid: means of 2 x 2 texels (an odd last row or column goes with its neighbour).
Texels halved(const Texels& from) {
  Texels to{std::max(1, from.width / 2), std::max(1, from.height / 2), {}};
  to.grey.resize(static_cast<std::size_t>(to.width) * static_cast<std::size_t>(to.height));
  for (int y = 0; y < to.height; ++y)
    for (int x = 0; x < to.width; ++x) {
      const int x1 = std::min(2 * x + 1, from.width - 1);
      const int y1 = std::min(2 * y + 1, from.height - 1);
      const int sum = from.at(2 * x, 2 * y) + from.at(x1, 2 * y) + from.at(2 * x, y1) + from.at(x1, y1);
      to.at(x, y) = static_cast<std::uint8_t>((sum + 2) / 4);
    }
  return to;
}

}  // namespace

Texture::Texture(Texels base) {
  float scale = 1;
  levels_.push_back(padded(base, scale));
  while (base.width > 1 && base.height > 1) {
    base = halved(base);
    levels_.push_back(padded(base, scale /= 2));
  }
}

Texture::Level Texture::padded(const Texels& texels, float scale) {
  Level level;
  level.scale = scale;
  level.right = static_cast<float>(texels.width);
  level.bottom = static_cast<float>(texels.height);
  level.stride = texels.width + 2;
  level.grey.reserve(static_cast<std::size_t>(level.stride) * static_cast<std::size_t>(texels.height + 2));
  for (int y = -1; y <= texels.height; ++y)
    for (int x = -1; x <= texels.width; ++x)
      level.grey.push_back(
          texels.at(std::clamp(x, 0, texels.width - 1), std::clamp(y, 0, texels.height - 1)));
  return level;
}

float Texture::bilinear(const Level& level, float u, float v) {
  // The border shifts indices by one, the centre of a texel by one half.
  const float x = std::clamp(u * level.scale, 0.0F, level.right) + 0.5F;
  const float y = std::clamp(v * level.scale, 0.0F, level.bottom) + 0.5F;
  const int column = static_cast<int>(x);
  const int line = static_cast<int>(y);
  const float right = x - static_cast<float>(column);
  const float down = y - static_cast<float>(line);
  const std::uint8_t* p = level.grey.data() + static_cast<std::ptrdiff_t>(line) * level.stride + column;
  const auto a = static_cast<float>(p[0]), b = static_cast<float>(p[1]);
  const auto c = static_cast<float>(p[level.stride]), d = static_cast<float>(p[level.stride + 1]);
  const float top = a + right * (b - a);
  const float bottom = c + right * (d - c);
  return top + down * (bottom - top);
}

float Texture::sample(const Footprint& f) const {
  // The unit circle of pixels becomes an ellipse of texels; its axes are the singular values of the Jacobian.
  const float a = f.du_dx * f.du_dx + f.du_dy * f.du_dy;
  const float b = f.du_dx * f.dv_dx + f.du_dy * f.dv_dy;
  const float c = f.dv_dx * f.dv_dx + f.dv_dy * f.dv_dy;
  const float half = 0.5F * (a - c);
  const float root = std::sqrt(half * half + b * b);
  const float mean = 0.5F * (a + c);
  const float long_axis = std::sqrt(std::max(mean + root, 0.0F));
  constexpr float most_probes = 24;
  const float short_axis = std::max({std::sqrt(std::max(mean - root, 0.0F)), long_axis / most_probes, 1.0F});
  const float count = std::clamp(std::ceil(long_axis / short_axis), 1.0F, most_probes);

  float along_u = half + root,
        along_v = b;  // the eigenvector of the long axis, in the better conditioned form
  if (half < 0) {
    along_u = b;
    along_v = root - half;
  }
  const float norm = std::sqrt(along_u * along_u + along_v * along_v);
  const float step = norm > 0 ? long_axis / (norm * count) : 0;

  const float depth = std::min(std::log2(short_axis), static_cast<float>(levels_.size() - 1));
  const auto fine = std::min(static_cast<std::size_t>(depth), levels_.size() - 1);
  const std::size_t coarse = std::min(fine + 1, levels_.size() - 1);
  const float blend = depth - static_cast<float>(fine);
  float sum = 0;
  for (float k = 0.5F - 0.5F * count; k < 0.5F * count; k += 1) {
    const float u = f.u + k * step * along_u;
    const float v = f.v + k * step * along_v;
    const float sharp = bilinear(levels_[fine], u, v);
    sum += blend > 0 ? sharp + blend * (bilinear(levels_[coarse], u, v) - sharp) : sharp;
  }
  return sum / count;
}

}  // namespace stereo_slam
