// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Cells of an unbounded plane and the square tiles that hold them.
///
/// Cell (column, row) covers [column, column + 1) x [row, row + 1) cell sizes from the origin: world to cell
/// is floor, never rounding, so that a cell means the same on either side of the origin. Tiles are 32 x 32
/// cells, row by row. The folder grid/ needs the standard library alone and knows nothing of filters.
#pragma once

#include <cmath>
#include <compare>
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A cell of the plane.
struct CellAddress {
  std::int32_t column = 0;
  std::int32_t row = 0;
  [[nodiscard]] friend constexpr auto operator<=>(const CellAddress&, const CellAddress&) = default;
};

/// A tile of the plane: the cells from 32 * (column, row) on.
struct TileAddress {
  std::int32_t column = 0;
  std::int32_t row = 0;
  [[nodiscard]] friend constexpr auto operator<=>(const TileAddress&, const TileAddress&) = default;
};

inline constexpr int tile_side = 32;                      ///< cells
inline constexpr int tile_cells = tile_side * tile_side;  ///< in one tile
inline constexpr std::int32_t farthest_cell = 1 << 28;    ///< cells are between -2^28 and 2^28

/// The tile of a cell; shifts of negative numbers are arithmetic since C++20.
[[nodiscard]] constexpr TileAddress tile_of(CellAddress cell) noexcept {
  return {cell.column >> 5, cell.row >> 5};
}
/// Where a cell stands in its tile: 0 to 1023.
[[nodiscard]] constexpr std::size_t place_in_tile(CellAddress cell) noexcept {
  return static_cast<std::size_t>((cell.row & 31) * tile_side + (cell.column & 31));
}
/// The first cell of a tile.
[[nodiscard]] constexpr CellAddress corner_of(TileAddress tile) noexcept {
  return {tile.column * tile_side, tile.row * tile_side};
}

/// How cells lie in the world [m].
struct GridGeometry {
  double cell_size = 0.05;  ///< [m], > 0
  double origin_x = 0;      ///< of cell (0, 0)'s lower corner [m]
  double origin_y = 0;

  [[nodiscard]] double column_of(double x) const noexcept { return (x - origin_x) / cell_size; }
  [[nodiscard]] double row_of(double y) const noexcept { return (y - origin_y) / cell_size; }

  /// Whether a point has a cell: finite, and less than 2^28 cells from the origin.
  [[nodiscard]] bool contains(double x, double y) const noexcept {
    return std::abs(column_of(x)) < farthest_cell && std::abs(row_of(y)) < farthest_cell;
  }
  /// The cell of a point that has one.
  [[nodiscard]] CellAddress cell_of(double x, double y) const noexcept {
    CAIRN_ASSERT(contains(x, y), "cell_of needs a finite point less than 2^28 cells from the origin");
    return {static_cast<std::int32_t>(std::floor(column_of(x))),
            static_cast<std::int32_t>(std::floor(row_of(y)))};
  }
  [[nodiscard]] double center_x(CellAddress cell) const noexcept {
    return origin_x + (cell.column + 0.5) * cell_size;
  }
  [[nodiscard]] double center_y(CellAddress cell) const noexcept {
    return origin_y + (cell.row + 0.5) * cell_size;
  }
};

}}  // namespace cairn::CAIRN_ABI
