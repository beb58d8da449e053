// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "arena_ground.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>

namespace stereo_slam {
namespace {

// One octave of noise: random numbers on a lattice, joined by cubic B-splines.
class Octave {
public:
  Octave(int width, int height, int cell, double amplitude, cairn::Random& random)
      : cell_(cell), columns_(width / cell + 4), lattice_(cells(columns_, height / cell + 4)) {
    for (float& value : lattice_) value = static_cast<float>(amplitude * random.uniform(-1.0, 1.0));
    for (int i = 0; i < cell; ++i)
      weights_.push_back(spline(static_cast<float>(i) / static_cast<float>(cell)));
  }

  // Adds row y of the octave to `row`; `scratch` is reused between calls.
  void add_row(int y, std::vector<float>& row, std::vector<float>& scratch) const {
    const std::array<float, 4>& down = weights_[static_cast<std::size_t>(y % cell_)];
    const auto columns = static_cast<std::size_t>(columns_);
    const float* first = lattice_.data() + static_cast<std::size_t>(y / cell_) * columns;
    scratch.resize(columns);
    for (std::size_t i = 0; i < columns; ++i)
      scratch[i] = down[0] * first[i] + down[1] * first[i + columns] + down[2] * first[i + 2 * columns] +
                   down[3] * first[i + 3 * columns];
    const std::size_t cell = weights_.size();
    for (std::size_t x = 0, i = 0; x < row.size(); ++i)
      for (std::size_t k = 0; k < cell && x < row.size(); ++k, ++x)
        row[x] += weights_[k][0] * scratch[i] + weights_[k][1] * scratch[i + 1] +
                  weights_[k][2] * scratch[i + 2] + weights_[k][3] * scratch[i + 3];
  }

private:
  static std::size_t cells(int columns, int rows) {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
  static std::array<float, 4> spline(float t) {
    const float s = 1 - t;
    return {s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6,
            t * t * t / 6};
  }

  int cell_;
  int columns_;
  std::vector<float> lattice_;
  std::vector<std::array<float, 4>> weights_;
};

struct Crater {
  float x, y, radius;  // [texels]
  float depth;         // [texels]
};

// Craters of every size from a few texels up; each factor of two in diameter covers the same share of ground.
std::vector<Crater> scatter_craters(const GroundOptions& options, cairn::Random& random) {
  std::vector<Crater> craters;
  constexpr double smallest = 5;  // [texels]
  const double largest = options.largest_crater * options.texels_per_metre;
  for (double diameter = smallest; diameter < largest; diameter *= 2) {
    const double expected = options.crater_density * options.width * options.height / (diameter * diameter);
    const auto count = static_cast<int>(expected + random.uniform());
    for (int i = 0; i < count; ++i) {
      const double u = random.uniform();
      const double drawn = diameter / std::sqrt(1 - 0.75 * u);  // density ~ D^-3 between D and 2 D
      const double freshness = random.uniform(0.35, 1.0);
      craters.push_back({static_cast<float>(random.uniform(0, options.width)),
                         static_cast<float>(random.uniform(0, options.height)), static_cast<float>(drawn / 2),
                         static_cast<float>(0.16 * drawn * freshness)});
    }
  }
  return craters;
}

// Height of a crater of unit radius and depth at the squared distance r2: a bowl inside a raised rim.
float crater_profile(float r2) {
  constexpr float reach2 = 1.7F * 1.7F;
  if (r2 >= reach2) return 0;
  const float fade = 1 - r2 / reach2;
  const float rim = 0.35F * fade * fade;
  if (r2 >= 1) return rim;
  const float bowl = 1 - r2;
  return rim - bowl * bowl * 0.6F - bowl * 0.4F;
}

// Rows of a height field, from `begin` on.
struct Relief {
  int begin = 0;
  int width = 0;
  std::vector<float> height;  // [texels]

