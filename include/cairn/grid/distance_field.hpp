// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// From any cell of a grid the way to the nearest obstacle, where one is near, and which way its wall faces.
///
/// An obstacle is a point in a cell; its normal is across the line that it makes with the points of its
/// neighbours, if they make one. Of this nothing is stored in the grid but a bit a cell: ways are searched
/// where they are asked for, and what was found is kept for the next question. A filter that changes its maps
/// at every step and asks each for a thousand cells is spared to keep a million up to date.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A word for each row of a tile, a bit for each column: the cells that are obstacles.
using ObstacleBits = std::array<std::uint32_t, tile_side>;

/// A cell that may hold a point which stops beams: from its lower corner, 0 to 1 cell along each axis. Its
/// tiles have a bit for every cell that does.
template <class Cell>
concept ObstacleCell = requires(const Cell& c, const typename TileOf<Cell>::type& tile) {
  { c.point_x() } -> std::convertible_to<float>;
  { c.point_y() } -> std::convertible_to<float>;
  { tile.obstacles } -> std::convertible_to<const ObstacleBits&>;
};

/// What the field knows at a cell.
struct NearestObstacle {
  float dx = 0;  ///< from the cell's centre [cells]
  float dy = 0;
  float normal_x = 0;  ///< of length 1; both zero where the points around make no line, or nothing is near
  float normal_y = 0;
  bool found = false;

  [[nodiscard]] bool has_line() const noexcept { return normal_x != 0 || normal_y != 0; }
  friend bool operator==(const NearestObstacle&, const NearestObstacle&) = default;
};

/// Ways to the nearest obstacles within a radius. Lives no longer than the grid, and only until that is
/// changed. One object serves one thread.
template <ObstacleCell Cell>
class DistanceField {
public:
  static constexpr double largest_radius = 16;  ///< cells
  static constexpr int normal_reach = 2;        ///< cells to either side whose points make a line

  /// Throws Error where no field looks so far.
  static void expect_radius(double radius) {
    if (!(radius > 0 && radius <= largest_radius))
      raise("DistanceField: expected a radius above 0 and up to 16 cells");
  }

  /// A field that looks `radius` cells far, above 0 and at most 16. Throws Error.
  DistanceField(const SharedTiles<Cell>& cells, double radius)
      : cells_(&cells), radius_(static_cast<float>(radius)), nearest_(slots), normals_(slots / 4) {
    expect_radius(radius);
  }

  [[nodiscard]] double radius() const noexcept { return static_cast<double>(radius_); }

  /// The obstacle nearest to a cell's centre; of several at the same distance the lowest, then leftmost. O(1)
  /// where it was asked before, else O(distance^2). Valid until the next question.
  [[nodiscard]] const NearestObstacle& at(CellAddress cell) {
    auto& slot = nearest_[place(cell, slots)];
    if (slot.cell != cell) slot = {cell, searched(cell)};
    return slot.value;
  }
  /// The grid's cell.
  [[nodiscard]] const Cell& cell(CellAddress address) {
    look_around(address);
    return read(address);
  }

private:
  static constexpr std::uint32_t slots = 4096;  // a power of two
  struct Normal {
    float x = 0, y = 0;
  };
  template <class Value>
  struct Slot {
    CellAddress cell{std::numeric_limits<std::int32_t>::min(), 0};  // which is no cell
    Value value{};
  };

  [[nodiscard]] static std::uint32_t place(CellAddress cell, std::uint32_t count) noexcept {
    const std::uint32_t mixed = static_cast<std::uint32_t>(cell.column) * 0x9e3779b1U +
                                static_cast<std::uint32_t>(cell.row) * 0x85ebca77U;
    return (mixed >> 16U) & (count - 1);
  }

  /// Makes the tiles around a cell those that read() looks into.
  void look_around(CellAddress cell) {
    const TileAddress middle = tile_of(cell);
    if (looked_ && middle == middle_) return;
    looked_ = true;
    middle_ = middle;
    for (std::int32_t k = 0; k < 9; ++k)
      around_[static_cast<std::size_t>(k)] =
          cells_->tile({middle.column + k % 3 - 1, middle.row + k / 3 - 1});
  }
  /// A cell of the tiles around.
  [[nodiscard]] const Cell& read(CellAddress cell) const noexcept {
    const TileAddress tile = tile_of(cell);
    const auto* found = around_[static_cast<std::size_t>((tile.row - middle_.row + 1) * 3 +
                                                         (tile.column - middle_.column + 1))];
    return found == nullptr ? blank : (*found)[place_in_tile(cell)];
  }

