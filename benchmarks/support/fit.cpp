// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/fit.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

namespace cairn_bench {

double exponent_of(std::span<const double> x, std::span<const double> y) {
  double count = 0;
  double sum_x = 0;
  double sum_y = 0;
  double sum_xx = 0;
  double sum_xy = 0;
  for (std::size_t i = 0; i < x.size() && i < y.size(); ++i) {
    if (!(x[i] > 0) || !(y[i] > 0)) continue;
    const double u = std::log(x[i]);
    const double v = std::log(y[i]);
    count += 1;
    sum_x += u;
    sum_y += v;
    sum_xx += u * u;
    sum_xy += u * v;
  }
  const double spread = count * sum_xx - sum_x * sum_x;
  if (!(spread > 1e-12 * count * sum_xx)) return std::numeric_limits<double>::quiet_NaN();
  return (count * sum_xy - sum_x * sum_y) / spread;
}

std::optional<double> crossing(std::span<const double> x, std::span<const double> lower,
                               std::span<const double> upper) {
  std::optional<double> from;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!(lower[i] <= upper[i]))
      from.reset();
    else if (!from)
      from = x[i];
  }
  return from;
}

}  // namespace cairn_bench