  [[nodiscard]] float* row(int y) {
    return height.data() + static_cast<std::size_t>(y - begin) * static_cast<std::size_t>(width);
  }
  void dig(const Crater& crater, int end) {
    const float reach = 1.7F * crater.radius;
    const int y0 = std::max(begin, static_cast<int>(std::ceil(crater.y - reach)));
    const int y1 = std::min(end - 1, static_cast<int>(std::floor(crater.y + reach)));
    const int x0 = std::max(0, static_cast<int>(std::ceil(crater.x - reach)));
    const int x1 = std::min(width - 1, static_cast<int>(std::floor(crater.x + reach)));
    const float inverse = 1 / (crater.radius * crater.radius);
    for (int y = y0; y <= y1; ++y) {
      const float dy = static_cast<float>(y) - crater.y;
      float* line = row(y);
      for (int x = x0; x <= x1; ++x) {
        const float dx = static_cast<float>(x) - crater.x;
        line[x] += crater.depth * crater_profile((dx * dx + dy * dy) * inverse);
      }
    }
  }
};

// Octaves from `finest` texels a cell up; the amplitude is gain * cell^exponent: 0 gives each the same
// height, 1 the same slope.
std::vector<Octave> octaves(const GroundOptions& options, int finest, double gain, double exponent,
                            cairn::Random& random) {
  constexpr int coarsest = 512;
  std::vector<Octave> result;
  for (int cell = finest; cell <= std::min(options.width / 2, coarsest); cell *= 2)
    result.emplace_back(options.width, options.height, cell, gain * std::pow(cell, exponent), random);
  return result;
}

class Ground {
public:
  explicit Ground(const GroundOptions& options)
      : options_(options),
        random_(options.seed, 0x6d6f6f6e),
        roughness_(octaves(options, 2, options.roughness, 1, random_)),
        albedo_(octaves(options, 16, options.mottling, 0, random_)),
        craters_(scatter_craters(options, random_)) {}

  // Fills rows [begin, end) of the picture.
  void shade_rows(int begin, int end, Texels& texels) const {
    Relief relief;
    relief.begin = std::max(0, begin - 1);
    relief.width = options_.width;
    const int last = std::min(options_.height, end + 1);
    raise_rows(relief, last);
    std::vector<float> tint(static_cast<std::size_t>(options_.width));
    std::vector<float> scratch;
    for (int y = begin; y < end; ++y) {
      std::fill(tint.begin(), tint.end(), 1.0F);
      for (const Octave& octave : albedo_) octave.add_row(y, tint, scratch);
      shade_row(relief, y, last, tint, texels);
    }
  }

private:
  void raise_rows(Relief& relief, int last) const {
    const auto width = static_cast<std::size_t>(relief.width);
    relief.height.assign(width * static_cast<std::size_t>(last - relief.begin), 0.0F);
    std::vector<float> line(width);
    std::vector<float> scratch;
    for (int y = relief.begin; y < last; ++y) {
      std::fill(line.begin(), line.end(), 0.0F);
      for (const Octave& octave : roughness_) octave.add_row(y, line, scratch);
      std::copy(line.begin(), line.end(), relief.row(y));
    }
    for (const Crater& crater : craters_) relief.dig(crater, last);
  }

  // Lambert's law for the slope of the relief, the sun to the upper left.
  void shade_row(Relief& relief, int y, int last, const std::vector<float>& tint, Texels& texels) const {
    const float* above = relief.row(std::max(y - 1, relief.begin));
    const float* here = relief.row(y);
    const float* below = relief.row(std::min(y + 1, last - 1));
    const auto sun_z = static_cast<float>(std::sin(options_.sun_elevation));
    const auto sun_xy = static_cast<float>(std::cos(options_.sun_elevation) * std::numbers::sqrt2 / 2);
    const auto flat = static_cast<float>(255 * options_.albedo) / sun_z;
    for (int x = 0; x < options_.width; ++x) {
      const float slope_x = 0.5F * (here[std::min(x + 1, options_.width - 1)] - here[std::max(x - 1, 0)]);
      const float slope_y = 0.5F * (below[x] - above[x]);
      const float facing = sun_z + sun_xy * (slope_x + slope_y);
      const float light = std::max(0.06F, facing / std::sqrt(1 + slope_x * slope_x + slope_y * slope_y));
      const float grey = flat * tint[static_cast<std::size_t>(x)] * light;
      texels.at(x, y) = static_cast<std::uint8_t>(std::clamp(grey, 0.0F, 255.0F) + 0.5F);
    }
  }

  GroundOptions options_;
  cairn::Random random_;
  std::vector<Octave> roughness_;
  std::vector<Octave> albedo_;
  std::vector<Crater> craters_;
};

}  // namespace

Texels moon_ground(const GroundOptions& options, unsigned threads) {
  Texels texels{options.width, options.height, {}};
  texels.grey.resize(static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height));
  const Ground ground(options);
  constexpr int band = 256;  // rows whose heights are in memory at once, per thread
  const auto bands = static_cast<std::size_t>((options.height + band - 1) / band);
  cairn::parallel_for(bands, threads, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      const int begin = static_cast<int>(i) * band;
      ground.shade_rows(begin, std::min(options.height, begin + band), texels);
    }
  });
  return texels;
}

}  // namespace stereo_slam
