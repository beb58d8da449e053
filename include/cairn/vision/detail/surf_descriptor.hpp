// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// SURF's descriptor: sums of Haar wavelet responses dx, dy of side 2 s in 4 x 4 sub-regions of the
/// keypoint's neighbourhood, s its scale.
///
/// Per sub-region (sum dx, sum dy, sum |dx|, sum |dy|): 64 numbers; extended, the sums of dx and |dx| are
/// split by the sign of dy and those of dy and |dy| by the sign of dx: 128. Unit length makes them
/// independent of contrast.
///  - plain: 20 x 20 responses, sub-regions of 5 x 5, weights of a Gaussian of 3.3 s about the keypoint.
///    Bay, Tuytelaars and Van Gool, ECCV 2006, section 4.2.
///  - overlapping ("M-SURF"): 24 x 24 responses, sub-regions of 9 x 9 whose corners are 5 apart, weights of a
///    Gaussian of 2.5 s about the middle of the sub-region, each sub-region weighted by a Gaussian of 1.5 in
///    units of sub-regions about the keypoint: a point that is a little off changes it less.
///    Agrawal, Konolige and Blas, "CenSurE", ECCV 2008, section 4.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include <cairn/version.hpp>
#include <cairn/vision/detail/cell_grid.hpp>
#include <cairn/vision/detail/lanes.hpp>
#include <cairn/vision/detail/surf_orientation.hpp>
#include <cairn/vision/features.hpp>
#include <cairn/vision/integral_image.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

inline constexpr int responses_a_side = 24;
using DescriptorCells = CellGrid<responses_a_side + 1>;
using NeighbourhoodCells = CellGrid<35>;  ///< holds the DescriptorCells turned by any angle

/// How the responses of one row or column are shared out among the four sub-regions along it.
struct SubregionWeights {
  struct Subregion {
    int begin, end;  ///< responses with a weight
    std::array<float, responses_a_side> weight{};
  };
  std::array<Subregion, 4> subregions{};

  explicit SubregionWeights(bool overlapping) {
    for (int s = 0; s < 4; ++s) {
      Subregion& subregion = subregions[static_cast<std::size_t>(s)];
      subregion.begin = 5 * s + (overlapping ? 0 : 2);
      subregion.end = subregion.begin + (overlapping ? 9 : 5);
      for (int i = subregion.begin; i < subregion.end; ++i) {
        const double inner = (i - (5 * s + 4)) / 2.5;
        const double outer = (s - 1.5) / 1.5;
        const double whole = (i - 11.5) / 3.3;
        subregion.weight[static_cast<std::size_t>(i)] = static_cast<float>(
            std::exp(-0.5 * (overlapping ? inner * inner + outer * outer : whole * whole)));
      }
    }
  }

  static const SubregionWeights& of(bool overlapping) {
    static const SubregionWeights apart(false);
    static const SubregionWeights together(true);
    return overlapping ? together : apart;
  }
};

/// Four neighbouring responses.
struct HaarResponses {
  Float4 dx, dy;
};
using ResponseGrid = std::array<std::array<HaarResponses, responses_a_side / 4>, responses_a_side>;

inline void haar_responses(const DescriptorCells& grid, ResponseGrid& responses) noexcept {
  for (int i = 0; i < responses_a_side; i += 4) {
    auto above = load<Float4>(grid.row(0) + i), above_right = load<Float4>(grid.row(0) + i + 1);
    for (int j = 0; j < responses_a_side; ++j) {
      const auto below = load<Float4>(grid.row(j + 1) + i);
      const auto below_right = load<Float4>(grid.row(j + 1) + i + 1);
      responses[static_cast<std::size_t>(j)][static_cast<std::size_t>(i / 4)] = {
          (above_right + below_right) - (above + below), (below + below_right) - (above + above_right)};
      above = below;
      above_right = below_right;
    }
  }
}

