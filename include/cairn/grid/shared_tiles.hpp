// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A grid whose copies share what none of them has changed: the maps of a particle filter.
///
///   root -> blocks of 16 x 16 tiles -> tiles of 32 x 32 cells, each counted
/// Copying is O(1); writing copies the root, one block and one tile where others hold them, and later writes
/// to the same tile copy nothing. Cells that were never written are Cell{}. Different objects may be used
/// from different threads at once also where they share tiles; one object may be read by several threads.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/counted.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What a tile of such cells is: an array of them, row by row. A specialisation may keep more beside the
/// cells, which read and write like an array's, or keep them in another way: its [] then gives them by value,
/// and they are written by what writable_tile() has for it.
template <class Cell>
struct TileOf {
  using type = std::array<Cell, tile_cells>;
};

template <class Cell>
class SharedTiles {
public:
  using Tile = typename TileOf<Cell>::type;
  /// A cell that is read: by reference where the tile has it as such.
  using CellRead = decltype(std::declval<const Tile&>()[std::size_t{}]);
  static constexpr bool has_references =
      std::is_same_v<decltype(std::declval<Tile&>()[std::size_t{}]), Cell&>;

  /// The cell, or Cell{} where nothing was written. Two loads and a comparison from the tile's own.
  [[nodiscard]] CellRead read(CellAddress cell) const noexcept {
    const Tile* found = tile(tile_of(cell));
    return found == nullptr ? blank : (*found)[place_in_tile(cell)];
  }
  /// The cell of this grid alone. Throws Error where the grid would be wider than 2^16 tiles.
  [[nodiscard]] Cell& write(CellAddress cell)
    requires has_references
  {
    return writable_tile(tile_of(cell))[place_in_tile(cell)];
  }

  /// The tile, or null where nothing was written.
  [[nodiscard]] const Tile* tile(TileAddress address) const noexcept {
    const Root* root = root_.get();
    if (root == nullptr) return nullptr;
    const std::size_t place = root->place(address);
    if (place == none) return nullptr;
    const Block* block = root->blocks[place].get();
    return block == nullptr ? nullptr : (*block)[place_in_block(address)].get();
  }
  /// The tile of this grid alone; valid until the grid is copied or changed elsewhere.
  [[nodiscard]] Tile& writable_tile(TileAddress address) {
    if (!root_ || root_.get()->place(address) == none) grow(address);
    Root& root = root_.own();
    return root.blocks[root.place(address)].own()[place_in_block(address)].own();
  }

  /// Whether all tiles from `low` to `high` can be written: the grid would not become too wide.
  [[nodiscard]] bool has_room(TileAddress low, TileAddress high) const noexcept {
    const Root wide = widened(low, high);
    return wide.columns <= most_blocks && wide.rows <= most_blocks;
  }
  /// Throws Error as write() does where there is no room for them: to be asked before the first of many
  /// writes.
  void expect_room(TileAddress low, TileAddress high) const {
    if (!has_room(low, high))
      raise("SharedTiles: expected cells within a square of 65536 tiles, found tile " +
            std::to_string(high.column) + ", " + std::to_string(high.row) + " outside of it");
  }

  /// Reads many cells, neighbours soonest: two loads and a comparison are spared within a tile. Lives no
  /// longer than the grid, and only until it is changed.
  class Reader {
  public:
    explicit Reader(const SharedTiles& grid) noexcept : grid_(&grid) {}
    [[nodiscard]] CellRead operator()(CellAddress cell) noexcept {
      if (const TileAddress address = tile_of(cell); !any_ || address != address_) {
        any_ = true;
        address_ = address;
        tile_ = grid_->tile(address);
      }
      return tile_ == nullptr ? blank : (*tile_)[place_in_tile(cell)];
    }

  private:
    const SharedTiles* grid_;
    const Tile* tile_ = nullptr;
    TileAddress address_;
    bool any_ = false;
  };
  [[nodiscard]] Reader reader() const noexcept { return Reader(*this); }

