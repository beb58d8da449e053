// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Gaussian blur of a field, for a first look with a large uncertainty: blur by what the position may be off.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/field/grid.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// exp(-x^2 / (2 sigma^2)) at 0, 1, 2, ... `most`, as far as it is above 1e-12; sigma in nodes.
inline std::vector<double> half_gaussian(double sigma, int most) {
  std::vector<double> weights{1.0};
  for (int i = 1; sigma > 0.0 && i <= most; ++i) {
    const double weight = std::exp(-0.5 * (i / sigma) * (i / sigma));
    if (weight < 1e-12) break;
    weights.push_back(weight);
  }
  return weights;
}

/// One pass along lines of `count` nodes `stride` apart: weighted sums of values and of weights.
inline void blur_line(const double* from, double* to, int count, std::ptrdiff_t stride,
                      const std::vector<double>& weights) {
  const int reach = static_cast<int>(weights.size()) - 1;
  for (int i = 0; i < count; ++i) {
    double sum = 0;
    for (int j = std::max(i - reach, 0); j <= std::min(i + reach, count - 1); ++j)
      sum += weights[static_cast<std::size_t>(std::abs(i - j))] * from[j * stride];
    to[i * stride] = sum;
  }
}

inline void blur_grid(FieldGrid& grid, const std::vector<double>& along_x,
                      const std::vector<double>& along_y) {
  std::vector<double> other(grid.values().size());
  const std::ptrdiff_t columns = grid.columns();
  for (int r = 0; r < grid.rows(); ++r)
    blur_line(grid.values().data() + r * columns, other.data() + r * columns, grid.columns(), 1, along_x);
  for (int c = 0; c < grid.columns(); ++c)
    blur_line(other.data() + c, grid.values().data() + c, grid.rows(), columns, along_y);
}

}  // namespace detail

/// The field averaged with Gaussian weights of standard deviation `sigma` (in the units of the grid's frame)
/// over the nodes that are known: near a void or the rim the average is over fewer nodes. Voids stay voids.
/// O(nodes * sigma / spacing).
[[nodiscard]] inline FieldGrid gaussian_blur(FieldGrid grid, double sigma) {
  CAIRN_EXPECTS(sigma >= 0.0 && std::isfinite(sigma), "gaussian_blur needs a finite sigma of at least 0");
  FieldGrid weight(grid.columns(), grid.rows(), grid.frame(), 1.0);
  for (std::size_t i = 0; i < grid.values().size(); ++i)
    if (std::isnan(grid.values()[i])) weight.values()[i] = grid.values()[i] = 0.0;
  const std::vector<double> known = weight.values();
  const std::vector<double> along_x = detail::half_gaussian(sigma / grid.frame().dx, grid.columns() - 1);
  const std::vector<double> along_y = detail::half_gaussian(sigma / grid.frame().dy, grid.rows() - 1);
  detail::blur_grid(grid, along_x, along_y);
  detail::blur_grid(weight, along_x, along_y);
  for (std::size_t i = 0; i < grid.values().size(); ++i)
    grid.values()[i] = known[i] > 0.0 ? grid.values()[i] / weight.values()[i] : void_value;
  return grid;
}

}}  // namespace cairn::CAIRN_ABI
