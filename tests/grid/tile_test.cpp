// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/grid/tile.hpp>

#include "support/random.hpp"

namespace tile_test {
namespace {

using namespace cairn;

}  // namespace

TEST_SUITE("grid/tile") {
  TEST_CASE("tile: a point lies in the cell that floor gives, on either side of the origin") {
    const GridGeometry geometry{0.1, 5.0, -3.0};
    CHECK(geometry.cell_of(5.05, -2.95) == CellAddress{0, 0});
    CHECK(geometry.cell_of(4.95, -3.05) == CellAddress{-1, -1});
    CHECK(geometry.cell_of(4.85, -3.05) == CellAddress{-2, -1});
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 10000; ++i) {
      const double x = random.uniform(-100, 100), y = random.uniform(-100, 100);
      const CellAddress cell = geometry.cell_of(x, y);
      REQUIRE(std::abs(geometry.center_x(cell) - x) <= 0.0500001);
      REQUIRE(std::abs(geometry.center_y(cell) - y) <= 0.0500001);
    }
  }

  TEST_CASE("tile: every cell is one place of one tile, and the tile's corner finds it again") {
    for (int row = -70; row < 70; ++row)
      for (int column = -70; column < 70; ++column) {
        const CellAddress cell{column, row}, corner = corner_of(tile_of(cell));
        const auto place = static_cast<int>(place_in_tile(cell));
        REQUIRE(place >= 0);
        REQUIRE(place < tile_cells);
        REQUIRE(CellAddress{corner.column + place % tile_side, corner.row + place / tile_side} == cell);
      }
  }

  TEST_CASE("tile: points that have no cell are known") {
    const GridGeometry geometry{};
    CHECK(geometry.contains(1e6, -1e6));
    CHECK_FALSE(geometry.contains(1e9, 0));
    CHECK_FALSE(geometry.contains(0, std::nan("")));
    CHECK_FALSE(geometry.contains(-std::numeric_limits<double>::infinity(), 0));
  }
}

}  // namespace tile_test
