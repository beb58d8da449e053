// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// An occupancy grid that keeps, beside how often a cell stopped a beam, where in the cell it did.
///
/// A cell holds visits v, hits h and the mean of the hit points; it is occupied with (h + 1/2) / (v + 1) and
/// an obstacle where h / v > 1/4. A scan counts once in a cell: several of its beams through one cell say the
/// same, and a beam that grazes a wall is no witness against the beams that end in it. (S. Thrun,
/// W. Burgard, D. Fox, "Probabilistic Robotics", 2005, ch. 9.2, as counts; the mean hit point: G. Grisetti,
/// C. Stachniss, W. Burgard, T-RO 23, 2007, sec. V.) Copies share tiles.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/grid/distance_field.hpp>
#include <cairn/grid/ray.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/scan/scan.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Counts of one cell. Both are halved when the visits reach 255, so that a cell can change its mind.
struct OccupancyCell {
  std::uint8_t visits = 0;
  std::uint8_t hits = 0;
  std::uint16_t mean_x = 0;  ///< of the hit points, in 1/65536 of the cell from its lower corner
  std::uint16_t mean_y = 0;

  [[nodiscard]] bool known() const noexcept { return visits > 0; }
  [[nodiscard]] bool is_obstacle() const noexcept { return 4 * hits > visits; }
  /// The mean hit point, from the cell's lower corner [cells].
  [[nodiscard]] float point_x() const noexcept { return static_cast<float>(mean_x) * (1.0F / 65536); }
  [[nodiscard]] float point_y() const noexcept { return static_cast<float>(mean_y) * (1.0F / 65536); }
  /// Probability that the cell stops a beam, under Jeffreys' prior; 1/2 where nothing is known.
  [[nodiscard]] double occupancy() const noexcept { return (hits + 0.5) / (visits + 1.0); }
  friend bool operator==(const OccupancyCell&, const OccupancyCell&) = default;
};

/// A tile of such cells, and which of them are obstacles.
struct OccupancyTile {
  std::array<OccupancyCell, tile_cells> cells{};
  ObstacleBits obstacles{};

  [[nodiscard]] OccupancyCell& operator[](std::size_t place) noexcept { return cells[place]; }
  [[nodiscard]] const OccupancyCell& operator[](std::size_t place) const noexcept { return cells[place]; }
  [[nodiscard]] auto begin() const noexcept { return cells.begin(); }
  [[nodiscard]] auto end() const noexcept { return cells.end(); }

  /// Makes the bit of a cell what the cell is.
  void mark(std::size_t place) noexcept {
    const std::uint32_t bit = std::uint32_t{1} << (place % tile_side);
    std::uint32_t& row = obstacles[place / tile_side];
    row = cells[place].is_obstacle() ? row | bit : row & ~bit;
  }
  friend bool operator==(const OccupancyTile&, const OccupancyTile&) = default;
};
template <>
struct TileOf<OccupancyCell> {
  using type = OccupancyTile;
};

/// Options of an occupancy map.
struct OccupancyOptions {
  GridGeometry geometry{};
  double field_radius = 5;  ///< how far from an obstacle the field reaches [cells], at most 16
};

/// Occupancy counts, and the distance field of their obstacles.
class OccupancyGrid {
public:
  using Field = DistanceField<OccupancyCell>;

  explicit OccupancyGrid(const OccupancyOptions& options = {})
      : geometry_(options.geometry), field_radius_(options.field_radius) {
    if (!(geometry_.cell_size > 0) || !std::isfinite(geometry_.cell_size) ||
        !std::isfinite(geometry_.origin_x) || !std::isfinite(geometry_.origin_y))
      raise("OccupancyGrid: expected a cell size above zero and a finite origin");
    Field::expect_radius(field_radius_);
  }

  /// The grid again whose cells() these are, every one marked, with the same options: from a file.
  OccupancyGrid(const OccupancyOptions& options, SharedTiles<OccupancyCell> cells) : OccupancyGrid(options) {
    cells_ = std::move(cells);
    cells_.for_each_tile([&](TileAddress, const auto&) { empty_ = false; });
  }

  [[nodiscard]] const GridGeometry& geometry() const noexcept { return geometry_; }
  [[nodiscard]] const SharedTiles<OccupancyCell>& cells() const noexcept { return cells_; }
  [[nodiscard]] bool empty() const noexcept { return empty_; }
  /// Ways to the nearest obstacles, until the grid is changed.
  [[nodiscard]] Field field() const { return {cells_, field_radius_}; }

