// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/grid/obstacle_rings.hpp>

#include "support/random.hpp"

namespace obstacle_rings_test {

/// A cell of which only its tile says whether it is an obstacle.
struct Mark {
  [[nodiscard]] static float point_x() noexcept { return 0.5F; }
  [[nodiscard]] static float point_y() noexcept { return 0.5F; }
};
struct MarkTile {
  std::array<Mark, cairn::tile_cells> cells{};
  cairn::ObstacleBits obstacles{};
  Mark& operator[](std::size_t i) { return cells[i]; }
  const Mark& operator[](std::size_t i) const { return cells[i]; }
};

}  // namespace obstacle_rings_test

template <>
struct cairn::TileOf<obstacle_rings_test::Mark> {
  using type = obstacle_rings_test::MarkTile;
};

namespace obstacle_rings_test {
namespace {

using namespace cairn;

void put(SharedTiles<Mark>& grid, CellAddress cell) {
  grid.writable_tile(tile_of(cell)).obstacles[static_cast<std::size_t>(cell.row & 31)] |=
      1U << static_cast<unsigned>(cell.column & 31);
}

/// By the header's formulas and every obstacle.
int rings_around(const std::vector<CellAddress>& obstacles, CellAddress cell) {
  int most = 0;
  for (const CellAddress& o : obstacles) {
    const int x = std::abs(o.column - cell.column), y = std::abs(o.row - cell.row);
    if (std::max(x, y) <= 1)
      most = std::max(most, 3);
    else if (std::max(x - 2, 0) + std::max(y - 2, 0) <= 1)
      most = std::max(most, 2);
    else if (std::max(x - 3, 0) + std::max(y - 3, 0) <= 2)
      most = std::max(most, 1);
  }
  return most;
}

}  // namespace

TEST_SUITE("grid/obstacle_rings") {
  TEST_CASE(
      "obstacle_rings: around a cell there are those of looking at every obstacle, over tiles' borders") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const int count : {0, 1, 12, 60, 300}) {
      SharedTiles<Mark> grid;
      std::vector<CellAddress> obstacles;
      for (int i = 0; i < count; ++i) {
        const auto any = [&] { return static_cast<std::int32_t>(std::floor(random.uniform(-40, 40))); };
        obstacles.push_back({any(), any()});
        put(grid, obstacles.back());
      }
      ObstacleRings<Mark> rings(grid);
      std::array<int, 4> seen{};
      for (std::int32_t row = -50; row < 50; ++row)
        for (std::int32_t column = -50; column < 50; ++column) {
          const int expected = rings_around(obstacles, {column, row});
          REQUIRE(rings.around({column, row}) == expected);
          ++seen[static_cast<std::size_t>(expected)];
        }
      CHECK((count == 0 || *std::ranges::min_element(seen) > 0));
    }
  }

  TEST_CASE("obstacle_rings: places far apart that share their room are told apart, however often") {
    SharedTiles<Mark> grid;
    put(grid, {3, 3});
    put(grid, {512 + 9, 512 + 9});
    ObstacleRings<Mark> rings(grid);
    for (int twice = 0; twice < 2; ++twice) {
      CHECK(rings.around({3, 4}) == 3);
      CHECK(rings.around({512 + 3, 512 + 4}) == 0);
      CHECK(rings.around({512 + 9, 512 + 12}) == 2);
      CHECK(rings.around({9, 12}) == 0);
      CHECK(rings.around({-1000000, 1000000}) == 0);
    }
  }
}

}  // namespace obstacle_rings_test
