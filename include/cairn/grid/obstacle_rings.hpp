// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How near the next obstacle is to a cell, in three steps, from the bits of the tiles alone: what a search
/// over many poses asks before it asks for ways.
///
/// A tile's rings are its bits and its neighbours' spread by whole words, 32 cells at once: some thousand
/// operations a tile, after which a cell costs one look.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/grid/distance_field.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Lives no longer than the grid, and only until that is changed. One object serves one thread.
///
/// With x and y the columns and rows to an obstacle, a cell lies in the
///   innermost ring where  max(|x|, |y|) <= 1,
///   middle one where      max(|x| - 2, 0) + max(|y| - 2, 0) <= 1,
///   outermost where       max(|x| - 3, 0) + max(|y| - 3, 0) <= 2
/// of any, and in all those around it: a square and two octagons of radius 1, 3 and 5 cells.
template <ObstacleCell Cell>
class ObstacleRings {
public:
  static constexpr int rings = 3;
  /// Of each ring the middle of the distances that end in it and in none within [cells].
  static constexpr std::array<float, rings> distance{0.5F, 2, 4};

  explicit ObstacleRings(const SharedTiles<Cell>& cells) : cells_(&cells) {}

  /// How many rings the cell lies in: 3 next to an obstacle, 0 far from all. O(1), and O(tile) where a tile
  /// is asked for the first time.
  [[nodiscard]] int around(CellAddress cell) {
    const std::array<std::uint32_t, 4>& row = tile(tile_of(cell))[static_cast<std::size_t>(cell.row & 31)];
    const auto column = static_cast<std::uint32_t>(cell.column & 31);
    return static_cast<int>((row[0] >> column & 1U) + (row[1] >> column & 1U) + (row[2] >> column & 1U));
  }

private:
  static constexpr int margin = 5;  // cells that an obstacle is felt beyond its tile
  static constexpr int side = tile_side + 2 * margin;
  using Window = std::array<std::uint64_t, side>;                    // bit 5 + k for the tile's column k
  using Tile = std::array<std::array<std::uint32_t, 4>, tile_side>;  // of a row a word a ring
  struct Slot {
    TileAddress address;
    std::uint32_t place = 0;  // one more than its place among the tiles
  };

  [[nodiscard]] const Tile& tile(TileAddress address) {
    Slot& slot = slots_[static_cast<std::size_t>((address.column & 15) + 16 * (address.row & 15))];
    if (slot.place == 0 || slot.address != address) {
      if (slot.place == 0) {
        tiles_.emplace_back();
        slot.place = static_cast<std::uint32_t>(tiles_.size());
      }
      slot.address = address;
      spread(address, tiles_[slot.place - 1]);
    }
    return tiles_[slot.place - 1];
  }

  void spread(TileAddress address, Tile& out) const {
    std::array<const typename SharedTiles<Cell>::Tile*, 9> around{};
    for (std::int32_t k = 0; k < 9; ++k)
      around[static_cast<std::size_t>(k)] =
          cells_->tile({address.column + k % 3 - 1, address.row + k / 3 - 1});
    Window window;
    for (int r = 0; r < side; ++r) {
      const int row = r - margin;
      const std::size_t first = row < 0 ? 0 : row < tile_side ? 3 : 6;
      const auto bits = [&](std::size_t k) -> std::uint64_t {
        return around[first + k] == nullptr
                   ? 0
                   : around[first + k]->obstacles[static_cast<std::size_t>(row & 31)];
      };
      window[static_cast<std::size_t>(r)] =
          bits(0) >> (tile_side - margin) | bits(1) << margin | bits(2) << (tile_side + margin);
    }
    const auto keep = [&](std::size_t ring) {
      for (std::size_t r = 0; r < tile_side; ++r)
        out[r][ring] = static_cast<std::uint32_t>(window[r + margin] >> margin);
    };
    widen(window, true);
    keep(0);
    widen(window, false);
    widen(window, true);
    keep(1);
    widen(window, false);
    widen(window, true);
    keep(2);
  }

  /// By one cell: along the axes, or to all eight neighbours. What is beyond the window is not seen, which
  /// eats a cell of its margin each time.
  static void widen(Window& window, bool corners) noexcept {
    const Window before = window;
    for (std::size_t r = 0; r < side; ++r) {
      const auto along = [&](std::uint64_t w) { return w | w << 1 | w >> 1; };
      const std::uint64_t below = r == 0 ? 0 : before[r - 1], above = r + 1 == side ? 0 : before[r + 1];
      window[r] = along(before[r]) | (corners ? along(below | above) : below | above);
    }
  }

  const SharedTiles<Cell>* cells_;
  std::array<Slot, 256> slots_{};
  std::vector<Tile> tiles_;
};

}}  // namespace cairn::CAIRN_ABI
