// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/fit.hpp"

#include <cmath>
#include <vector>

#include <doctest/doctest.h>

TEST_SUITE("fit") {
  TEST_CASE("fit: finds the exponent of a power, and that n log n is a little more than linear") {
    std::vector<double> x;
    std::vector<double> power;
    std::vector<double> n_log_n;
    for (double n = 1000; n < 1e6; n *= 1.5) {
      x.push_back(n);
      power.push_back(3e-9 * std::pow(n, 1.7));
      n_log_n.push_back(n * std::log(n));
    }
    CHECK(cairn_bench::exponent_of(x, power) == doctest::Approx(1.7));
    CHECK(cairn_bench::exponent_of(x, n_log_n) > 1.05);
    CHECK(cairn_bench::exponent_of(x, n_log_n) < 1.15);
  }

  TEST_CASE("fit: leaves out what has no logarithm, and knows when nothing is left") {
    const std::vector<double> x{-1, 0, 1, 10};
    const std::vector<double> y{5, 5, 2, 200};
    CHECK(cairn_bench::exponent_of(x, y) == doctest::Approx(2));
    CHECK(std::isnan(cairn_bench::exponent_of(x, std::vector<double>{1, 1, 1, 0})));
    CHECK(std::isnan(cairn_bench::exponent_of({}, {})));
  }

  TEST_CASE("fit: a crossing lasts to the end") {
    const std::vector<double> x{1, 2, 3, 4, 5};
    const std::vector<double> upper{1, 1, 1, 1, 1};
    CHECK(cairn_bench::crossing(x, std::vector<double>{2, 0, 2, 1, 0}, upper) == 4.0);
    CHECK(cairn_bench::crossing(x, std::vector<double>{0, 0, 0, 0, 0}, upper) == 1.0);
    CHECK(!cairn_bench::crossing(x, std::vector<double>{0, 0, 0, 0, 2}, upper));
  }
}
