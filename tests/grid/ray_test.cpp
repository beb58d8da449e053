// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/grid/ray.hpp>

#include "support/random.hpp"
#include "support/violation.hpp"

namespace ray_test {
namespace {

using namespace cairn;

/// Length of the segment inside a cell, by clipping it against the cell's four sides.
double clipped(double x0, double y0, double x1, double y1, CellAddress cell) {
  double from = 0, to = 1;
  const auto clip = [&](double start, double step, double low) {
    if (step == 0) {
      if (start < low || start >= low + 1) to = -1;
      return;
    }
    const double a = (low - start) / step, b = (low + 1 - start) / step;
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  };
  clip(x0, x1 - x0, cell.column);
  clip(y0, y1 - y0, cell.row);
  return std::max(0.0, to - from) * std::hypot(x1 - x0, y1 - y0);
}

}  // namespace

TEST_SUITE("grid/ray") {
  TEST_CASE(
      "ray: walk_cells, walk_rows and walk_columns go through the cells of walk_ray, through corners too") {
    const std::uint64_t seed = cairn_test::seed(9);
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 2000; ++trial) {
      const auto any = [&] {
        const double x = random.uniform(-40, 40);
        return trial % 3 == 0 ? std::round(4 * x) / 4 : x;  // through many corners
      };
      const double x0 = any(), y0 = any(), x1 = trial % 10 == 0 ? x0 : any(),
                   y1 = trial % 10 == 1 ? y0 : any();
      std::vector<CellAddress> with_lengths, without;
      walk_ray(x0, y0, x1, y1, [&](CellAddress cell, double) { with_lengths.push_back(cell); });
      walk_cells(x0, y0, x1, y1, [&](CellAddress cell) { without.push_back(cell); });
      REQUIRE(with_lengths == without);
      std::vector<CellAddress> by_rows, by_columns;
      walk_rows(x0, y0, x1, y1, [&](std::int32_t row, std::int32_t first, std::int32_t last) {
        REQUIRE(first <= last);
        for (std::int32_t column = first; column <= last; ++column) by_rows.push_back({column, row});
      });
      walk_columns(x0, y0, x1, y1, [&](std::int32_t column, std::int32_t first, std::int32_t last) {
        REQUIRE(first <= last);
        for (std::int32_t row = first; row <= last; ++row) by_columns.push_back({column, row});
      });
      for (auto* cells : {&without, &by_rows, &by_columns}) std::ranges::sort(*cells);
      REQUIRE(by_rows == without);
      REQUIRE(by_columns == without);
    }
  }

  TEST_CASE("ray: a border that is crossed by less than any slope has a number for is one border") {
    for (const double across : {1e-320, 1e-308, 1e-300, 1e-17})
      for (const double from : {-3.5, 2.25, 0.0})
        for (const double to : {7.5, -8.0, 3.0})
          for (const double side : {1.0, -1.0}) {
            const double y0 = side > 0 ? -across : 0.0, y1 = side > 0 ? across : -across;
            std::vector<CellAddress> cells, by_rows, by_columns;
            walk_cells(from, y0, to, y1, [&](CellAddress cell) { cells.push_back(cell); });
            walk_rows(from, y0, to, y1, [&](std::int32_t row, std::int32_t first, std::int32_t last) {
              for (std::int32_t column = first; column <= last; ++column) by_rows.push_back({column, row});
            });
            walk_columns(y0, from, y1, to, [&](std::int32_t column, std::int32_t first, std::int32_t last) {
              for (std::int32_t row = first; row <= last; ++row) by_columns.push_back({row, column});
            });
            for (auto* all : {&cells, &by_rows}) std::ranges::sort(*all);
            REQUIRE(by_rows == cells);
            REQUIRE(by_columns.size() == cells.size());
          }
  }

  TEST_CASE("ray: the cells and lengths are those that clipping every cell of the box gives") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 500; ++trial) {
      const double x0 = random.uniform(-15, 15), y0 = random.uniform(-15, 15);
      const double x1 = trial % 10 == 0 ? x0 : random.uniform(-15, 15);
      const double y1 = trial % 10 == 1 ? y0 : random.uniform(-15, 15);
      std::map<CellAddress, double> walked;
      double sum = 0;
      walk_ray(x0, y0, x1, y1, [&](CellAddress cell, double length) {
        REQUIRE(walked.count(cell) == 0);
        walked[cell] = length;
        sum += length;
      });
      CHECK(sum == doctest::Approx(std::hypot(x1 - x0, y1 - y0)));
      for (int row = -16; row < 16; ++row)
        for (int column = -16; column < 16; ++column) {
          const CellAddress cell{column, row};
          const double expected = clipped(x0, y0, x1, y1, cell);
          const double found = walked.count(cell) != 0 ? walked[cell] : 0.0;
          REQUIRE(std::abs(found - expected) < 1e-9);
        }
    }
  }

  TEST_CASE("ray: begins in the start's cell, ends in the end's, and steps over edges") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 2000; ++trial) {
      // Whole numbers too: corners and borders.
      const auto draw = [&] {
        return trial % 2 == 0 ? std::floor(random.uniform(-8, 8)) : random.uniform(-3000, 3000);
      };
      const double x0 = draw(), y0 = draw(), x1 = draw(), y1 = draw();
      std::vector<CellAddress> cells;
      walk_ray(x0, y0, x1, y1, [&](CellAddress cell, double) { cells.push_back(cell); });
      const auto cell_at = [](double x, double y) {
        return CellAddress{static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y))};
      };
      REQUIRE(cells.front() == cell_at(x0, y0));
      REQUIRE(cells.back() == cell_at(x1, y1));
      for (std::size_t i = 1; i < cells.size(); ++i)
        REQUIRE(std::abs(cells[i].column - cells[i - 1].column) + std::abs(cells[i].row - cells[i - 1].row) ==
                1);
    }
  }

  TEST_CASE("ray: end points without a cell break its promise") {
    CHECK_FALSE(cairn_test::violation_of([] {
                  walk_ray(0, 0, std::nan(""), 0, [](CellAddress, double) {});
                }).empty());
    CHECK_FALSE(
        cairn_test::violation_of([] { walk_ray(0, 1e30, 0, 0, [](CellAddress, double) {}); }).empty());
  }
}

}  // namespace ray_test
