// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/scan/occupancy_grid.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace occupancy_grid_test {
namespace {

using namespace cairn;

/// Points on a square room's walls, seen from inside.
std::vector<ScanPoint> room_seen_from(const SE2& pose, Random& random, double sigma) {
  std::vector<ScanPoint> points;
  for (int i = 0; i < 90; ++i) {
    const double angle = 0.07 * i, c = std::cos(pose.angle() + angle), s = std::sin(pose.angle() + angle);
    const double rx = (c > 0 ? 2 - pose.x() : -2 - pose.x()) / c;
    const double ry = (s > 0 ? 2 - pose.y() : -2 - pose.y()) / s;
    const double r = std::min(rx, ry) + sigma * random.normal();
    points.push_back({r * std::cos(angle), r * std::sin(angle)});
  }
  return points;
}

/// The field's distance [cells] at a cell by looking at every obstacle of the grid.
double nearest_obstacle(const OccupancyGrid& grid, CellAddress at) {
  double best = 1e9;
  for (int row = at.row - 8; row <= at.row + 8; ++row)
    for (int column = at.column - 8; column <= at.column + 8; ++column) {
      const OccupancyCell& c = grid.cells().read({column, row});
      if (!c.is_obstacle()) continue;
      best = std::min(best, std::hypot(column + c.mean_x / 65536.0 - at.column - 0.5,
                                       row + c.mean_y / 65536.0 - at.row - 0.5));
    }
  return best;
}

}  // namespace

