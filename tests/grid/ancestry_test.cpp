// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <type_traits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/grid/ancestry.hpp>
#include <cairn/grid/shared_tiles.hpp>

#include "support/random.hpp"

namespace ancestry_test {
namespace {

using namespace cairn;

struct Pair {
  float a = 0;
  std::uint16_t b = 0;
  friend bool operator==(const Pair&, const Pair&) = default;
};

template <class Cell>
Cell drawn(Random& random) {
  if constexpr (std::is_same_v<Cell, Pair>)
    return {static_cast<float>(random.uniform()), static_cast<std::uint16_t>(random.below(1000))};
  else
    return static_cast<Cell>(1 + random.below(200));
}

/// Every cell that is not empty, by address.
template <class Cell, class Grid>
std::map<CellAddress, Cell> written(const Grid& grid) {
  std::map<CellAddress, Cell> cells;
  grid.for_each_tile([&](TileAddress address, const auto& tile) {
    for (int i = 0; i < tile_cells; ++i)
      if (!(tile[static_cast<std::size_t>(i)] == Cell{}))
        cells[{corner_of(address).column + i % tile_side, corner_of(address).row + i / tile_side}] =
            tile[static_cast<std::size_t>(i)];
  });
  return cells;
}

}  // namespace

TEST_SUITE("grid/ancestry") {
  TEST_CASE_TEMPLATE(
      "ancestry: a run of writes, copies and deaths: the tree, shared tiles and plain copies are equal", Cell,
      std::uint8_t, std::int32_t, Pair) {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    constexpr std::size_t particles = 8;
    std::vector<Ancestry<Cell>> trees(particles, Ancestry<Cell>());
    std::vector<SharedTiles<Cell>> tiles(particles);
    std::vector<std::map<CellAddress, Cell>> plain(particles);
    const auto somewhere = [&](int step) {
      return CellAddress{static_cast<std::int32_t>(random.below(90)) - 45 + step / 3,
                         static_cast<std::int32_t>(random.below(60)) - 30};
    };
    const auto write_some = [&](int count, int step, auto& tree, auto& tile, auto& map) {
      auto to_tree = tree.writer();
      auto to_tile = tile.writer();
      for (int k = 0; k < count; ++k) {
        const CellAddress cell = somewhere(step);
        const Cell value = drawn<Cell>(random);
        (step % 2 == 0 ? tree.write(cell) : to_tree(cell)) = value;
        (step % 2 == 0 ? tile.write(cell) : to_tile(cell)) = value;
        map[cell] = value;
      }
    };
    for (int step = 0; step < 300; ++step) {
      for (std::size_t i = 0; i < particles; ++i) write_some(20, step, trees[i], tiles[i], plain[i]);
      if (step % 5 == 4)  // some die, and others take their places
        for (int death = 0; death < 4; ++death) {
          const std::size_t from = random.below(particles), to = random.below(particles);
          trees[to] = trees[from];
          tiles[to] = SharedTiles<Cell>(tiles[from]);
          plain[to] = plain[from];
        }
      for (int look = 0; look < 20; ++look) {
        const std::size_t i = random.below(particles);
        auto from_tree = trees[i].reader();
        auto from_tile = tiles[i].reader();
        for (int cells = 0; cells < 3; ++cells) {
          const CellAddress cell = somewhere(step);
          const auto known = plain[i].find(cell);
          const Cell value = known == plain[i].end() ? Cell{} : known->second;
          REQUIRE(trees[i].read(cell) == value);
          REQUIRE(from_tree(cell) == value);
          REQUIRE(from_tile(cell) == value);
        }
      }
      REQUIRE(trees[0].nodes() <= 2 * particles - 1);
      REQUIRE(trees[0].consistent());
      std::set<const void*> shared;
      std::size_t separate = 0;
      for (const SharedTiles<Cell>& grid : tiles)
        grid.for_each_tile([&](TileAddress, const auto& tile) {
          shared.insert(&tile);
          ++separate;
        });
      REQUIRE(trees[0].as_tiles().shared == shared.size());
      REQUIRE(trees[0].as_tiles().separate == separate);
    }
    for (std::size_t i = 0; i < particles; ++i) {
      REQUIRE(written<Cell>(trees[i]) == plain[i]);
      REQUIRE(written<Cell>(trees[i]) == written<Cell>(tiles[i]));
    }
  }

  TEST_CASE(
      "ancestry: ten thousand steps of a filter in a closed place need no more memory than the first "
      "hundreds") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    constexpr std::size_t particles = 10;
    std::vector<Ancestry<float>> grids(particles, Ancestry<float>());
    std::size_t early_entries = 0, late_entries = 0, early_bytes = 0;
    for (int step = 0; step < 10000; ++step) {
      for (auto& grid : grids)
        for (int k = 0; k < 5; ++k)
          grid.write({static_cast<std::int32_t>(random.below(24)),
                      static_cast<std::int32_t>(random.below(24))}) += 1;
      if (step % 3 == 2) {  // all at once, as resampling does it
        std::vector<Ancestry<float>> next;
        for (std::size_t i = 0; i < particles; ++i) next.push_back(grids[random.below(particles)]);
        grids = std::move(next);
      }
      REQUIRE(grids[0].nodes() <= 2 * particles - 1);
      auto& most = step < 1000 ? early_entries : late_entries;
      most = std::max(most, grids[0].entries());
      if (step == 2000) early_bytes = grids[0].bytes();
    }
    CHECK(grids[0].consistent());
    CHECK(late_entries < early_entries + early_entries / 2);
    CHECK(grids[0].bytes() < early_bytes + early_bytes / 3);  // capacities settle late
  }

  TEST_CASE("ancestry: where only one grid is left the tree is one node, and holds each cell once") {
    Ancestry<int> last;
    {
      std::vector<Ancestry<int>> grids(5, Ancestry<int>());
      Random random(3);
      for (int step = 0; step < 50; ++step) {
        for (std::size_t i = 0; i < grids.size(); ++i)
          grids[i].write({static_cast<std::int32_t>(random.below(9)), 0}) = static_cast<int>(i) + 1;
        grids[random.below(5)] = grids[random.below(5)];
      }
      last = grids[2];
    }
    CHECK(last.consistent());
    CHECK(last.nodes() == 1);
    CHECK(last.entries() == written<int>(last).size());
    last.write({100, 100}) = 5;
    CHECK(last.nodes() == 1);
  }

  TEST_CASE("ancestry: grids that were never copied from each other are of different trees") {
    Ancestry<int> a, b;
    a.write({1, 2}) = 3;
    CHECK(b.read({1, 2}) == 0);
    CHECK(b.entries() == 0);
    b = a;
    CHECK(b.entries() == 1);
    Ancestry<int> c = std::move(b);
    CHECK(c.read({1, 2}) == 3);
    CHECK(a.consistent());
  }
}

}  // namespace ancestry_test