  /// Takes in the end points of a scan made at `pose`: a hit in each cell with a point, free what lies
  /// between the scanner and the points. O(cells that the beams pass). Throws Error where the map would
  /// become too wide, and is as it was.
  void insert(const SE2& pose, const std::vector<ScanPoint>& points) {
    thread_local Marks marks;  // whose memory serves scan after scan
    const std::vector<Point> ends = placed(pose, points);
    if (ends.empty()) return;
    marks.begin(at(pose.x(), pose.y()), ends);
    for (const Point& end : ends) marks.ray(end);
    for (const Point& end : ends) marks.hit(end);
    marks.expect_room(cells_);
    marks.for_each_tile([&](TileAddress tile, const auto& visit_cells) {
      auto& out = cells_.writable_tile(tile);
      visit_cells([&](std::size_t place, bool stopped) {
        count(out[place], stopped);
        if (out[place].hits > 0) out.mark(place);
      });
    });
    auto write = cells_.writer();
    for (std::size_t i = 0, next = 0; i < ends.size(); i = next) {
      const Point mean = mean_of_run(ends, i, next);
      move_mean(write(mean.cell), mean);
    }
    empty_ = false;
  }

private:
  struct Point {
    double column, row;  // in cells
    CellAddress cell;
  };

  [[nodiscard]] Point at(double x, double y) const {
    if (!geometry_.contains(x, y))
      raise("OccupancyGrid: expected points less than 2^28 cells from the origin");
    return {geometry_.column_of(x), geometry_.row_of(y), geometry_.cell_of(x, y)};
  }

  [[nodiscard]] std::vector<Point> placed(const SE2& pose, const std::vector<ScanPoint>& points) const {
    const double c = std::cos(pose.angle()), s = std::sin(pose.angle());
    std::vector<Point> out;
    out.reserve(points.size());
    for (const ScanPoint& p : points)
      out.push_back(at(pose.x() + c * p.x - s * p.y, pose.y() + s * p.x + c * p.y));
    return out;
  }