  /// The obstacles of the row that is `row` above a cell's: bit 16 + k for the one k columns to the right.
  [[nodiscard]] std::uint64_t obstacles_beside(CellAddress cell, int row) const noexcept {
    const std::int32_t at = cell.row + row;
    const auto tiles = static_cast<std::size_t>(((at >> 5) - middle_.row + 1) * 3);
    const auto bits = [&](std::size_t k) -> std::uint64_t {
      const auto* tile = around_[tiles + k];
      return tile == nullptr ? 0 : tile->obstacles[static_cast<std::size_t>(at & 31)];
    };
    const auto k = static_cast<std::size_t>((cell.column >> 5) - middle_.column + 1);
    const auto column = static_cast<std::uint32_t>(cell.column & 31);
    return column < 16 ? (k == 0 ? 0 : bits(k - 1) >> (16 + column)) | bits(k) << (16 - column)
                       : bits(k) >> (column - 16) | (k == 2 ? 0 : bits(k + 1) << (48 - column));
  }
  /// Calls visit(column, x, y) for the points of the row `row` above the cell's and up to `reach` columns
  /// from it, seen from the cell's lower corner.
  template <class Visit>
  void points_of_row(CellAddress cell, int row, int reach, const Visit& visit) const {
    const std::uint64_t window = (std::uint64_t{2} << static_cast<unsigned>(2 * reach)) - 1;
    std::uint64_t left = obstacles_beside(cell, row) & window << static_cast<unsigned>(16 - reach);
    for (; left != 0; left &= left - 1) {
      const int column = std::countr_zero(left) - 16;
      const Cell& c = read({cell.column + column, cell.row + row});
      visit(column, static_cast<float>(column) + c.point_x(), static_cast<float>(row) + c.point_y());
    }
  }

  [[nodiscard]] NearestObstacle searched(CellAddress cell) {
    look_around(cell);
    NearestObstacle best;
    CellAddress of_best{};
    float least = radius_ * radius_;
    int reach = static_cast<int>(std::ceil(radius_));
    const auto search_row = [&](int row) {
      points_of_row(cell, row, reach, [&](int column, float x, float y) {
        const float dx = x - 0.5F, dy = y - 0.5F, squared = dx * dx + dy * dy;
        const CellAddress at{cell.column + column, cell.row + row};
        const bool before = at.row < of_best.row || (at.row == of_best.row && at.column < of_best.column);
        if (squared > least || (squared == least && !(best.found && before))) return;
        least = squared;
        best = {dx, dy, 0, 0, true};
        of_best = at;
      });
    };
    search_row(0);
    for (int row = 1; row <= reach; ++row) {  // no point there is nearer than half a cell less than its row
      search_row(-row);
      search_row(row);
      while (reach > row && squared_of(static_cast<float>(reach) - 0.5F) > least) --reach;
    }
    if (!best.found) return best;
    auto& slot = normals_[place(of_best, slots / 4)];
    if (slot.cell != of_best) slot = {of_best, normal_at(of_best)};
    best.normal_x = slot.value.x;
    best.normal_y = slot.value.y;
    return best;
  }
  [[nodiscard]] static float squared_of(float x) noexcept { return x * x; }

  /// Across the line through an obstacle and its neighbours: the direction in which they spread least.
  [[nodiscard]] Normal normal_at(CellAddress cell) const {
    const Cell& middle = read(cell);
    float n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
    for (int row = -normal_reach; row <= normal_reach; ++row)
      points_of_row(cell, row, normal_reach, [&](int, float at_x, float at_y) {
        const float x = at_x - middle.point_x(), y = at_y - middle.point_y();
        n += 1;
        sx += x;
        sy += y;
        sxx += x * x;
        sxy += x * y;
        syy += y * y;
      });
    if (n < 3) return {};
    const float xx = sxx - sx * sx / n, xy = sxy - sx * sy / n, yy = syy - sy * sy / n;
    const float half = 0.5F * (xx + yy), difference = 0.5F * (xx - yy);
    const float root = std::sqrt(difference * difference + xy * xy);
    constexpr float thin = 0.1F;  // variance across a line over that along it
    if (!(half - root < thin * (half + root))) return {};
    // Cosine and sine of the line's angle from those of its double, the larger one first.
    const float cosine2 = difference / root, sine2 = xy / root;
    if (cosine2 > 0) {
      const float cosine = std::sqrt(0.5F * (1 + cosine2));
      return {-0.5F * sine2 / cosine, cosine};
    }
    const float sine = std::sqrt(0.5F * (1 - cosine2));
    return {-sine, 0.5F * sine2 / sine};
  }

  static inline const Cell blank{};
  const SharedTiles<Cell>* cells_;
  float radius_;
  std::vector<Slot<NearestObstacle>> nearest_;
  std::vector<Slot<Normal>> normals_;
  std::array<const typename SharedTiles<Cell>::Tile*, 9> around_{};
  TileAddress middle_{};
  bool looked_ = false;
};

}}  // namespace cairn::CAIRN_ABI
