// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/grid/distance_field.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace distance_field_test {

/// A cell that is nothing but an obstacle or none.
struct Spot {
  float x = 0, y = 0;
  [[nodiscard]] float point_x() const noexcept { return x; }
  [[nodiscard]] float point_y() const noexcept { return y; }
};
struct SpotTile {
  std::array<Spot, cairn::tile_cells> cells{};
  cairn::ObstacleBits obstacles{};
  Spot& operator[](std::size_t i) { return cells[i]; }
  const Spot& operator[](std::size_t i) const { return cells[i]; }
};

}  // namespace distance_field_test

template <>
struct cairn::TileOf<distance_field_test::Spot> {
  using type = distance_field_test::SpotTile;
};

namespace distance_field_test {
namespace {

using namespace cairn;

struct Point {
  CellAddress cell;
  double x, y;  // in cells
};

/// Points in cells around a tile's corner, one a cell, and the grid of them.
struct Scattered {
  SharedTiles<Spot> grid;
  std::vector<Point> points;

  void put(CellAddress cell, double x, double y) {
    auto& tile = grid.writable_tile(tile_of(cell));
    const std::size_t place = place_in_tile(cell);
    if ((tile.obstacles[place / 32] >> (place % 32) & 1U) != 0) return;
    tile[place] = {static_cast<float>(x), static_cast<float>(y)};
    tile.obstacles[place / 32] |= 1U << (place % 32);
    points.push_back({cell, cell.column + static_cast<double>(tile[place].x),
                      cell.row + static_cast<double>(tile[place].y)});
  }
};

Scattered scattered(Random& random, std::size_t count, int reach) {
  Scattered all;
  for (std::size_t i = 0; i < count; ++i) {
    const auto any = [&] { return static_cast<std::int32_t>(std::floor(random.uniform(-reach, reach))); };
    all.put({any(), any()}, random.uniform(0, 0.999), random.uniform(0, 0.999));
  }
  return all;
}

/// The nearest point to a cell's centre by looking at all of them; null where there is none.
const Point* nearest(const std::vector<Point>& points, CellAddress cell) {
  const auto squared = [&](const Point& p) {
    const double dx = p.x - cell.column - 0.5, dy = p.y - cell.row - 0.5;
    return dx * dx + dy * dy;
  };
  const auto found = std::ranges::min_element(
      points, [&](const Point& a, const Point& b) { return squared(a) < squared(b); });
  return found == points.end() ? nullptr : &*found;
}

/// The direction in which the points near one spread least, by Eigen; zero where they make no line.
Vector<2> normal_of(const std::vector<Point>& points, const Point& middle, double& clear) {
  Matrix<2> spread = Matrix<2>::Zero();
  Vector<2> mean = Vector<2>::Zero();
  std::vector<Vector<2>> near;
  for (const Point& p : points)
    if (std::abs(p.cell.column - middle.cell.column) <= 2 && std::abs(p.cell.row - middle.cell.row) <= 2)
      near.emplace_back(p.x, p.y);
  for (const auto& p : near) mean += p / static_cast<double>(near.size());
  for (const auto& p : near) spread += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(spread);
  clear = solver.eigenvalues()(0) / solver.eigenvalues()(1) - 0.1;  // below zero: a line
  return near.size() < 3 || clear > 0 ? Vector<2>(0, 0) : Vector<2>(solver.eigenvectors().col(0));
}

}  // namespace

TEST_SUITE("grid/distance_field") {
  TEST_CASE("distance_field: ways and normals are those of looking at every obstacle, over tiles' borders") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    int lines = 0;
    for (const double radius : {0.7, 1.0, 3.0, 4.5, 6.0, 16.0})
      for (const std::size_t count : {0U, 1U, 30U, 300U, 700U}) {
        const Scattered all = scattered(random, count, 40);
        DistanceField<Spot> field(all.grid, radius);
        for (int twice = 0; twice < 2; ++twice)
          for (int row = -48; row < 48; ++row)
            for (int column = -48; column < 48; ++column) {
              const NearestObstacle found = field.at({column, row});
              const Point* expected = nearest(all.points, {column, row});
              const double distance =
                  expected == nullptr ? 1e9 : std::hypot(expected->x - column - 0.5, expected->y - row - 0.5);
              if (std::abs(distance - radius) < 1e-5) continue;  // on the rim, rounding decides
              REQUIRE(found.found == (distance < radius));
              if (!found.found) continue;
              const double dx = static_cast<double>(found.dx), dy = static_cast<double>(found.dy);
              REQUIRE(std::abs(std::hypot(dx, dy) - distance) < 1e-5);
              if (std::abs(dx + column + 0.5 - expected->x) + std::abs(dy + row + 0.5 - expected->y) > 1e-4)
                continue;  // two at the same distance
              double clear = 0;
              const Vector<2> normal = normal_of(all.points, *expected, clear);
              if (std::abs(clear) < 1e-4) continue;
              REQUIRE(found.has_line() == !normal.isZero(0));
              if (!found.has_line()) continue;
              ++lines;
              REQUIRE(std::abs(static_cast<double>(found.normal_x) * normal(0) +
                               static_cast<double>(found.normal_y) * normal(1)) ==
                      doctest::Approx(1).epsilon(1e-4));
            }
      }
    CHECK(lines > 1000);
  }