  /// Writes many cells, neighbours soonest; the grid must not be changed or copied otherwise meanwhile.
  class Writer {
  public:
    explicit Writer(SharedTiles& grid) noexcept : grid_(&grid) {}
    /// Throws Error as write() does.
    [[nodiscard]] Cell& operator()(CellAddress cell)
      requires has_references
    {
      return tile(tile_of(cell))[place_in_tile(cell)];
    }
    /// The same, of a tile.
    [[nodiscard]] Tile& tile(TileAddress address) {
      if (tile_ == nullptr || address != address_) {
        tile_ = &grid_->writable_tile(address);
        address_ = address;
      }
      return *tile_;
    }

  private:
    SharedTiles* grid_;
    Tile* tile_ = nullptr;
    TileAddress address_;
  };
  [[nodiscard]] Writer writer() noexcept { return Writer(*this); }

  /// Makes the tile of `other` this grid's too, shared until one of them writes. Nothing where there is none.
  /// Throws Error as write does.
  void share_tile(TileAddress address, const SharedTiles& other) {
    if (other.tile(address) == nullptr) return;
    const Block& block = *other.root_.get()->blocks[other.root_.get()->place(address)].get();
    if (!root_ || root_.get()->place(address) == none) grow(address);
    Root& root = root_.own();
    root.blocks[root.place(address)].own()[place_in_block(address)] = block[place_in_block(address)];
  }

  /// Calls visit(address, tile) for every tile there is, by rows of blocks: the same order for equal writes.
  template <class Visit>
  void for_each_tile(Visit&& visit) const {
    const Root* root = root_.get();
    if (root == nullptr) return;
    for (std::size_t b = 0; b < root->blocks.size(); ++b) {
      const Block* block = root->blocks[b].get();
      if (block == nullptr) continue;
      const auto column = root->column + static_cast<std::int32_t>(b) % root->columns;
      const auto row = root->row + static_cast<std::int32_t>(b) / root->columns;
      for (std::int32_t t = 0; t < block_side * block_side; ++t)
        if (const Tile* found = (*block)[static_cast<std::size_t>(t)].get())
          visit(TileAddress{column * block_side + t % block_side, row * block_side + t / block_side}, *found);
    }
  }

private:
  static constexpr std::int32_t block_side = 16;        // tiles
  static constexpr std::int32_t most_blocks = 1 << 12;  // a side
  static constexpr std::size_t none = ~std::size_t{0};
  using Block = std::array<Counted<Tile>, static_cast<std::size_t>(block_side* block_side)>;

  /// Blocks in a rectangle that grows to hold what is written.
  struct Root {
    std::int32_t column = 0, row = 0, columns = 0, rows = 0;  // in blocks
    std::vector<Counted<Block>> blocks{};

    [[nodiscard]] std::size_t place(TileAddress tile) const noexcept {
      const std::int32_t c = (tile.column >> 4) - column, r = (tile.row >> 4) - row;
      if (c < 0 || r < 0 || c >= columns || r >= rows) return none;
      return static_cast<std::size_t>(r) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c);
    }
  };
  [[nodiscard]] static std::size_t place_in_block(TileAddress tile) noexcept {
    return static_cast<std::size_t>((tile.row & 15) * block_side + (tile.column & 15));
  }

  /// The rectangle of blocks, without any, that holds those there are and these tiles.
  [[nodiscard]] Root widened(TileAddress low, TileAddress high) const noexcept {
    std::int32_t left = low.column >> 4, top = low.row >> 4, right = high.column >> 4, bottom = high.row >> 4;
    if (const Root* old = root_.get()) {
      left = std::min(left, old->column);
      top = std::min(top, old->row);
      right = std::max(right, old->column + old->columns - 1);
      bottom = std::max(bottom, old->row + old->rows - 1);
    }
    return {left, top, right - left + 1, bottom - top + 1, {}};
  }
  void grow(TileAddress address) {
    expect_room(address, address);
    Root next = widened(address, address);
    next.blocks.resize(static_cast<std::size_t>(next.columns) * static_cast<std::size_t>(next.rows));
    if (const Root* old = root_.get())
      for (std::int32_t row = 0; row < old->rows; ++row)
        for (std::int32_t column = 0; column < old->columns; ++column) {
          const TileAddress first{(old->column + column) * block_side, (old->row + row) * block_side};
          next.blocks[next.place(first)] = old->blocks[old->place(first)];
        }
    Counted<Root> root;
    root.own() = std::move(next);
    root_ = std::move(root);
  }

  static inline const Cell blank{};
  Counted<Root> root_;
};

}}  // namespace cairn::CAIRN_ABI
