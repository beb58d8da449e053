// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The neighbourhood of a keypoint as N x N cells of the keypoint's own size: sums over boxes with
/// fractional sides.
///
/// Differences of sums of cells are Haar wavelet responses, so one grid serves all wavelets of a keypoint,
/// and no position or size is ever rounded to pixels. Upright, the cells tile a square and their sums are
/// exact integrals of the image of unit-square pixels. Turned by an angle, the centres turn and the boxes
/// stay upright; turned by a right angle the cells are the same, in another order.
///
/// Rim: a cell that reaches over the image takes the place of the nearest cell that does not.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <cairn/simd/processor.hpp>
#include <cairn/version.hpp>
#include <cairn/vision/detail/lanes.hpp>
#include <cairn/vision/integral_image.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Row-major cells; the rows have room for whole vectors of 8.
template <int N>
struct CellGrid {
  static constexpr int stride = (N + 8) / 8 * 8;
  alignas(32) std::array<float, static_cast<std::size_t>(N* stride)> cells;

  [[nodiscard]] float* row(int j) noexcept { return cells.data() + j * stride; }
  [[nodiscard]] const float* row(int j) const noexcept { return cells.data() + j * stride; }
};

/// The N + 1 cell boundaries along one side, and the cells [first, last] that lie inside.
template <int N>
struct CellAxis {
  static constexpr std::size_t count =
      (N + 1 + 3) / 4 * 4;             ///< the last boundary is repeated to fill vectors
  std::array<int, count> whole;        ///< boundary k lies between the entries whole[k] and whole[k] + 1
  std::array<float, 2 * count> parts;  ///< what these two weigh
  int first = 0;
  int last = N - 1;

  /// Cells of `size` about the pixel coordinate `centre`, boundaries brought into [0, length], length >= 1.
  CellAxis(double centre, double size, int length) noexcept {
    const double origin = centre + 0.5 - 0.5 * N * size;
    for (std::size_t k = 0; k < count; ++k) {
      const double inside =
          std::clamp(origin + std::min(static_cast<int>(k), N) * size, 0.0, static_cast<double>(length));
      whole[k] = std::min(static_cast<int>(inside), length - 1);
      parts[2 * k + 1] = static_cast<float>(inside - whole[k]);
      parts[2 * k] = 1 - parts[2 * k + 1];
    }
    while (first < N && origin + first * size < 0) ++first;
    while (last >= 0 && origin + (last + 1) * size > length) --last;
  }
  [[nodiscard]] bool all_inside() const noexcept { return first == 0 && last == N - 1; }
};

/// Cells that reach over the rim take the value of the nearest one inside.
template <int N>
void fill_rim(const CellAxis<N>& across, const CellAxis<N>& down, CellGrid<N>& grid) noexcept {
  if (across.first > across.last || down.first > down.last) {
    grid.cells.fill(0.0F);
    return;
  }
  for (int j = down.first; j <= down.last; ++j) {
    float* const row = grid.row(j);
    for (int i = 0; i < across.first; ++i) row[i] = row[across.first];
    for (int i = across.last + 1; i < N; ++i) row[i] = row[across.last];
  }
  for (int j = 0; j < N; ++j) {
    const int nearest = std::clamp(j, down.first, down.last);
    if (nearest != j) std::copy_n(grid.row(nearest), N, grid.row(j));
  }
}

/// S of every row of cells of an upright grid, at columns beside the boundaries of its cells.
template <int N>
struct CellStrips {
  static constexpr std::size_t count = CellAxis<N>::count;
  static constexpr std::size_t most = (3 * count + 7) / 8 * 8;
  alignas(32) std::array<std::array<float, most>, N + 1> rows;  ///< [j + 1]: of cells j
  std::array<std::size_t, count> place;                         ///< of the columns beside boundary k

  /// Boundaries of small cells are so near each other that all columns are read as they stand; of larger ones
  /// the two columns beside each boundary are put together first.
  [[gnu::always_inline]] void assign(const IntegralImage& sums, const CellAxis<N>& across,
                                     const CellAxis<N>& down) noexcept {
    const int first = across.whole[0], span = across.whole[N] + 2 - first;
    const bool dense = span <= static_cast<int>(most);
    const std::size_t columns = dense ? static_cast<std::size_t>(span) : 2 * count;
    for (std::size_t k = 0; k < count; ++k)
      place[k] = dense ? static_cast<std::size_t>(across.whole[k] - first) : 2 * k;
    std::array<std::uint32_t, 2 * count> together[2];
    const auto read = [&](int row, std::array<std::uint32_t, 2 * count>& pairs)
                          CAIRN_INLINED -> const std::uint32_t* {
      const std::uint32_t* const all = sums.row(row);
      if (dense) return all + first;
      for (std::size_t k = 0; k < count; ++k) {
        pairs[2 * k] = all[across.whole[k]];
        pairs[2 * k + 1] = all[across.whole[k] + 1];
      }
      return pairs.data();
    };
    // S at the boundary above, from the first column on, and how much of the next row belongs to it.
    alignas(32) std::array<std::uint32_t, most> upper{};
    alignas(32) std::array<float, most> upper_part{};
    for (std::size_t j = 0; j <= N; ++j) {
      const std::uint32_t* const here = read(down.whole[j], together[0]);
      const std::uint32_t* const next = read(down.whole[j] + 1, together[1]);
      const std::uint32_t here_base = here[0], next_base = next[0];
      const float fraction = down.parts[2 * j + 1];
      float* const row = rows[j].data();
      for (std::size_t k = 0; k < columns; ++k) {
        const std::uint32_t above = here[k] - here_base, below = next[k] - next_base;
        const float part = static_cast<float>(static_cast<std::int32_t>(below - above)) * fraction;
        row[k] = static_cast<float>(static_cast<std::int32_t>(above - upper[k])) + (part - upper_part[k]);
        upper[k] = above;
        upper_part[k] = part;
      }
    }
  }

