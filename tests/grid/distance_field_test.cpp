// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/grid/distance_field.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace distance_field_test {
namespace {

using namespace cairn;

std::vector<Obstacle> scattered(Random& random, std::size_t count, double margin) {
  std::vector<Obstacle> obstacles;
  for (std::size_t i = 0; i < count; ++i) {
    const double angle = random.uniform(-3, 3);
    obstacles.push_back({static_cast<float>(random.uniform(-margin, tile_side + margin)),
                         static_cast<float>(random.uniform(-margin, tile_side + margin)),
                         static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))});
  }
  return obstacles;
}

/// Distance [cells] from a cell's centre to the nearest obstacle.
double nearest(const std::vector<Obstacle>& obstacles, int column, int row) {
  double best = 1e9;
  for (const Obstacle& o : obstacles)
    best = std::min(
        best, std::hypot(static_cast<double>(o.x) - column - 0.5, static_cast<double>(o.y) - row - 0.5));
  return best;
}

void check_tile(const DistanceField& field, TileAddress tile, const std::vector<Obstacle>& obstacles) {
  for (int row = 0; row < tile_side; ++row)
    for (int column = 0; column < tile_side; ++column) {
      const CellAddress corner = corner_of(tile);
      const NearestObstacle& found = field.read({corner.column + column, corner.row + row});
      const double expected = nearest(obstacles, column, row);
      if (std::abs(expected - field.radius()) < 1e-4) continue;  // on the rim, rounding decides
      REQUIRE(found.found() == (expected < field.radius()));
      if (found.found())
        REQUIRE(std::abs(std::hypot(found.dx, found.dy) / NearestObstacle::steps - expected) < 0.04);
    }
}

}  // namespace

TEST_SUITE("grid/distance_field") {
  TEST_CASE("distance_field: distances are those of looking at every obstacle, whatever was there before") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const double radius : {1.0, 3.0, 4.5, 6.0}) {
      DistanceField field(radius);
      for (const std::size_t count : {60U, 3U, 200U, 0U, 1U}) {
        const auto obstacles = scattered(random, count, radius + 2);
        field.rebuild({-2, 3}, {}, obstacles);
        check_tile(field, {-2, 3}, obstacles);
      }
    }
  }

  TEST_CASE("distance_field: a part of a tile is rebuilt as the whole would be, and the rest left alone") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 50; ++trial) {
      DistanceField before, whole, part;
      const auto old = scattered(random, 20, 6), fresh = scattered(random, 20, 6);
      before.rebuild({0, 0}, {}, old);
      part = before;
      whole.rebuild({0, 0}, {}, fresh);
      const int left = static_cast<int>(random.below(31)), bottom = static_cast<int>(random.below(31));
      const TilePart in{left, bottom,
                        left + 1 + static_cast<int>(random.below(static_cast<unsigned>(32 - left))),
                        bottom + 1 + static_cast<int>(random.below(static_cast<unsigned>(32 - bottom)))};
      part.rebuild({0, 0}, in, fresh);
      for (int row = 0; row < tile_side; ++row)
        for (int column = 0; column < tile_side; ++column) {
          const bool inside = column >= in.left && column < in.right && row >= in.bottom && row < in.top;
          REQUIRE(part.read({column, row}) == (inside ? whole : before).read({column, row}));
        }
    }
  }

  TEST_CASE("distance_field: an obstacle that is gone leaves no trace, and none makes no tile") {
    DistanceField field;
    field.rebuild({0, 0}, {}, {});
    CHECK(field.tile({0, 0}) == nullptr);
    const std::vector<Obstacle> one{{16.25F, 16.5F, 0, 1}};
    field.rebuild({0, 0}, {}, one);
    CHECK(field.read({16, 16}).dx == -5);
    CHECK(field.read({16, 16}).dy == 0);
    CHECK(field.read({16, 16}).has_line());
    field.rebuild({0, 0}, {}, {});
    for (int i = 0; i < tile_side; ++i) CHECK_FALSE(field.read({i, 16}).found());
  }

  TEST_CASE("distance_field: a radius that a packed step cannot say is refused in words") {
    for (const double radius : {0.0, -1.0, 6.5, std::nan("")})
      CHECK(cairn_test::message_of([&] { const DistanceField field(radius); }).find("6 cells") !=
            std::string::npos);
  }
}

}  // namespace distance_field_test