  TEST_CASE("distance_field: far from the origin as near it") {
    Random random(5);
    const Scattered near = scattered(random, 300, 20);
    constexpr std::int32_t away = farthest_cell - 64;
    Scattered far;
    for (const Point& p : near.points)
      far.put({p.cell.column - away, p.cell.row + away}, p.x - p.cell.column, p.y - p.cell.row);
    DistanceField<Spot> here(near.grid, 6), there(far.grid, 6);
    for (int row = -30; row < 30; ++row)
      for (int column = -30; column < 30; ++column) {
        const NearestObstacle a = here.at({column, row}), b = there.at({column - away, row + away});
        REQUIRE(a.found == b.found);
        REQUIRE(std::abs(std::hypot(a.dx, a.dy) - std::hypot(b.dx, b.dy)) < 1e-5F);
      }
  }

  TEST_CASE("distance_field: asked here and there over a wide map it answers as a field that is new") {
    const std::uint64_t seed = cairn_test::seed(6);
    CAPTURE(seed);
    Random random(seed);
    Scattered all;  // in 3 x 3 tiles of every sixteenth, which are remembered at one place
    for (int i = 0; i < 9000; ++i) {
      const auto any = [&] {
        return static_cast<std::int32_t>(random.uniform(0, 3)) * 16 * tile_side +
               static_cast<std::int32_t>(std::floor(random.uniform(-16, 48)));
      };
      all.put({any(), any()}, random.uniform(0, 0.999), random.uniform(0, 0.999));
    }
    DistanceField<Spot> field(all.grid, 6);
    std::size_t found = 0;
    for (int i = 0; i < 3000; ++i) {
      const auto any = [&] {
        return static_cast<std::int32_t>(random.uniform(0, 3)) * 16 * tile_side +
               static_cast<std::int32_t>(random.uniform(0, 32));
      };
      const CellAddress cell{any(), any()};
      DistanceField<Spot> fresh(all.grid, 6);
      const NearestObstacle expected = fresh.at(cell);
      REQUIRE(field.at(cell) == expected);
      REQUIRE(field.cell(cell).x == all.grid.read(cell).x);
      found += expected.has_line();
    }
    CHECK(found > 100);
  }

  TEST_CASE("distance_field: a radius that it cannot search is refused in words") {
    const SharedTiles<Spot> none;
    for (const double radius : {0.0, -1.0, 16.5, std::nan("")})
      CHECK(cairn_test::message_of([&] { const DistanceField<Spot> field(none, radius); }).find("16 cells") !=
            std::string::npos);
  }
}

}  // namespace distance_field_test
