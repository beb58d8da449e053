// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "terrain.hpp"

#include <algorithm>
#include <cmath>

#include <cairn/core/random.hpp>

namespace gamma_slam {

using cairn::Vector;

Terrain::Terrain(std::uint64_t seed) : heights_(static_cast<std::size_t>(side) * side) {
  cairn::Random random(seed);
  const auto anywhere = [&] { return random.uniform(-half_side, half_side); };
  for (int i = 0; i < 60; ++i) {  // hollows
    const double rise = 0.25 * random.normal(), radius = random.uniform(4, 9), y = anywhere(), x = anywhere();
    add_bump(x, y, radius, rise);
  }
  for (int i = 0; i < 900; ++i) {  // rocks
    const double x = anywhere(), y = anywhere(), radius = random.uniform(0.3, 0.9);
    add_bump(x, y, radius, random.uniform(0.15, 0.6) * radius);
  }
  for (int i = 0; i < 24; ++i)
    waves_.push_back(static_cast<float>(i % 3 < 2 ? random.uniform(-0.9, 0.9) : random.uniform(0, 6.28)));
}

void Terrain::add_bump(double x, double y, double radius, double rise) {
  const auto index = [](double at) {
    return std::clamp(static_cast<int>((at + half_side) / spacing), 0, side - 1);
  };
  const double reach = 1.5 * radius;
  for (int row = index(y - reach); row <= index(y + reach); ++row)
    for (int column = index(x - reach); column <= index(x + reach); ++column) {
      const double dx = column * spacing - half_side - x, dy = row * spacing - half_side - y;
      const double share = 1 - (dx * dx + dy * dy) / (reach * reach);
      if (share > 0)
        heights_[static_cast<std::size_t>(row) * side + static_cast<std::size_t>(column)] +=
            static_cast<float>(rise * share * share);
    }
}

double Terrain::height(double x, double y) const noexcept {
  const double most = side - 1.001;
  const double u = std::clamp((x + half_side) / spacing, 0.0, most),
               v = std::clamp((y + half_side) / spacing, 0.0, most);
  const auto column = static_cast<std::size_t>(u), row = static_cast<std::size_t>(v);
  const double a = u - static_cast<double>(column), b = v - static_cast<double>(row);
  const float* h = heights_.data() + row * side + column;
  return (1 - b) * ((1 - a) * h[0] + a * h[1]) + b * ((1 - a) * h[side] + a * h[side + 1]);
}

double Terrain::roughness(double x, double y) const noexcept {
  double wave = 0;
  for (std::size_t i = 0; i + 2 < waves_.size(); i += 3)
    wave += std::sin(waves_[i] * x + waves_[i + 1] * y + waves_[i + 2]);
  return wave > 0 ? 0.08 : 0.03;  // grass, gravel
}

double Terrain::sigma_in(double left, double bottom, double square) const {
  constexpr int samples = 12;  // to a side
  double sum = 0, squares = 0, rough = 0;
  const double first = height(left, bottom);
  for (int i = 0; i < samples * samples; ++i) {
    const double x = left + square * (i % samples + 0.5) / samples,
                 y = bottom + square * (i / samples + 0.5) / samples;
    const double h = height(x, y) - first, r = roughness(x, y);
    sum += h;
    squares += h * h;
    rough += r * r;
  }
  constexpr double n = samples * samples;
  return std::sqrt(std::max(0.0, squares / n - sum / n * (sum / n)) + rough / n);
}

std::optional<Vector<3>> Terrain::hit(const Vector<3>& from, const Vector<3>& direction, double reach) const {
  const auto above = [&](double at) {
    const Vector<3> p = from + at * direction;
    return p(2) - height(p(0), p(1));
  };
  constexpr double least_step = 0.03;
  double before = 0, gap = above(0);
  for (double at = 0; at < reach && gap > 0;) {
    before = at;
    at += std::max(least_step, 0.4 * gap);  // no rock's side is steep enough to be stepped over
    gap = above(at);
    if (gap > 0) continue;
    double low = before, high = at;
    for (int halving = 0; halving < 10; ++halving) {
      const double middle = 0.5 * (low + high);
      (above(middle) > 0 ? low : high) = middle;
    }
    return Vector<3>(from + high * direction);
  }
  return std::nullopt;
}

}  // namespace gamma_slam
