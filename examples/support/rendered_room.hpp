// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A room of six painted walls and pictures of it: what the lesson on visual SLAM drives through.
///
/// The room is the box |x|, |y|, |z| <= half; x right, y down, z ahead of the first camera. A picture is one
/// ray a pixel: where p = c + t d leaves the box, t the least of (half_i sign d_i - c_i) / d_i, the paint
/// there is interpolated between four texels. All that is random comes from one seed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/vision/image.hpp>

namespace example {

class RenderedRoom {
public:
  /// Paints the walls with spots of 3 to 30 cm.
  RenderedRoom(const cairn::Vector<3>& half, std::uint64_t seed) : half_(half) {
    for (std::size_t wall = 0; wall < walls_.size(); ++wall) {
      cairn::Random random(seed, wall);
      walls_[wall].assign(texels * texels, 128);
      for (int spot = 0; spot < 1200; ++spot) paint_spot(walls_[wall], random);
    }
  }

  /// Where a ray from inside meets a wall.
  [[nodiscard]] cairn::Vector<3> hit(const cairn::Vector<3>& from, const cairn::Vector<3>& direction) const {
    return from + reach(from, direction).t * direction;
  }

  /// How far a point is from the nearest wall [m].
  [[nodiscard]] double distance_to_wall(const cairn::Vector<3>& p) const {
    double nearest = 1e9;
    for (int i = 0; i < 3; ++i) nearest = std::min(nearest, std::abs(half_(i) - std::abs(p(i))));
    return nearest;
  }

  /// What a camera without distortion sees, with noise of `sigma` grey levels.
  [[nodiscard]] cairn::Image picture(const cairn::PinholeCamera& camera, const cairn::SE3& T_world_camera,
                                     double sigma, cairn::Random& random) const {
    cairn::Image image(camera.width(), camera.height());
    const cairn::Matrix<3> turn = T_world_camera.rotation().matrix();
    const cairn::Vector<3> from = T_world_camera.translation();
    for (int v = 0; v < image.height(); ++v)
      for (int u = 0; u < image.width(); ++u) {
        const cairn::Vector<3> ray((u - camera.cx()) / camera.fx(), (v - camera.cy()) / camera.fy(), 1);
        const double grey = paint(from, cairn::product(turn, ray)) + sigma * random.normal();
        image.row(v)[u] = static_cast<std::uint8_t>(std::clamp(grey + 0.5, 0.0, 255.0));
      }
    return image;
  }

private:
  static constexpr std::size_t texels = 512;
  using Wall = std::vector<float>;

  struct Reach {
    double t;
    int axis;
  };
  [[nodiscard]] Reach reach(const cairn::Vector<3>& from, const cairn::Vector<3>& d) const {
    Reach nearest{1e9, 0};
    for (int i = 0; i < 3; ++i) {
      if (d(i) == 0) continue;
      const double t = ((d(i) > 0 ? half_(i) : -half_(i)) - from(i)) / d(i);
      if (t < nearest.t) nearest = {t, i};
    }
    return nearest;
  }

  [[nodiscard]] double paint(const cairn::Vector<3>& from, const cairn::Vector<3>& d) const {
    const auto [t, axis] = reach(from, d);
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    const double longest = std::max({half_(0), half_(1), half_(2)}), scale = (texels - 2) / (2 * longest);
    const double x = std::clamp((from(a) + t * d(a) + half_(a)) * scale, 0.0, texels - 2.0);
    const double y = std::clamp((from(b) + t * d(b) + half_(b)) * scale, 0.0, texels - 2.0);
    const auto column = static_cast<std::size_t>(x), row = static_cast<std::size_t>(y);
    const double right = x - static_cast<double>(column), down = y - static_cast<double>(row);
    const Wall& wall = walls_[static_cast<std::size_t>(2 * axis + (d(axis) > 0 ? 1 : 0))];
    const float* const p = wall.data() + row * texels + column;
    return (1 - down) * ((1 - right) * p[0] + right * p[1]) +
           down * ((1 - right) * p[texels] + right * p[texels + 1]);
  }

  static void paint_spot(Wall& wall, cairn::Random& random) {
    const double x = random.uniform(0, texels), y = random.uniform(0, texels), side = texels - 1.0;
    const double sigma = random.uniform(1.5, 7), strength = random.uniform(-90, 90);
    const auto first = [&](double middle) {
      return static_cast<std::size_t>(std::max(middle - 3 * sigma, 0.0));
    };
    const auto last = [&](double middle) {
      return static_cast<std::size_t>(std::min(middle + 3 * sigma, side));
    };
    for (std::size_t row = first(y); row <= last(y); ++row)
      for (std::size_t column = first(x); column <= last(x); ++column) {
        const double dx = static_cast<double>(column) - x, dy = static_cast<double>(row) - y;
        wall[row * texels + column] +=
            static_cast<float>(strength * std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma)));
      }
  }

  cairn::Vector<3> half_;
  std::array<Wall, 6> walls_;
};

}  // namespace example
