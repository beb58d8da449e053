// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <memory>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/vision/detail/cell_grid.hpp>

#include "support/random.hpp"
#include "vision/pictures.hpp"

namespace cell_grid_test {
namespace {

using cairn::detail::CellGrid;

/// Area of each pixel's unit square inside the box, times its level; the box in coordinates of the table.
double sum_by_area(const cairn::Image& image, double left, double top, double right, double bottom) {
  double sum = 0;
  for (int y = std::max(0, static_cast<int>(top)); y < std::min<double>(image.height(), bottom); ++y)
    for (int x = std::max(0, static_cast<int>(left)); x < std::min<double>(image.width(), right); ++x) {
      const double wide = std::min(right, x + 1.0) - std::max(left, static_cast<double>(x));
      const double tall = std::min(bottom, y + 1.0) - std::max(top, static_cast<double>(y));
      if (wide > 0 && tall > 0) sum += wide * tall * image(x, y);
    }
  return sum;
}

}  // namespace

TEST_SUITE("cell_grid") {
  TEST_CASE("sample_cells: every cell is the exact integral over its square") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::Image image = cairn_test::noise(240, 200, seed);
    const cairn::IntegralImage sums(image);
    for (int trial = 0; trial < 20; ++trial) {
      const double size = random.uniform(0.7, 7.0);
      const double x = random.uniform(12.5 * size, 239 - 12.5 * size);
      const double y = random.uniform(12.5 * size, 199 - 12.5 * size);
      CellGrid<25> grid;
      cairn::detail::sample_cells(sums, x, y, size, grid);
      for (int j = 0; j < 25; ++j)
        for (int i = 0; i < 25; ++i) {
          const double left = x + 0.5 + (i - 12.5) * size, top = y + 0.5 + (j - 12.5) * size;
          const double exact = sum_by_area(image, left, top, left + size, top + size);
          CHECK(std::abs(grid.row(j)[i] - exact) < 2e-5 * 255 * size * size);
        }
    }
  }

#if defined(__x86_64__)
  TEST_CASE("sample_cells: every processor gives the same bits") {
    const cairn::IntegralImage sums(cairn_test::noise(240, 200, 5));
    const auto at_hand = cairn::detail::processor();
    for (const double size : {0.8, 1.3, 2.9, 3.6, 7.0, 20.0}) {
      CellGrid<25> as_it_is, plain;
      cairn::detail::sample_cells(sums, 70.3, 101.8, size, as_it_is);
      cairn::detail::processor() = cairn::detail::Processor::plain;
      cairn::detail::sample_cells(sums, 70.3, 101.8, size, plain);
      cairn::detail::processor() = at_hand;
      for (int j = 0; j < 25; ++j)
        for (int i = 0; i < 25; ++i) CHECK(as_it_is.row(j)[i] == plain.row(j)[i]);
    }
  }
#endif

  TEST_CASE("sample_cells: cells over the rim equal the nearest cell inside") {
    const cairn::Image image = cairn_test::noise(60, 50, 3);
    const cairn::IntegralImage sums(image);
    CellGrid<25> grid;
    cairn::detail::sample_cells(sums, 3.5, 46.5, 2.0,
                                grid);         // boundaries at -21, -19, ..., 29 and 22, ..., 72
    CHECK(grid.row(0)[0] == grid.row(0)[11]);  // the first inside is [1, 3)
    CHECK(grid.row(0)[11] == doctest::Approx(sums.box(1, 22, 3, 24)));
    CHECK(grid.row(24)[15] == grid.row(13)[15]);  // the last inside is [48, 50)
    CHECK(grid.row(13)[15] == doctest::Approx(sums.box(9, 48, 11, 50)));
    CHECK(grid.row(24)[0] == grid.row(13)[11]);
  }

  TEST_CASE("sample_cells: where no cell fits the image, all are zero") {
    const cairn::IntegralImage sums(cairn::Image(5, 3, 99));
    CellGrid<25> grid;
    for (const double size : {4.0, 1e6, 1e30}) {
      cairn::detail::sample_cells(sums, 2.0, 1.0, size, grid);
      CHECK(std::all_of(grid.cells.begin(), grid.cells.end(), [](float cell) { return cell == 0; }));
    }
  }

  TEST_CASE("turn_cells: not at all, or by a quarter, only permutes the cells") {
    const cairn::IntegralImage sums(cairn_test::noise(100, 100, 4));
    CellGrid<35> upright;
    CellGrid<25> turned;
    cairn::detail::sample_cells(sums, 50.3, 48.9, 1.7, upright);
    cairn::detail::turn_cells(upright, 1.0F, 0.0F, turned);
    for (int j = 0; j < 25; ++j)
      for (int i = 0; i < 25; ++i) CHECK(turned.row(j)[i] == upright.row(j + 5)[i + 5]);
    cairn::detail::turn_cells(upright, 0.0F, 1.0F, turned);  // its x axis is the image's y axis
    for (int j = 0; j < 25; ++j)
      for (int i = 0; i < 25; ++i) CHECK(turned.row(j)[i] == upright.row(i + 5)[29 - j]);
  }

  TEST_CASE("turn_cells: reproduces a plane exactly at every angle, corners included") {
    CellGrid<35> upright;
    for (int j = 0; j < 35; ++j)
      for (int i = 0; i < 35; ++i) upright.row(j)[i] = static_cast<float>(3 * (i - 17) - 2 * (j - 17));
    CellGrid<25> turned;
    for (double angle = -3.1; angle < 3.15; angle += 0.1) {
      const double c = std::cos(angle), s = std::sin(angle);
      cairn::detail::turn_cells(upright, static_cast<float>(c), static_cast<float>(s), turned);
      for (const int j : {0, 7, 24})
        for (const int i : {0, 11, 24}) {
          const double u = i - 12, v = j - 12;
          CHECK(std::abs(turned.row(j)[i] - (3 * (c * u - s * v) - 2 * (s * u + c * v))) < 1e-3);
        }
    }
  }
}

}  // namespace cell_grid_test
