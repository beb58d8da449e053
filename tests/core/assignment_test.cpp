// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/assignment.hpp>

#include "support/random.hpp"

namespace assignment_test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

double sum_of(const std::vector<double>& costs, std::size_t columns,
              const std::vector<std::size_t>& column_of) {
  double sum = 0;
  for (std::size_t r = 0; r < column_of.size(); ++r) sum += costs[r * columns + column_of[r]];
  return sum;
}

/// Of all injective maps from rows to columns.
double least_sum(const std::vector<double>& costs, std::size_t rows, std::size_t columns) {
  std::vector<std::size_t> order(columns);
  std::iota(order.begin(), order.end(), 0);
  double least = infinity;
  do {
    const std::vector<std::size_t> first(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(rows));
    least = std::min(least, sum_of(costs, columns, first));
  } while (std::next_permutation(order.begin(), order.end()));
  return least;
}

}  // namespace

TEST_SUITE("core/assignment") {
  TEST_CASE("best_assignment: the least sum of all injective maps, up to 6 x 6") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 400; ++run) {
      const std::size_t columns = 1 + random.below(6), rows = 1 + random.below(columns);
      std::vector<double> costs(rows * columns);
      // whole numbers tie often; some pairs are forbidden
      for (double& c : costs) {
        c = run % 2 == 0 ? static_cast<double>(random.below(5)) : random.uniform(-3, 7);
        if (random.uniform() < 0.2) c = infinity;
      }
      const double least = least_sum(costs, rows, columns);
      const auto found = cairn::best_assignment(costs, rows);
      REQUIRE(found.has_value() == std::isfinite(least));
      if (!found) continue;
      std::vector<std::size_t> used = *found;
      std::sort(used.begin(), used.end());
      REQUIRE(std::unique(used.begin(), used.end()) == used.end());
      REQUIRE(sum_of(costs, columns, *found) == doctest::Approx(least).epsilon(1e-12));
    }
  }

  TEST_CASE("best_assignment: no rows, too few columns, and what is no cost") {
    CHECK(cairn::best_assignment({}, 0)->empty());
    CHECK_FALSE(cairn::best_assignment({}, 2).has_value());
    CHECK_FALSE(cairn::best_assignment(std::vector<double>{1, 2}, 2).has_value());
    CHECK_THROWS_AS(static_cast<void>(cairn::best_assignment(std::vector<double>{1, 2, 3}, 2)), cairn::Error);
    CHECK_THROWS_AS(static_cast<void>(cairn::best_assignment(std::vector<double>{1, std::nan("")}, 1)),
                    cairn::Error);
    CHECK_THROWS_AS(static_cast<void>(cairn::best_assignment(std::vector<double>{-infinity}, 1)),
                    cairn::Error);
  }
}

}  // namespace assignment_test
