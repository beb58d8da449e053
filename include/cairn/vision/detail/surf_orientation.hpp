// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The dominant direction of the gradient around a keypoint, as SURF defines it.
///
/// Haar responses of side 4 s on a grid of spacing s inside the radius 6 s are weighted by a Gaussian of
/// 2.5 s; the longest sum of those whose directions share a sector of 60 degrees gives the direction. Every
/// sector that matters starts at a response, so they are sorted by direction and a window slides over them:
/// no angular step, O(n) after the sort. The grid is that of the descriptor, half a step off the keypoint:
/// n = 112.
/// Bay, Tuytelaars and Van Gool, ECCV 2006, section 4.1.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <cairn/version.hpp>
#include <cairn/vision/detail/cell_grid.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Grows with the direction of (x, y) from 0 at +x by way of 1 at +y to 4, without an arctangent. Zero has 0.
[[nodiscard, gnu::always_inline]] inline Float4 direction_order(Float4 x, Float4 y) noexcept {
  const Float4 sum = (x < 0 ? -x : x) + (y < 0 ? -y : y);
  const Float4 slope = y / (sum > 1e-30F ? sum : Float4{} + 1e-30F);
  const Float4 right = y < 0 ? 4 + slope : slope;
  return x < 0 ? 2 - slope : right;
}

/// The vectors of the samples, the order of their directions and that of the directions 60 degrees on.
struct Directions {
  static constexpr std::size_t count = 112;
  std::array<float, count> x, y, order, limit;

  void find_orders() noexcept {
    for (std::size_t i = 0; i < count; i += 4) {
      const auto x4 = load<Float4>(&x[i]);
      const auto y4 = load<Float4>(&y[i]);
      const Float4 from = direction_order(x4, y4);
      const Float4 to = direction_order(0.5F * x4 - 0.8660254F * y4, 0.8660254F * x4 + 0.5F * y4);
      store(from, &order[i]);
      store(to < from ? to + 4 : to, &limit[i]);
    }
  }

  /// Indices by growing direction: counted into 256 bins, then by insertion, which has little left to do.
  void sort(std::array<std::uint8_t, count>& sorted) const noexcept {
    constexpr int bins = 256;
    std::array<std::uint8_t, bins + 1> start{};
    const auto bin = [&](std::size_t i) {
      return static_cast<std::size_t>(std::min(static_cast<int>(order[i] * (bins / 4)), bins - 1));
    };
    for (std::size_t i = 0; i < count; ++i) ++start[bin(i) + 1];
    for (std::size_t b = 0; b < bins; ++b) start[b + 1] = static_cast<std::uint8_t>(start[b + 1] + start[b]);
    for (std::size_t i = 0; i < count; ++i) sorted[start[bin(i)]++] = static_cast<std::uint8_t>(i);
    for (std::size_t i = 1; i < count; ++i) {
      const std::uint8_t moved = sorted[i];
      std::size_t k = i;
      for (; k > 0 && order[sorted[k - 1]] > order[moved]; --k) sorted[k] = sorted[k - 1];
      sorted[k] = moved;
    }
  }
};

struct PlaneVector {
  double x = 0, y = 0;
};

/// The longest of the sums over windows of 60 degrees, one window starting at each vector.
[[nodiscard]] inline PlaneVector longest_sector(const Directions& vectors) noexcept {
  constexpr std::size_t count = Directions::count;
  std::array<std::uint8_t, count> sorted;
  vectors.sort(sorted);
  PlaneVector best, sum;
  std::size_t end = 0;   // the window is [begin, end), going on from the first after the last
  std::size_t next = 0;  // end, brought back into the circle
  float turns = 0;       // 4 once it has been
  for (std::size_t begin = 0; begin < count; ++begin) {
    const std::size_t from = sorted[begin];
    while (end < begin + count &&
           (end == begin || vectors.order[sorted[next]] + turns < vectors.limit[from])) {
      sum.x += vectors.x[sorted[next]];
      sum.y += vectors.y[sorted[next]];
      ++end;
      if (++next == count) {
        next = 0;
        turns = 4;
      }
    }
    if (sum.x * sum.x + sum.y * sum.y > best.x * best.x + best.y * best.y) best = sum;
    sum.x -= vectors.x[from];
    sum.y -= vectors.y[from];
  }
  return best;
}

/// A response: the boundary of cells it is centred on, counted from the first one used, and its weight.
struct OrientationSample {
  std::uint8_t column, row;
  float weight;
};

inline constexpr int orientation_side = 12;  ///< boundaries at -5.5, ..., 5.5

[[nodiscard]] inline const std::array<OrientationSample, Directions::count>& orientation_samples() {
  static const std::array<OrientationSample, Directions::count> table = [] {
    std::array<OrientationSample, Directions::count> samples;
    std::size_t count = 0;
    for (int row = 0; row < orientation_side; ++row)
      for (int column = 0; column < orientation_side; ++column) {
        const double squared = (column - 5.5) * (column - 5.5) + (row - 5.5) * (row - 5.5);
        if (squared < 36)
          samples[count++] = {static_cast<std::uint8_t>(column), static_cast<std::uint8_t>(row),
                              static_cast<float>(std::exp(-squared / (2 * 2.5 * 2.5)))};
      }
    return samples;
  }();
  return table;
}

/// Angle [rad] about the middle of a grid of cells of side s; 0 where there is no gradient.
template <int N>
[[nodiscard]] float dominant_angle(const CellGrid<N>& grid) noexcept {
  constexpr std::size_t side = orientation_side;
  constexpr std::size_t cells = side + 3;  // a response reaches two cells to every side
  static_assert(N % 2 == 1 && N >= static_cast<int>(cells));
  constexpr int first = (N - static_cast<int>(cells)) / 2;
  std::array<std::array<float, cells + 1>, side> tall;  // four cells on top of each other
  std::array<std::array<float, side>, cells> wide;      // four cells side by side
  for (std::size_t j = 0; j < cells; ++j) {
    const float* const row = grid.row(first + static_cast<int>(j)) + first;
    for (std::size_t i = 0; i < side; ++i) wide[j][i] = (row[i] + row[i + 1]) + (row[i + 2] + row[i + 3]);
  }
  for (std::size_t j = 0; j < side; ++j) {
    const float* const row = grid.row(first + static_cast<int>(j)) + first;
    for (std::size_t i = 0, down = CellGrid<N>::stride; i < cells; ++i)
      tall[j][i] = (row[i] + row[i + down]) + (row[i + 2 * down] + row[i + 3 * down]);
  }
  Directions gradients;
  std::size_t count = 0;
  for (const OrientationSample& sample : orientation_samples()) {
    const std::size_t i = sample.column, j = sample.row;
    gradients.x[count] = sample.weight * ((tall[j][i + 2] + tall[j][i + 3]) - (tall[j][i] + tall[j][i + 1]));
    gradients.y[count] = sample.weight * ((wide[j + 2][i] + wide[j + 3][i]) - (wide[j][i] + wide[j + 1][i]));
    ++count;
  }
  gradients.find_orders();
  const PlaneVector sum = longest_sector(gradients);
  return sum.x == 0 && sum.y == 0 ? 0.0F : static_cast<float>(std::atan2(sum.y, sum.x));
}

}}}  // namespace cairn::CAIRN_ABI::detail
