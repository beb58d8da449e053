// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Point sets that break trees: besides uniform ones, clusters, lines, lattices, equal points and neighbours
/// one ulp apart.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include <cairn/core/random.hpp>

namespace cairn_test {

inline const std::vector<std::string>& shapes() {
  static const std::vector<std::string> names{"uniform", "clusters", "line", "lattice",
                                              "equal",   "ulps",     "far"};
  return names;
}

/// `count` points of `dim` numbers, one after the other.
template <class Real>
std::vector<Real> make_points(const std::string& shape, std::size_t count, std::size_t dim,
                              cairn::Random& random) {
  std::vector<Real> numbers(count * dim);
  for (std::size_t i = 0; i < count; ++i) {
    const double along = random.uniform();
    for (std::size_t a = 0; a < dim; ++a) {
      double number = random.uniform();
      if (shape == "clusters") number = static_cast<double>((i * 7 + a) % 5) + 0.01 * random.normal();
      if (shape == "line") number = along * static_cast<double>(a + 1);
      if (shape == "lattice") number = static_cast<double>(random.below(4));
      if (shape == "equal") number = 0.25;
      if (shape == "far") number = 1e6 + number;
      numbers[i * dim + a] = static_cast<Real>(number);
      if (shape == "ulps" && random.below(2) == 0)
        numbers[i * dim + a] = std::nextafter(Real{1}, std::numeric_limits<Real>::infinity());
      else if (shape == "ulps")
        numbers[i * dim + a] = Real{1};
    }
  }
  return numbers;
}

}  // namespace cairn_test