/// Adds four neighbouring responses to the sums of their columns: 4 sums, or 8 split by signs.
template <std::size_t Sums>
[[gnu::always_inline]] inline void add_responses(const HaarResponses& response, float weight,
                                                 std::array<Float4, Sums>& sums) noexcept {
  const Float4 dx = weight * response.dx, dy = weight * response.dy;
  const Float4 abs_dx = absolute(dx), abs_dy = absolute(dy);
  const Float4 none{};
  if constexpr (Sums == 4) {
    sums[0] += dx;
    sums[1] += dy;
    sums[2] += abs_dx;
    sums[3] += abs_dy;
  } else {
    sums[0] += dy < 0 ? none : dx;
    sums[1] += dy < 0 ? none : abs_dx;
    sums[2] += dy < 0 ? dx : none;
    sums[3] += dy < 0 ? abs_dx : none;
    sums[4] += dx < 0 ? none : dy;
    sums[5] += dx < 0 ? none : abs_dy;
    sums[6] += dx < 0 ? dy : none;
    sums[7] += dx < 0 ? abs_dy : none;
  }
}

/// Writes 16 Sums numbers: sub-regions row by row, the sums of each together. The weights are products of one
/// along the rows and one along the columns, so columns are summed first.
template <std::size_t Sums>
void sum_subregions(const ResponseGrid& responses, const SubregionWeights& weights, float* out) noexcept {
  for (const SubregionWeights::Subregion& down : weights.subregions) {
    std::array<std::array<Float4, Sums>, 4> totals{};
    for (std::size_t i = 0; i < responses_a_side / 4; ++i) {
      std::array<Float4, Sums> columns{};
      for (int j = down.begin; j < down.end; ++j)
        add_responses(responses[static_cast<std::size_t>(j)][i], down.weight[static_cast<std::size_t>(j)],
                      columns);
      const int column = 4 * static_cast<int>(i);
      for (std::size_t across = 0; across < 4; ++across) {
        if (column >= weights.subregions[across].end || column + 4 <= weights.subregions[across].begin)
          continue;
        const auto weight = load<Float4>(&weights.subregions[across].weight[4 * i]);
        for (std::size_t n = 0; n < Sums; ++n) totals[across][n] += weight * columns[n];
      }
    }
    for (const std::array<Float4, Sums>& subregion : totals)
      for (const Float4& total : subregion) *out++ = (total[0] + total[2]) + (total[1] + total[3]);
  }
}

/// Scales to unit length; all zeros stay.
inline void normalise(std::span<float> numbers) noexcept {
  float squares = 0;
  for (const float number : numbers) squares += number * number;
  if (!(squares > 0)) return;
  const float factor = 1.0F / std::sqrt(squares);
  for (float& number : numbers) number *= factor;
}

/// Writes 64 numbers, or 128 if `extended`, of a keypoint; finds its direction first when asked for,
/// otherwise its angle is obeyed. The image must not be empty.
inline void describe_keypoint(const IntegralImage& sums, Keypoint& keypoint, bool find_angle,
                              bool overlapping, bool extended, float* out) noexcept {
  DescriptorCells cells;
  if (find_angle || keypoint.angle != 0) {
    NeighbourhoodCells upright;
    sample_cells(sums, keypoint.x, keypoint.y, keypoint.scale, upright);
    if (find_angle) keypoint.angle = dominant_angle(upright);
    turn_cells(upright, std::cos(keypoint.angle), std::sin(keypoint.angle), cells);
  } else {
    sample_cells(sums, keypoint.x, keypoint.y, keypoint.scale, cells);
  }
  ResponseGrid responses;
  haar_responses(cells, responses);
  const SubregionWeights& weights = SubregionWeights::of(overlapping);
  if (extended)
    sum_subregions<8>(responses, weights, out);
  else
    sum_subregions<4>(responses, weights, out);
  normalise({out, extended ? 128U : 64U});
}

/// Whether the descriptor's window leaves the image.
inline bool reaches_over_rim(const IntegralImage& sums, const Keypoint& keypoint) noexcept {
  const double half =
      0.5 * (responses_a_side + 1) * keypoint.scale *
      (std::abs(std::cos(double{keypoint.angle})) + std::abs(std::sin(double{keypoint.angle})));
  return keypoint.x + 0.5 < half || keypoint.y + 0.5 < half || sums.width() - 0.5 - keypoint.x < half ||
         sums.height() - 0.5 - keypoint.y < half;
}

}}}  // namespace cairn::CAIRN_ABI::detail
