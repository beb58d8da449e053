// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/parallel.hpp>
#include <cairn/grid/shared_tiles.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace shared_tiles_test {
namespace {

using namespace cairn;

struct Pair {
  float a = 0;
  std::uint16_t b = 0;
  friend bool operator==(const Pair&, const Pair&) = default;
};

/// A cell that counts how many there are.
struct Living {
  static inline std::atomic<long> count{0};
  int value = 0;
  Living() { ++count; }
  Living(const Living& other) : value(other.value) { ++count; }
  Living& operator=(const Living&) = default;
  ~Living() { --count; }
};

template <class Cell>
Cell drawn(Random& random) {
  if constexpr (std::is_same_v<Cell, Pair>)
    return {static_cast<float>(random.uniform()), static_cast<std::uint16_t>(random.below(1000))};
  else
    return static_cast<Cell>(1 + random.below(200));
}

/// Every cell that was written, by address.
template <class Cell>
std::map<CellAddress, Cell> written(const SharedTiles<Cell>& grid) {
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

TEST_SUITE("grid/shared_tiles") {
  TEST_CASE_TEMPLATE("shared_tiles: a run of writes, copies and deaths gives the maps of plain copies", Cell,
                     std::uint8_t, std::int32_t, Pair) {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    constexpr std::size_t particles = 8;
    std::vector<SharedTiles<Cell>> grids(particles);
    std::vector<std::map<CellAddress, Cell>> plain(particles);
    for (int step = 0; step < 300; ++step) {
      for (std::size_t i = 0; i < particles; ++i)
        for (int k = 0; k < 20; ++k) {
          const CellAddress cell{static_cast<std::int32_t>(random.below(1400)) - 700 + step,
                                 static_cast<std::int32_t>(random.below(300)) - 150};
          const Cell value = drawn<Cell>(random);
          grids[i].write(cell) = value;
          plain[i][cell] = value;
        }
      if (step % 10 == 9) {  // one dies, and another takes its place
        const std::size_t from = random.below(particles), to = random.below(particles);
        grids[to] = SharedTiles<Cell>(grids[from]);
        plain[to] = plain[from];
      }
    }
    for (std::size_t i = 0; i < particles; ++i) REQUIRE(written(grids[i]) == plain[i]);
  }

  TEST_CASE("shared_tiles: copies share what none has changed, and nothing is left at the end") {
    const long before = Living::count;
    {
      SharedTiles<Living> grid;
      for (int i = 0; i < 20; ++i) grid.write({i * tile_side, -5 * i}).value = i;
      const SharedTiles<Living> copy = grid;
      for (int i = 0; i < 20; ++i)
        CHECK(copy.tile(tile_of({i * tile_side, -5 * i})) == grid.tile(tile_of({i * tile_side, -5 * i})));
      grid.write({3 * tile_side, -15}).value = 77;
      int shared = 0;
      for (int i = 0; i < 20; ++i)
        shared += copy.tile(tile_of({i * tile_side, -5 * i})) == grid.tile(tile_of({i * tile_side, -5 * i}));
      CHECK(shared == 19);
      CHECK(copy.read({3 * tile_side, -15}).value == 3);
      CHECK(grid.read({3 * tile_side, -15}).value == 77);
    }
    CHECK(Living::count == before);
  }

  TEST_CASE("shared_tiles: a tile taken from another grid is shared until one of them writes") {
    SharedTiles<int> from, to;
    from.write({1000, -3}) = 7;
    to.write({0, 0}) = 1;
    to.share_tile(tile_of({1000, -3}), from);
    to.share_tile({5, 5}, from);
    CHECK(to.tile(tile_of({1000, -3})) == from.tile(tile_of({1000, -3})));
    CHECK(to.tile({5, 5}) == nullptr);
    to.write({1000, -3}) = 8;
    CHECK(from.read({1000, -3}) == 7);
    CHECK(to.read({1000, -3}) == 8);
    CHECK(to.read({0, 0}) == 1);
  }

  TEST_CASE("shared_tiles: what was never written is the empty cell, near and far") {
    SharedTiles<int> grid;
    CHECK(grid.read({0, 0}) == 0);
    grid.write({5, 5}) = 1;
    CHECK(grid.read({6, 5}) == 0);
    CHECK(grid.read({-100000000, 100000000}) == 0);
    CHECK(grid.tile({1, 0}) == nullptr);
  }

  TEST_CASE("shared_tiles: a grid that would be too wide is refused in words, and stays as it was") {
    SharedTiles<int> grid;
    grid.write({0, 0}) = 1;
    const std::string words = cairn_test::message_of([&] { grid.write({farthest_cell, 0}) = 2; });
    CHECK(words.find("65536 tiles") != std::string::npos);
    CHECK(grid.read({0, 0}) == 1);
    CHECK(grid.read({farthest_cell, 0}) == 0);
  }

  TEST_CASE("shared_tiles: has_room says what write would refuse") {
    SharedTiles<int> grid;
    CHECK(grid.has_room({0, 0}, {65535, 65535}));
    CHECK_FALSE(grid.has_room({0, 0}, {65536, 0}));
    CHECK_FALSE(grid.has_room({0, -1}, {0, 65535}));
    grid.write({0, 0}) = 1;
    for (const std::int32_t column : {-65521, -65520, -1, 0, 65535, 65536}) {
      SharedTiles<int> copy = grid;
      const std::string words = cairn_test::message_of([&] { copy.write(corner_of({column, 3})) = 2; });
      CAPTURE(column);
      CHECK(grid.has_room({column, 3}, {column, 3}) == words.empty());
    }
  }

  TEST_CASE("shared_tiles: copies may be written from several threads at once") {
    SharedTiles<int> base;
    for (int i = 0; i < 64; ++i) base.write({i * tile_side, 0}) = 1;
    std::vector<SharedTiles<int>> copies(4, base);
    {
      std::vector<cairn::JoiningThread> threads;
      for (int t = 0; t < 4; ++t)
        threads.emplace_back([&copies, t] {
          for (int i = 0; i < 64; ++i) copies[static_cast<std::size_t>(t)].write({i * tile_side, 0}) += t;
        });
    }
    for (int t = 0; t < 4; ++t)
      for (int i = 0; i < 64; ++i)
        REQUIRE(copies[static_cast<std::size_t>(t)].read({i * tile_side, 0}) == 1 + t);
    CHECK(base.read({0, 0}) == 1);
  }
}

}  // namespace shared_tiles_test
