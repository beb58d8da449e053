// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "arena_renderer.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>

#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>

namespace stereo_slam {
namespace {

using Row3 = cairn::Vector<3>;

constexpr int sky = -1;

// A function of the pixel that is linear along x: value at x = 0 of a row, and slope.
struct Linear {
  double at_zero = 0;
  double slope = 0;
  [[nodiscard]] double operator()(double x) const { return at_zero + slope * x; }
};

Linear on_row(const Row3& h, double y) {
  return {h(1) * y + h(2), h(0)};
}

struct Interval {
  double first = 0;
  double last = 0;
  // Keeps the part where f >= 0.
  void keep(const Linear& f) {
    if (f.slope > 0)
      first = std::max(first, -f.at_zero / f.slope);
    else if (f.slope < 0)
      last = std::min(last, -f.at_zero / f.slope);
    else if (f.at_zero < 0)
      last = first - 1;
  }
};

// A panel as one camera sees it: (1) and (2).
struct Sight {
  const Panel* panel = nullptr;
  Row3 inverse_depth, along, up;

  [[nodiscard]] Interval span(double y, double right) const {
    const Linear inverse = on_row(inverse_depth, y), a = on_row(along, y), b = on_row(up, y);
    Interval interval{-0.5, right};
    interval.keep({inverse.at_zero - 1e-4, inverse.slope});  // nearer than 10 km and before the camera
    interval.keep(a);
    interval.keep({panel->width * inverse.at_zero - a.at_zero, panel->width * inverse.slope - a.slope});
    interval.keep(b);
    interval.keep({panel->height * inverse.at_zero - b.at_zero, panel->height * inverse.slope - b.slope});
    return interval;
  }
};

std::vector<Sight> sights(const ArenaScene& scene, const Shot& shot) {
  cairn::Matrix<3> inverse_k;
  inverse_k << 1 / shot.focal, 0, -shot.centre_x / shot.focal, 0, 1 / shot.focal, -shot.centre_y / shot.focal,
      0, 0, 1;
  const cairn::Matrix<3> ray = shot.T_world_camera.rotation().matrix() * inverse_k;
  const cairn::Vector<3>& eye = shot.T_world_camera.translation();
  std::vector<Sight> seen;
  for (const Panel& panel : scene.panels()) {
    const cairn::Vector<3> normal = cairn::skew(panel.along) * panel.up;
    const cairn::Vector<3> to_panel = panel.origin - eye;
    const double height_over_panel = -normal.dot(to_panel);
    if (height_over_panel <= 1e-6) continue;  // seen from behind
    Sight sight;
    sight.panel = &panel;
    sight.inverse_depth = ray.transpose() * normal / -height_over_panel;
    sight.along = ray.transpose() * panel.along - panel.along.dot(to_panel) * sight.inverse_depth;
    sight.up = ray.transpose() * panel.up - panel.up.dot(to_panel) * sight.inverse_depth;
    seen.push_back(sight);
  }
  return seen;
}

// Approximately normal noise: the sum of four random bytes has sigma 147.8 and the tails of 3.45 sigma.
class Noise {
public:
  Noise(double sigma, std::uint64_t stream, int row)
      : random_(stream, static_cast<std::uint64_t>(row)), scale_(static_cast<float>(sigma / 147.80)) {}

  float operator()() {
    if (left_ == 0) {
      bits_ = random_();
      left_ = 2;
    }
    --left_;
    const auto word = static_cast<std::uint32_t>(bits_);
    bits_ >>= 32U;
    const std::uint32_t pairs = (word & 0x00ff00ffU) + (word >> 8U & 0x00ff00ffU);
    return scale_ * (static_cast<float>((pairs & 0xffffU) + (pairs >> 16U)) - 510.0F);
  }

private:
  cairn::Random random_;
  float scale_;
  std::uint64_t bits_ = 0;
  int left_ = 0;
};

// Renders rows of one shot. Each thread has its own.
class RowRenderer {
public:
  RowRenderer(const ArenaScene& scene, const Shot& shot) : shot_(shot), sights_(sights(scene, shot)) {}

  void render(int y, std::uint8_t* row) {
    if (y != above_row_) see_corners(y, above_);
    see_corners(y + 1, below_);
    Noise noise(shot_.noise, shot_.noise_stream, y);
    const auto exposure = static_cast<float>(shot_.exposure);
    for (int x = 0; x < shot_.width; ++x) {
      const auto i = static_cast<std::size_t>(x);
      const int id = above_[i];
      const bool one = id == above_[i + 1] && id == below_[i] && id == below_[i + 1];
      const float light = one ? radiance(id, x, y, 1) : mixed(x, y);
      row[x] = static_cast<std::uint8_t>(std::clamp(light * exposure + noise(), 0.0F, 255.0F) + 0.5F);
    }
    std::swap(above_, below_);
    above_row_ = y + 1;
  }

private:
  // Which panel the corner at (x - 0.5, y - 0.5) sees, for x = 0 .. width.
  void see_corners(int y, std::vector<int>& ids) {
    const double line = y - 0.5;
    const auto count = static_cast<std::size_t>(shot_.width) + 1;
    ids.assign(count, sky);
    nearest_.assign(count, 0.0);
    for (std::size_t k = 0; k < sights_.size(); ++k) {
      const Interval interval = sights_[k].span(line, shot_.width - 0.5);
      if (!(interval.first <= interval.last)) continue;
      const Linear inverse = on_row(sights_[k].inverse_depth, line);
      const auto first = static_cast<std::size_t>(std::ceil(interval.first + 0.5));
      const auto last = static_cast<std::size_t>(std::floor(interval.last + 0.5));
      for (std::size_t i = first; i <= last && i < count; ++i) {
        const double depth = inverse(static_cast<double>(i) - 0.5);
        if (depth <= nearest_[i]) continue;
        nearest_[i] = depth;
        ids[i] = static_cast<int>(k);
      }
    }
  }

