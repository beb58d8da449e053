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
    reach_ = static_cast<int>(std::ceil(std::clamp(radius, double{normal_reach}, largest_radius)));
  }

  [[nodiscard]] double radius() const noexcept { return static_cast<double>(radius_); }

  /// The obstacle nearest to a cell's centre; of several at the same distance the lowest, then leftmost. O(1)
  /// where it was asked before, else O(distance^2). Valid until the next question.
  [[nodiscard]] const NearestObstacle& at(CellAddress cell) {
    auto& slot = nearest_[place(cell, slots)];
    if (slot.key != key_of(cell)) slot = {key_of(cell), searched(cell)};
    return slot.value;
  }
  /// The grid's cell.
  [[nodiscard]] typename SharedTiles<Cell>::CellRead cell(CellAddress address) {
    return around(tile_of(address)).read(address);
  }

private:
  static constexpr std::uint32_t slots = 4096;  // a power of two
  struct Normal {
    float x = 0, y = 0;
  };
  template <class Value>
  struct Slot {
    std::uint64_t key = 0;  // of no cell
    Value value{};
  };
  /// One number for a cell, and never 0.
  [[nodiscard]] static std::uint64_t key_of(CellAddress cell) noexcept {
    const std::uint32_t column = static_cast<std::uint32_t>(cell.column) ^ 0x80000000U;
    return std::uint64_t{column} << 32U | static_cast<std::uint32_t>(cell.row);
  }

  [[nodiscard]] static std::uint32_t place(CellAddress cell, std::uint32_t count) noexcept {
    const std::uint32_t mixed = static_cast<std::uint32_t>(cell.column) * 0x9e3779b1U +
                                static_cast<std::uint32_t>(cell.row) * 0x85ebca77U;
    return (mixed >> 16U) & (count - 1);
  }

  /// A tile, its neighbours, and their obstacles row by row: bit 16 + k of a word for the tile's column k.
  struct Around {
    TileAddress middle;
    std::array<const typename SharedTiles<Cell>::Tile*, 9> tiles{};
    std::array<std::uint64_t, 2 * tile_side> rows;  // from 16 below the tile on

    /// A cell of these tiles.
    [[nodiscard]] typename SharedTiles<Cell>::CellRead read(CellAddress cell) const noexcept {
      const TileAddress tile = tile_of(cell);
      const auto* found = tiles[static_cast<std::size_t>((tile.row - middle.row + 1) * 3 +
                                                         (tile.column - middle.column + 1))];
      return found == nullptr ? blank : (*found)[place_in_tile(cell)];
    }
    /// The obstacles of the row that is `row` above a cell's of the tile: bit 16 + k for the one k columns to
    /// the right.
    [[nodiscard]] std::uint64_t obstacles_beside(CellAddress cell, int row) const noexcept {
      return rows[static_cast<std::size_t>((cell.row & 31) + row + 16)] >> (cell.column & 31);
    }
  };

  /// Valid until the next question.
  [[nodiscard]] const Around& around(TileAddress middle) {
    if (here_ < around_.size() && around_[here_].middle == middle) return around_[here_];
    std::uint16_t& known = known_[static_cast<std::size_t>((middle.column & 15) + 16 * (middle.row & 15))];
    if (known == 0) {
      around_.emplace_back();
      known = static_cast<std::uint16_t>(around_.size());
    } else if (around_[known - 1U].middle == middle) {
      return around_[here_ = known - 1U];
    }
    here_ = known - 1U;
    look_around(middle, around_[here_]);
    return around_[here_];
  }
  void look_around(TileAddress middle, Around& out) const {
    out.middle = middle;
    for (std::int32_t k = 0; k < 9; ++k)
      out.tiles[static_cast<std::size_t>(k)] =
          cells_->tile({middle.column + k % 3 - 1, middle.row + k / 3 - 1});
    static constexpr ObstacleBits none{};
    const auto join = [&](std::size_t tiles, int first, int last, std::size_t to) {
      const auto bits = [&](std::size_t k) -> const ObstacleBits& {
        return out.tiles[3 * tiles + k] == nullptr ? none : out.tiles[3 * tiles + k]->obstacles;
      };
      const ObstacleBits &left = bits(0), &own = bits(1), &right = bits(2);
      for (auto row = static_cast<std::size_t>(first); row < static_cast<std::size_t>(last); ++row)
        out.rows[to++] = std::uint64_t{left[row]} >> 16U | std::uint64_t{own[row]} << 16U |
                         std::uint64_t{right[row]} << 48U;
    };
    join(0, tile_side - reach_, tile_side, static_cast<std::size_t>(16 - reach_));
    join(1, 0, tile_side, 16);
    join(2, 0, reach_, 16 + tile_side);
  }
  /// Calls visit(column, x, y) for the points of the row `row` above the cell's in the columns from it whose
  /// bit 16 + column is set in `window`, seen from the cell's lower corner.
  template <class Visit>
  static void points_of_row(const Around& here, CellAddress cell, int row, std::uint64_t window,
                            const Visit& visit) {
    for (std::uint64_t left = here.obstacles_beside(cell, row) & window; left != 0; left &= left - 1) {
      const int column = std::countr_zero(left) - 16;
      const auto& c = here.read({cell.column + column, cell.row + row});
      visit(column, static_cast<float>(column) + c.point_x(), static_cast<float>(row) + c.point_y());
    }
  }
  /// The columns up to `reach` from a cell.
  [[nodiscard]] static std::uint64_t window_of(int reach) noexcept {
    return ((std::uint64_t{2} << static_cast<unsigned>(2 * reach)) - 1) << static_cast<unsigned>(16 - reach);
  }

  [[nodiscard]] NearestObstacle searched(CellAddress cell) {
    const Around& here = around(tile_of(cell));
    NearestObstacle best;
    CellAddress of_best{};
    float least = radius_ * radius_;
    const auto search_row = [&](int row, std::uint64_t window) {
      points_of_row(here, cell, row, window, [&](int column, float x, float y) {
        const float dx = x - 0.5F, dy = y - 0.5F, squared = dx * dx + dy * dy;
        const CellAddress at{cell.column + column, cell.row + row};
        const bool before = at.row < of_best.row || (at.row == of_best.row && at.column < of_best.column);
        if (squared > least || (squared == least && !(best.found && before))) return;
        least = squared;
        best = {dx, dy, 0, 0, true};
        of_best = at;
      });
    };
    // No point is nearer than half a cell less than its row and its column: the nearest cells come first, and
    // what they leave is a smaller square, and of its rows a shorter part the farther they are.
    int reach = static_cast<int>(std::ceil(radius_));
    const auto out_of_reach = [&](int column, int row) {
      return squared_of(static_cast<float>(column) - 0.5F) + squared_of(static_cast<float>(row) - 0.5F) >
             least;
    };
    const std::uint64_t beside = window_of(1);
    search_row(0, beside);
    while (reach > 0 && squared_of(static_cast<float>(reach) - 0.5F) > least) --reach;
    search_row(0, window_of(reach) & ~beside);
    for (int row = 1, column = reach; row <= reach; ++row) {
      while (column > 0 && out_of_reach(column, row)) --column;
      search_row(-row, window_of(column));
      search_row(row, window_of(column));
      while (reach > row && squared_of(static_cast<float>(reach) - 0.5F) > least) --reach;
    }
    if (!best.found) return best;
    auto& slot = normals_[place(of_best, slots / 4)];
    if (slot.key != key_of(of_best)) slot = {key_of(of_best), normal_at(of_best)};
    best.normal_x = slot.value.x;
    best.normal_y = slot.value.y;
    return best;
  }
  [[nodiscard]] static float squared_of(float x) noexcept { return x * x; }

  /// Across the line through an obstacle and its neighbours: the direction in which they spread least.
  [[nodiscard]] Normal normal_at(CellAddress cell) {
    const Around& here = around(tile_of(cell));
    const auto& middle = here.read(cell);
    float n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
    for (int row = -normal_reach; row <= normal_reach; ++row)
      points_of_row(here, cell, row, window_of(normal_reach), [&](int, float at_x, float at_y) {
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
  int reach_ = 0;  // cells beyond a tile that are looked at
  std::vector<Slot<NearestObstacle>> nearest_;
  std::vector<Slot<Normal>> normals_;
  std::vector<Around> around_;
  std::array<std::uint16_t, 256> known_{};  // by the tile's address: one more than its place in around_
  std::size_t here_ = 0;
};

}}  // namespace cairn::CAIRN_ABI