  /// What one scan says of the cells in its bounding box, once each: a bit for passed, one for stopped.
  class Marks {
  public:
    void begin(const Point& start, const std::vector<Point>& ends) {
      start_ = start;
      CellAddress low = start.cell, high = start.cell;
      for (const Point& end : ends) {
        low = {std::min(low.column, end.cell.column), std::min(low.row, end.cell.row)};
        high = {std::max(high.column, end.cell.column), std::max(high.row, end.cell.row)};
      }
      first_ = tile_of(low);
      columns_ = tile_of(high).column - first_.column + 1;
      rows_ = tile_of(high).row - first_.row + 1;
      constexpr std::int64_t most = 1 << 20;
      if (std::int64_t{columns_} * rows_ > most)
        raise("OccupancyGrid: expected a scan within 2^20 tiles, found one of " + std::to_string(columns_) +
              " x " + std::to_string(rows_));
      tiles_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), Tile{});
    }

    void ray(const Point& end) {
      if (std::abs(end.column - start_.column) >= std::abs(end.row - start_.row))
        walk_rows(start_.column, start_.row, end.column, end.row,
                  [&](std::int32_t row, std::int32_t first, std::int32_t last) {
                    for_each_word(first, last, [&](std::int32_t column, std::uint32_t bits) {
                      tile({column, row}).passed[static_cast<std::size_t>(row & 31)] |= bits;
                    });
                  });
      else
        walk_columns(start_.column, start_.row, end.column, end.row,
                     [&](std::int32_t column, std::int32_t first, std::int32_t last) {
                       for_each_word(first, last, [&](std::int32_t row, std::uint32_t bits) {
                         tile({column, row}).upright[static_cast<std::size_t>(column & 31)] |= bits;
                       });
                     });
    }
    void hit(const Point& end) {
      tile(end.cell).passed[static_cast<std::size_t>(end.cell.row & 31)] |= bit(end.cell);
      tile(end.cell).stopped[static_cast<std::size_t>(end.cell.row & 31)] |= bit(end.cell);
    }

    /// Throws Error where they do not fit into `cells`.
    void expect_room(const SharedTiles<OccupancyCell>& cells) const {
      cells.expect_room(first_, {first_.column + columns_ - 1, first_.row + rows_ - 1});
    }

    /// visit(tile, cells) with cells(f) calling f(place in the tile, whether stopped), for every tile with a
    /// mark.
    template <class Visit>
    void for_each_tile(const Visit& visit) {
      for (std::int32_t t = 0; t < columns_ * rows_; ++t) {
        Tile& marks = tiles_[static_cast<std::size_t>(t)];
        std::uint32_t any = 0, upright = 0;
        for (const std::uint32_t column : marks.upright) upright |= column;
        if (upright != 0) {
          turn(marks.upright);
          for (std::size_t row = 0; row < tile_side; ++row) marks.passed[row] |= marks.upright[row];
        }
        for (const std::uint32_t row : marks.passed) any |= row;
        if (any == 0) continue;
        visit(TileAddress{first_.column + t % columns_, first_.row + t / columns_}, [&](const auto& f) {
          for (std::size_t row = 0; row < tile_side; ++row) {
            const std::uint32_t stopped = marks.stopped[row];
            for (std::uint32_t left = marks.passed[row]; left != 0; left &= left - 1) {
              const auto column = static_cast<std::uint32_t>(std::countr_zero(left));
              f(row * tile_side + column, (stopped >> column & 1U) != 0);
            }
          }
        });
      }
    }

  private:
    struct Tile {
      std::array<std::uint32_t, tile_side> passed{}, stopped{};  // a bit a column
      std::array<std::uint32_t, tile_side> upright{};            // passed, a word a column and a bit a row
    };
    /// Calls visit(cell, bits) for the words of 32 cells that hold a run.
    template <class Visit>
    static void for_each_word(std::int32_t first, std::int32_t last, const Visit& visit) {
      while ((first ^ last) >> 5 != 0) {
        visit(first, ~std::uint32_t{0} << static_cast<std::uint32_t>(first & 31));
        first = (first | 31) + 1;
      }
      visit(first, (~std::uint32_t{0} << static_cast<std::uint32_t>(first & 31)) &
                       (~std::uint32_t{0} >> static_cast<std::uint32_t>(31 - (last & 31))));
    }
    /// Rows become columns: squares of 16, 8, ... 1 bits beside the diagonal change places.
    static void turn(std::array<std::uint32_t, tile_side>& words) noexcept {
      std::uint32_t mask = 0x0000ffffU;
      for (std::uint32_t side = 16; side != 0; side >>= 1U, mask ^= mask << side)
        for (std::uint32_t k = 0; k < tile_side; k = (k + side + 1) & ~side) {
          const std::uint32_t changed = ((words[k] >> side) ^ words[k + side]) & mask;
          words[k] ^= changed << side;
          words[k + side] ^= changed;
        }
    }
    [[nodiscard]] static std::uint32_t bit(CellAddress cell) noexcept {
      return std::uint32_t{1} << static_cast<std::uint32_t>(cell.column & 31);
    }
    [[nodiscard]] Tile& tile(CellAddress cell) noexcept {
      const TileAddress at = tile_of(cell);
      return tiles_[static_cast<std::size_t>((at.row - first_.row) * columns_ + (at.column - first_.column))];
    }

    Point start_{};
    TileAddress first_{};
    std::int32_t columns_ = 0, rows_ = 0;
    std::vector<Tile> tiles_;
  };

  static void count(OccupancyCell& cell, bool stopped) noexcept {
    if (cell.visits == 255) {
      cell.visits = 128;
      cell.hits = static_cast<std::uint8_t>((cell.hits + 1) / 2);
    }
    ++cell.visits;
    if (stopped) ++cell.hits;
  }

  /// Moves the mean hit point of the end's cell towards it.
  static void move_mean(OccupancyCell& cell, const Point& end) noexcept {
    const auto moved = [&](std::uint16_t& mean, double fraction) {
      const double before = mean, target = 65535.0 * fraction;
      mean = static_cast<std::uint16_t>(std::lrint(before + (target - before) / std::max<int>(1, cell.hits)));
    };
    moved(cell.mean_x, end.column - end.cell.column);
    moved(cell.mean_y, end.row - end.cell.row);
  }

  /// The mean of the points from `first` on that lie in the same cell; `next` is the first beyond.
  [[nodiscard]] static Point mean_of_run(const std::vector<Point>& points, std::size_t first,
                                         std::size_t& next) noexcept {
    Point mean{0, 0, points[first].cell};
    for (next = first; next < points.size() && points[next].cell == mean.cell; ++next) {
      mean.column += points[next].column;
      mean.row += points[next].row;
    }
    mean.column /= static_cast<double>(next - first);
    mean.row /= static_cast<double>(next - first);
    return mean;
  }

  GridGeometry geometry_;
  SharedTiles<OccupancyCell> cells_;
  double field_radius_;
  bool empty_ = true;
};

}}  // namespace cairn::CAIRN_ABI