TEST_SUITE("scan/occupancy_grid") {
  TEST_CASE("occupancy_grid: visits and hits are those of counting every beam's cells as a set") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    OccupancyGrid grid;
    std::map<CellAddress, std::pair<int, int>> counts;  // visits, hits
    for (int scan = 0; scan < 20; ++scan) {
      const SE2 pose(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3));
      const auto points = room_seen_from(pose, random, 0.02);
      std::map<CellAddress, bool> seen;  // whether a beam ended there
      for (const ScanPoint& p : points) {
        const Vector<2> q = pose * Vector<2>(p.x, p.y);
        walk_ray(pose.x() / 0.05, pose.y() / 0.05, q(0) / 0.05, q(1) / 0.05,
                 [&](CellAddress cell, double) { seen[cell] = seen[cell]; });
        seen[grid.geometry().cell_of(q(0), q(1))] = true;
      }
      for (const auto& [cell, hit] : seen) {
        ++counts[cell].first;
        counts[cell].second += hit;
      }
      grid.insert(pose, points);
    }
    for (const auto& [cell, count] : counts) {
      REQUIRE(grid.cells().read(cell).visits == count.first);
      REQUIRE(grid.cells().read(cell).hits == count.second);
    }
    CHECK(grid.cells().read({1000, 1000}).occupancy() == 0.5);
  }

  TEST_CASE("occupancy_grid: after every scan the field is that of all obstacles, also of those gone") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    OccupancyGrid grid;
    for (int scan = 0; scan < 12; ++scan) {
      const SE2 pose(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3));
      grid.insert(pose, room_seen_from(pose, random, scan < 4 ? 0.3 : 0.01));  // ghosts first
    }
    std::size_t near = 0;
    auto field = grid.field();
    for (int row = -60; row < 60; ++row)
      for (int column = -60; column < 60; ++column) {
        const NearestObstacle found = field.at({column, row});
        const double expected = nearest_obstacle(grid, {column, row});
        if (std::abs(expected - 5) < 1e-5) continue;
        REQUIRE(found.found == (expected < 5));
        if (!found.found) continue;
        ++near;
        REQUIRE(std::abs(std::hypot(found.dx, found.dy) - expected) < 1e-5);
      }
    CHECK(near > 1000);
  }

  TEST_CASE("occupancy_grid: the bits of a tile are its obstacles, whatever was changed") {
    const std::uint64_t seed = cairn_test::seed(3);
    CAPTURE(seed);
    Random random(seed);
    OccupancyGrid grid;
    for (int scan = 0; scan < 15; ++scan) {
      const SE2 pose(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3));
      grid.insert(pose, room_seen_from(pose, random, scan < 5 ? 0.3 : 0.02));
    }
    std::size_t obstacles = 0, free = 0;
    grid.cells().for_each_tile([&](TileAddress, const OccupancyTile& tile) {
      for (std::size_t i = 0; i < tile_cells; ++i) {
        REQUIRE(tile[i].is_obstacle() == ((tile.obstacles[i / 32] >> (i % 32) & 1U) != 0));
        ++(tile[i].is_obstacle() ? obstacles : free);
      }
    });
    CHECK(obstacles > 100);
    CHECK(free > 1000);
  }

  TEST_CASE("occupancy_grid: a tile counts its cells as an array of them does, past 255 visits too") {
    const std::uint64_t seed = cairn_test::seed(4);
    CAPTURE(seed);
    Random random(seed);
    OccupancyTile tile;
    std::vector<OccupancyCell> plain(tile_cells);
    const auto draw = [&] { return static_cast<std::uint32_t>(random.uniform(0, 4294967296.0)); };
    for (int step = 0; step < 20000; ++step) {
      const auto row = static_cast<std::size_t>(random.uniform(0, tile_side));
      const std::uint32_t passed = row == 7 ? 0xffffffffU : draw() | draw();
      // Of some rows no cell is ever hit, of one the first and the last alone.
      const std::uint32_t often = draw() & draw(), seldom = row % 3 == 1 ? often & draw() : often;
      const std::uint32_t stopped = row % 3 == 0 ? 0 : row == 1 ? draw() & 0x80000001U : seldom;
      tile.count(row, passed, stopped & passed);
      for (std::size_t column = 0; column < tile_side; ++column) {
        if ((passed >> column & 1U) == 0) continue;
        OccupancyCell& cell = plain[row * tile_side + column];
        if (cell.visits == 255) {
          cell.visits = 128;
          cell.hits = static_cast<std::uint8_t>((cell.hits + 1) / 2);
        }
        ++cell.visits;
        if ((stopped >> column & 1U) == 0) continue;
        ++cell.hits;
        const double x = random.uniform(0, 1), y = random.uniform(0, 1);
        tile.move_mean(row * tile_side + column, x, y);
        cell.mean_x =
            static_cast<std::uint16_t>(std::lrint(cell.mean_x + (65535 * x - cell.mean_x) / cell.hits));
        cell.mean_y =
            static_cast<std::uint16_t>(std::lrint(cell.mean_y + (65535 * y - cell.mean_y) / cell.hits));
      }
    }
    std::size_t obstacles = 0, halved = 0;
    for (std::size_t i = 0; i < tile_cells; ++i) {
      CAPTURE(i);
      REQUIRE(tile[i] == plain[i]);
      REQUIRE(plain[i].is_obstacle() == ((tile.obstacles[i / 32] >> (i % 32) & 1U) != 0));
      obstacles += plain[i].is_obstacle();
      halved += plain[i].hits > 0 && plain[i].visits >= 128;
    }
    CHECK(obstacles > 20);
    CHECK(obstacles < 900);
    CHECK(halved > 200);
    const OccupancyTile again{std::span(plain).first<tile_cells>()};
    CHECK(again == tile);
    CHECK(again.bytes() == tile.bytes());  // though it was filled otherwise
    CHECK(OccupancyTile().bytes() < tile.bytes());
  }

  TEST_CASE("occupancy_grid: the normal of a wall is across it, and a lone point has none") {
    OccupancyGrid grid;
    std::vector<ScanPoint> wall;
    for (int i = -20; i <= 20; ++i) wall.push_back({1.02, 0.04 * i});
    wall.push_back({-1.5, 0});
    grid.insert(SE2(0, 0, 0.5), wall);
    const SE2 turned(0, 0, 0.5);
    const Vector<2> middle = turned * Vector<2>(1.02, 0.0), lone = turned * Vector<2>(-1.5, 0.0);
    const NearestObstacle at = grid.field().at(grid.geometry().cell_of(middle(0), middle(1)));
    REQUIRE(at.has_line());
    CHECK(std::abs(static_cast<double>(at.normal_x) * std::cos(0.5) +
                   static_cast<double>(at.normal_y) * std::sin(0.5)) > 0.99);
    CHECK_FALSE(grid.field().at(grid.geometry().cell_of(lone(0), lone(1))).has_line());
  }

  TEST_CASE("occupancy_grid: counts stay below 256 and what was an obstacle can be free again") {
    OccupancyGrid grid;
    const std::vector<ScanPoint> near{{1.01, 0.01}}, far{{2.01, 0.01}};
    for (int i = 0; i < 600; ++i) grid.insert(SE2(), near);
    const CellAddress cell = grid.geometry().cell_of(1.01, 0.01);
    CHECK(grid.cells().read(cell).is_obstacle());
    for (int i = 0; i < 600; ++i) grid.insert(SE2(), far);
    CHECK_FALSE(grid.cells().read(cell).is_obstacle());
    CHECK_FALSE(grid.field().at(cell).found);
  }

  TEST_CASE("occupancy_grid: a scan wider than any is refused, and the grid stays as it was") {
    OccupancyGrid grid;
    CHECK(cairn_test::message_of([&] { grid.insert(SE2(), {{1e6, 1}, {-1e6, 1e6}}); }).find("tiles") !=
          std::string::npos);
    CHECK(grid.empty());
    CHECK(grid.cells().tile({0, 0}) == nullptr);

    // Also where only the last of its points makes the map too wide.
    grid.insert(SE2(), {{1, 0}});
    const double edge = grid.geometry().cell_size * 32 * 65536 - 2;
    std::size_t before = 0, after = 0;
    grid.cells().for_each_tile([&](cairn::TileAddress, const auto&) { ++before; });
    CHECK(cairn_test::message_of([&] {
            grid.insert(SE2(edge, 0, 0), {{-1, 0}, {1, 0}, {10, 0}});
          }).find("65536 tiles") != std::string::npos);
    grid.cells().for_each_tile([&](cairn::TileAddress, const auto&) { ++after; });
    CHECK(before == after);
    grid.insert(SE2(edge, 0, 0), {{-1, 0}, {1, 0}});
    CHECK(grid.cells().read(grid.geometry().cell_of(edge + 1, 0)).hits == 1);
  }

  TEST_CASE("occupancy_grid: a bad cell size and points without a cell are refused in words") {
    for (const double size : {0.0, -1.0, std::nan("")})
      CHECK(cairn_test::message_of([&] {
              const OccupancyGrid grid({.geometry = {size, 0, 0}});
            }).find("cell size") != std::string::npos);
    OccupancyGrid grid;
    CHECK(cairn_test::message_of([&] { grid.insert(SE2(1e12, 0, 0), {{1, 1}}); }).find("2^28") !=
          std::string::npos);
    CHECK(grid.empty());
    grid.insert(SE2(), {});
    CHECK(grid.empty());
  }
}

}  // namespace occupancy_grid_test