  // The grey of the panel at a pixel; `pixel` is the side of the area to average over.
  [[nodiscard]] float radiance(int id, double x, double y, float pixel) const {
    if (id == sky) return background(x, y);
    const Sight& sight = sights_[static_cast<std::size_t>(id)];
    const Panel& panel = *sight.panel;
    const Row3 p(x, y, 1);
    const double depth = 1 / sight.inverse_depth.dot(p);
    const double a = sight.along.dot(p) * depth;
    const double b = sight.up.dot(p) * depth;
    const double scale = depth * ArenaScene::texels_per_metre * static_cast<double>(pixel);
    Footprint f;
    f.u = static_cast<float>(panel.texture_u + a * ArenaScene::texels_per_metre);
    f.v = static_cast<float>(panel.texture_v + (panel.height - b) * ArenaScene::texels_per_metre);
    f.du_dx = static_cast<float>(scale * (sight.along(0) - a * sight.inverse_depth(0)));
    f.du_dy = static_cast<float>(scale * (sight.along(1) - a * sight.inverse_depth(1)));
    f.dv_dx = static_cast<float>(-scale * (sight.up(0) - b * sight.inverse_depth(0)));
    f.dv_dy = static_cast<float>(-scale * (sight.up(1) - b * sight.inverse_depth(1)));
    return panel.light * panel.texture->sample(f);
  }

  // The hall behind the fence: dark, a little lighter towards the horizon.
  [[nodiscard]] float background(double x, double y) const {
    const cairn::Vector<3> ray =
        shot_.T_world_camera.rotation() *
        cairn::Vector<3>((x - shot_.centre_x) / shot_.focal, (y - shot_.centre_y) / shot_.focal, 1);
    const double slope = ray(2) / std::sqrt(ray(0) * ray(0) + ray(1) * ray(1) + 1e-12);
    return static_cast<float>(22 + 26 * std::exp(-std::abs(slope) / 0.12));
  }

  [[nodiscard]] float mixed(int x, int y) const {
    constexpr int side = 4;
    float sum = 0;
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) {
        const double sub_x = x - 0.5 + (i + 0.5) / side;
        const double sub_y = y - 0.5 + (j + 0.5) / side;
        sum += radiance(first_hit(sub_x, sub_y), sub_x, sub_y, 1.0F / side);
      }
    return sum / (side * side);
  }

  [[nodiscard]] int first_hit(double x, double y) const {
    const Row3 p(x, y, 1);
    double nearest = 1e-4;
    int id = sky;
    for (std::size_t k = 0; k < sights_.size(); ++k) {
      const double depth = sights_[k].inverse_depth.dot(p);
      if (depth <= nearest) continue;
      const double a = sights_[k].along.dot(p), b = sights_[k].up.dot(p);
      if (a < 0 || b < 0 || a > sights_[k].panel->width * depth || b > sights_[k].panel->height * depth)
        continue;
      nearest = depth;
      id = static_cast<int>(k);
    }
    return id;
  }

  const Shot& shot_;
  std::vector<Sight> sights_;
  std::vector<int> above_, below_;
  std::vector<double> nearest_;
  int above_row_ = std::numeric_limits<int>::min();
};

}  // namespace

std::vector<cairn::Image> render(const ArenaScene& scene, std::span<const Shot> shots, unsigned threads) {
  std::vector<cairn::Image> pictures;
  std::vector<std::size_t> starts{0};  // rows of all shots, one below the other
  for (const Shot& shot : shots) {
    pictures.emplace_back(shot.width, shot.height);
    starts.push_back(starts.back() + static_cast<std::size_t>(shot.height));
  }
  cairn::parallel_for(starts.back(), threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = 0; k < shots.size(); ++k) {
      const std::size_t first = std::max(begin, starts[k]), last = std::min(end, starts[k + 1]);
      if (first >= last) continue;
      RowRenderer renderer(scene, shots[k]);
      for (std::size_t i = first; i < last; ++i) {
        const auto y = static_cast<int>(i - starts[k]);
        renderer.render(y, pictures[k].row(y));
      }
    }
  });
  return pictures;
}

}  // namespace stereo_slam