  /// S at the boundaries first, and all of it before differences are taken: what has just been written in
  /// other pieces is read slowly.
  [[gnu::always_inline]] void cells(const CellAxis<N>& across, CellGrid<N>& grid) const noexcept {
    static_assert(CellGrid<N>::stride >= static_cast<int>(count));
    for (int j = 0; j < N; ++j) {
      const float* const row = rows[static_cast<std::size_t>(j) + 1].data();
      const auto boundaries = [&](std::size_t k) CAIRN_INLINED {  // two, of two columns each, weighted
        return load_pairs(row + place[k], row + place[k + 1]) * load<Float4>(&across.parts[2 * k]);
      };
      for (std::size_t k = 0; k < count; k += 4) {
        const Float4 two = boundaries(k), two_more = boundaries(k + 2);
        store(shuffled<0, 2, 4, 6>(two, two_more) + shuffled<1, 3, 5, 7>(two, two_more), grid.row(j) + k);
      }
    }
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) grid.row(j)[i] = grid.row(j)[i + 1] - grid.row(j)[i];
  }
};

/// Cells of side `size` about (x, y) [pixels], upright. The image must not be empty.
/// Integers are subtracted before they become floats: what is rounded is never more than one row of cells.
template <int N>
void sample_cells(const IntegralImage& sums, double x, double y, double size, CellGrid<N>& grid) noexcept {
  const CellAxis<N> across(x, size, sums.width());
  const CellAxis<N> down(y, size, sums.height());
  with_avx2_lanes([&]() CAIRN_INLINED {
    CellStrips<N> strips;
    strips.assign(sums, across, down);
    strips.cells(across, grid);
  });
  if (!across.all_inside() || !down.all_inside()) fill_rim(across, down, grid);
}

/// The middle N x N cells of an upright grid, turned about its middle by the angle of (cosine, sine), from +x
/// towards +y, and read between the upright cells by bilinear interpolation. A turn by a right angle only
/// permutes them.
template <int N, int M>
void turn_cells(const CellGrid<M>& upright, float cosine, float sine, CellGrid<N>& turned) noexcept {
  static_assert(N % 2 == 1 && M % 2 == 1 && 2 * (N - 1) * (N - 1) < (M - 1) * (M - 1),
                "the turned square must fit");
  constexpr float middle = 0.5F * (M - 1);
  constexpr float half = 0.5F * (N - 1);
  constexpr int stride = CellGrid<M>::stride;
  const Float4 index{0, 1, 2, 3};
  for (int j = 0; j < N; ++j) {
    const float v = static_cast<float>(j) - half;
    float* const row = turned.row(j);
    for (int i = 0; i < N; i += 4) {
      const Float4 u = index + (static_cast<float>(i) - half);
      Float4 x = middle + (cosine * u - sine * v);
      Float4 y = middle + (sine * u + cosine * v);
      const Signed4 column = __builtin_convertvector(x, Signed4);
      const Signed4 line = __builtin_convertvector(y, Signed4);
      x -= __builtin_convertvector(column, Float4);
      y -= __builtin_convertvector(line, Float4);
      std::array<std::int32_t, 4> at;
      store(line * stride + column, at.data());
      for (std::size_t lane = static_cast<std::size_t>(N - i); lane < 4; ++lane) at[lane] = 0;
      const float* const cells = upright.cells.data();
      const Float4 above = load_pairs(cells + at[0], cells + at[1]);
      const Float4 above_more = load_pairs(cells + at[2], cells + at[3]);
      const Float4 below = load_pairs(cells + stride + at[0], cells + stride + at[1]);
      const Float4 below_more = load_pairs(cells + stride + at[2], cells + stride + at[3]);
      const Float4 mixed = above + (below - above) * shuffled<0, 0, 1, 1>(y, y);
      const Float4 more = above_more + (below_more - above_more) * shuffled<2, 2, 3, 3>(y, y);
      const Float4 left = shuffled<0, 2, 4, 6>(mixed, more);
      const Float4 right = shuffled<1, 3, 5, 7>(mixed, more);
      store(left + (right - left) * x, row + i);
    }
  }
}

}}}  // namespace cairn::CAIRN_ABI::detail
