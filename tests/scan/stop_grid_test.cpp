// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/grid/ancestry.hpp>
#include <cairn/scan/stop_grid.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace stop_grid_test {
namespace {

using namespace cairn;

/// One beam straight ahead.
LaserScan beam(double range, double farthest = 8) {
  LaserScan scan;
  scan.farthest = farthest;
  scan.range = {static_cast<float>(range)};
  return scan;
}

/// Scans of short ranges from all over a place of two metres.
StopGrid<> random_grid(Random& random, const StopOptions& options = {}) {
  StopGrid<> grid(options);
  for (int k = 0; k < 400; ++k)
    grid.insert(beam(random.uniform(0.1, 4), 3),
                SE2(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3)));
  return grid;
}

}  // namespace

TEST_SUITE("scan/stop_grid") {
  TEST_CASE("stop_grid: a beam stops somewhere or does not: the probabilities sum to one") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 50; ++trial) {
      const StopGrid<> grid = random_grid(random);
      double sum = 0;
      bool negative = false;
      sum += grid.along_beam(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3), 8,
                             [&](double, double stopped) {
                               negative = negative || stopped < 0;
                               sum += stopped;
                             });
      CHECK(std::abs(sum - 1) < 1e-14);
      CHECK_FALSE(negative);
    }
  }

  TEST_CASE("stop_grid: a million photons stop where the beam says") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    const StopGrid<> grid = random_grid(random, {.geometry = {.cell_size = 0.25}});
    const double x = 0.13, y = -0.21, angle = 0.7, end = 2.5;
    // How much a photon has to overcome until a distance, by small steps through whatever cell is there.
    constexpr double step = 1e-4;
    std::vector<double> depth{0};
    for (double at = 0.5 * step; at < end; at += step) {
      const auto cell = grid.options().geometry.cell_of(x + at * std::cos(angle), y + at * std::sin(angle));
      depth.push_back(depth.back() + step * grid.stops_per_metre(grid.cells().read(cell)));
    }
    constexpr int photons = 1000000, bins = 10;
    std::vector<double> counted(bins + 1), expected(bins + 1);
    for (int k = 0; k < photons; ++k) {
      const double overcomes = -std::log1p(-random.uniform());
      const auto stop = std::upper_bound(depth.begin(), depth.end(), overcomes);
      const double at = step * static_cast<double>(stop - depth.begin() - 1);
      const CellAddress cell =
          grid.options().geometry.cell_of(x + at * std::cos(angle), y + at * std::sin(angle));
      counted[stop == depth.end() ? bins
                                  : static_cast<std::size_t>(std::abs(cell.column * 3 + cell.row)) % bins] +=
          1;
    }
    expected[bins] = photons * grid.along_beam(x, y, angle, end, [&](double at, double stopped) {
      const CellAddress cell =
          grid.options().geometry.cell_of(x + at * std::cos(angle), y + at * std::sin(angle));
      expected[static_cast<std::size_t>(std::abs(cell.column * 3 + cell.row)) % bins] += photons * stopped;
    });
    for (int b = 0; b <= bins; ++b) {
      const auto i = static_cast<std::size_t>(b);
      CHECK(std::abs(counted[i] - expected[i]) < 5 * std::sqrt(expected[i]) + 50);  // the steps are 1e-4 m
    }
  }

  TEST_CASE("stop_grid: a wall, glass that lets most through, and a hole in a wall") {
    StopGrid<> wall, glass, hole;
    for (int k = 0; k < 50; ++k) {
      wall.insert(beam(2.02), SE2());
      glass.insert(beam(k % 5 == 0 ? 2.02 : 4.02), SE2());
      hole.insert(beam(2.02), SE2(0, 0.2, 0));
      hole.insert(beam(8), SE2());
    }
    const auto likelihood = [](const StopGrid<>& grid, double range) {
      return grid.log_likelihood(beam(range), SE2());
    };
    CHECK(likelihood(wall, 2.02) > likelihood(wall, 4.02) + 0.3);
    CHECK(likelihood(wall, 2.02) > likelihood(wall, 1.0) + 0.3);
    CHECK(likelihood(glass, 4.02) > likelihood(glass, 2.02));  // four of five
    CHECK(likelihood(glass, 2.02) > likelihood(glass, 3.0) + 0.2);
    CHECK(likelihood(hole, 8) > likelihood(wall, 8) + 0.2);
    double at_glass = 0;
    static_cast<void>(glass.along_beam(
        0, 0, 0, 3, [&](double at, double p) { at_glass += std::abs(at - 2.02) < 0.1 ? p : 0; }));
    CHECK(at_glass > 0.1);
    CHECK(at_glass < 0.35);  // a fifth, and the prior
  }

  TEST_CASE("stop_grid: readings of one beam have densities and a probability that sum to one") {
    Random random(5);
    const StopGrid<> grid = random_grid(random, {.independence = 1});
    double sum = std::exp(grid.log_likelihood(beam(9), SE2(0.1, 0.2, 0.4)));
    constexpr double step = 0.002;
    for (double r = 0.05; r < 8; r += step)
      sum += step * std::exp(grid.log_likelihood(beam(r), SE2(0.1, 0.2, 0.4)));
    CHECK(sum == doctest::Approx(1).epsilon(0.02));  // noise carries a little below the nearest range
  }

  TEST_CASE("stop_grid: what is prepared answers as the grid does, and as the sum over the cells of a beam") {
    const std::uint64_t seed = cairn_test::seed(8);
    CAPTURE(seed);
    Random random(seed);
    const StopOptions options{.independence = 1};
    const StopGrid<> grid = random_grid(random, options);
    auto prepared = grid.prepared();
    for (int trial = 0; trial < 200; ++trial) {
      const double range = random.uniform(0.1, 9);
      const SE2 pose(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3));
      const double found = grid.log_likelihood(beam(range), pose);
      REQUIRE(prepared.log_likelihood(beam(range), pose) == found);
      double likelihood = 0;
      const double end = range < 8 ? static_cast<double>(static_cast<float>(range)) + 3 * options.sigma : 8.0;
      const double reach =
          grid.along_beam(pose.x(), pose.y(), pose.angle(), end, [&](double at, double stopped) {
            const double z = (static_cast<double>(static_cast<float>(range)) - at) / options.sigma;
            likelihood += stopped * 0.3989422804014327 / options.sigma * std::exp(-0.5 * z * z);
          });
      const double expected = range < 8 ? 0.95 * likelihood + 0.025 / 8 : 0.95 * reach + 0.025;
      REQUIRE(found == doctest::Approx(std::log(expected)).epsilon(0.01));  // what is 4 sigma off is left out
    }
  }

  TEST_CASE("stop_grid: over the tree of ancestors it is the same, bit for bit, through copies and deaths") {
    const std::uint64_t seed = cairn_test::seed(6);
    CAPTURE(seed);
    Random random(seed);
    using Tiles = StopGrid<SharedTiles<StopCell>>;
    using Tree = StopGrid<Ancestry<StopCell>>;
    std::vector<Tiles> tiles(6, Tiles());
    std::vector<Tree> trees(6, Tree());
    for (int step = 0; step < 60; ++step) {
      for (std::size_t i = 0; i < tiles.size(); ++i) {
        const LaserScan scan = beam(random.uniform(0.1, 9));
        const SE2 pose(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3));
        REQUIRE(tiles[i].log_likelihood(scan, pose) == trees[i].log_likelihood(scan, pose));
        tiles[i].insert(scan, pose);
        trees[i].insert(scan, pose);
      }
      const std::size_t from = random.below(6), to = random.below(6);
      tiles[to] = Tiles(tiles[from]);
      trees[to] = trees[from];
    }
    for (std::size_t i = 0; i < tiles.size(); ++i)
      tiles[i].cells().for_each_tile([&](TileAddress address, const auto& tile) {
        for (int k = 0; k < tile_cells; ++k)
          REQUIRE(tile[static_cast<std::size_t>(k)] ==
                  trees[i].cells().read(
                      {corner_of(address).column + k % tile_side, corner_of(address).row + k / tile_side}));
      });
  }

  TEST_CASE("stop_grid: ranges that are none change nothing, and options out of range are refused") {
    StopGrid<> grid;
    grid.insert(beam(NAN), SE2());
    grid.insert(beam(-1), SE2());
    CHECK(grid.cells().tile({0, 0}) == nullptr);
    CHECK(grid.log_likelihood(beam(NAN), SE2()) == 0);
    CHECK(cairn_test::message_of([] { StopGrid<> bad({.sigma = 0}); }).find("ranges") != std::string::npos);
    CHECK(cairn_test::message_of([&] { grid.insert(beam(1), SE2(1e12, 0, 0)); }).find("2^28") !=
          std::string::npos);
  }

  TEST_CASE_TEMPLATE(
      "stop_grid: a scan of which one beam ends outside is refused, and the grid stays as it was", Storage,
      SharedTiles<StopCell>, Ancestry<StopCell>) {
    StopGrid<Storage> grid;
    grid.insert(beam(2), SE2());
    const double cell = grid.options().geometry.cell_size;
    const auto lengths = [&] {
      double sum = 0;
      grid.cells().for_each_tile([&](TileAddress, const auto& tile) {
        for (const StopCell& each : tile) sum += each.length + each.stops;
      });
      return sum;
    };
    const double before = lengths();
    LaserScan two = beam(2, 40);
    two.angle_step = 0.01;
    two.range.push_back(10);
    for (const double edge :
         {cell * double(1 << 28) - 5, cell * 32 * 65536 - 5}) {  // of all cells, of the map
      CHECK_FALSE(cairn_test::message_of([&] { grid.insert(two, SE2(edge, 0, 0)); }).empty());
      CHECK(lengths() == before);
    }
    grid.insert(two, SE2(cell * 32 * 65536 - 15, 0, 0));
    CHECK(lengths() > before + 11);
  }
}

}  // namespace stop_grid_test
