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
#include <cstring>
#include <span>
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

/// A tile of such cells, and which of them are obstacles. Most cells never stop a beam, so that a cell is a
/// byte of visits, and only those that did stop one have hits and a mean point, in the order of the cells: a
/// quarter of the memory, and a scan is counted in eight cells at once.
class OccupancyTile {
public:
  ObstacleBits obstacles{};  ///< what the cells' is_obstacle() says; to be read only

  OccupancyTile() = default;
  /// Of these cells, row by row.
  explicit OccupancyTile(std::span<const OccupancyCell, tile_cells> cells) {
    for (std::size_t place = 0; place < tile_cells; ++place) {
      visits_[place] = cells[place].visits;
      if (cells[place].hits == 0) continue;
      Hits& hits = added(place);
      hits = {cells[place].hits, cells[place].mean_x, cells[place].mean_y};
      if (cells[place].is_obstacle()) obstacles[place / tile_side] |= bit(place);
    }
  }

  [[nodiscard]] OccupancyCell operator[](std::size_t place) const noexcept {
    if ((ever_hit_[place / tile_side] & bit(place)) == 0) return {.visits = visits_[place]};
    const Hits& hits = hits_[rank(place)];
    return {visits_[place], hits.count, hits.mean_x, hits.mean_y};
  }
  /// Counts a visit in the cells of a row whose bit is set in `passed`, and a hit where `stopped` has it too.
  /// O(1), and O(cells hit) where a cell is hit for the first time.
  void count(std::size_t row, std::uint32_t passed, std::uint32_t stopped) {
    for (std::size_t column = 0; column < tile_side; column += 8) {
      const std::uint64_t ones = spread(passed >> column & 255U);
      std::uint8_t* const eight = &visits_[row * tile_side + column];
      if (any_full(load_eight(eight), ones)) halve(row * tile_side + column, passed >> column & 255U);
      const std::uint64_t counted = load_eight(eight) + ones;
      std::memcpy(eight, &counted, sizeof counted);
    }
    for (std::uint32_t left = stopped & ~ever_hit_[row]; left != 0; left &= left - 1)
      added(first_of(row, left));
    // Bytes may be any object's to a compiler: what they leave as it is stands in variables of its own.
    const std::uint32_t ever_hit = ever_hit_[row];
    std::uint32_t left = passed & ever_hit, is_obstacle = obstacles[row];
    if (left == 0) return;
    Hits* const hits = hits_.data() + before_row_[row];
    for (; left != 0; left &= left - 1) {
      const std::uint32_t lowest = left & (~left + 1);
      Hits& of_cell = hits[ones_in(ever_hit & (lowest - 1))];
      if ((stopped & lowest) != 0) ++of_cell.count;
      const OccupancyCell cell{visits_[first_of(row, left)], of_cell.count};
      is_obstacle = cell.is_obstacle() ? is_obstacle | lowest : is_obstacle & ~lowest;
    }
    obstacles[row] = is_obstacle;
  }
  /// Moves the mean point of a cell that was hit towards a point, from the cell's lower corner [cells].
  void move_mean(std::size_t place, double x, double y) noexcept {
    CAIRN_ASSERT((ever_hit_[place / tile_side] & bit(place)) != 0, "move_mean needs a cell that was hit");
    Hits& hits = hits_[rank(place)];
    const auto moved = [&](std::uint16_t& mean, double fraction) {
      const double before = mean, target = 65535.0 * fraction;
      mean =
          static_cast<std::uint16_t>(std::lrint(before + (target - before) / std::max<int>(1, hits.count)));
    };
    moved(hits.mean_x, x);
    moved(hits.mean_y, y);
  }
  /// Bytes of what the tile holds: the same for equal tiles, whatever room they have left.
  [[nodiscard]] std::size_t bytes() const noexcept { return sizeof *this + hits_.size() * sizeof(Hits); }
  friend bool operator==(const OccupancyTile&, const OccupancyTile&) = default;

private:
  struct Hits {
    std::uint8_t count = 0;
    std::uint16_t mean_x = 0, mean_y = 0;
    friend bool operator==(const Hits&, const Hits&) = default;
  };

  [[nodiscard]] static std::uint32_t bit(std::size_t place) noexcept {
    return std::uint32_t{1} << (place % tile_side);
  }
  /// The cell of the lowest bit.
  [[nodiscard]] static std::size_t first_of(std::size_t row, std::uint32_t bits) noexcept {
    return row * tile_side + static_cast<std::size_t>(std::countr_zero(bits));
  }
  /// Where a cell that was hit has its hits: how many cells before it have some.
  [[nodiscard]] std::size_t rank(std::size_t place) const noexcept {
    return before_row_[place / tile_side] + ones_in(ever_hit_[place / tile_side] & (bit(place) - 1));
  }
  /// std::popcount is a call where the target has no instruction for it.
  [[nodiscard]] static std::size_t ones_in(std::uint32_t n) noexcept {
    n -= n >> 1U & 0x55555555U;
    n = (n & 0x33333333U) + (n >> 2U & 0x33333333U);
    return ((n + (n >> 4U)) & 0x0f0f0f0fU) * 0x01010101U >> 24U;
  }
  Hits& added(std::size_t place) {
    const auto at = hits_.insert(hits_.begin() + static_cast<std::ptrdiff_t>(rank(place)), Hits{});
    ever_hit_[place / tile_side] |= bit(place);
    for (std::size_t row = place / tile_side + 1; row < tile_side; ++row) ++before_row_[row];
    return *at;
  }
  /// Halves the counts of those of eight cells that have a bit and can count no further.
  void halve(std::size_t first, std::uint32_t passed) noexcept {
    for (std::size_t place = first; passed != 0; ++place, passed >>= 1U) {
      if ((passed & 1U) == 0 || visits_[place] != 255) continue;
      visits_[place] = 128;
      if ((ever_hit_[place / tile_side] & bit(place)) == 0) continue;
      Hits& hits = hits_[rank(place)];
      hits.count = static_cast<std::uint8_t>((hits.count + 1) / 2);
    }
  }

  [[nodiscard]] static std::uint64_t load_eight(const std::uint8_t* from) noexcept {
    std::uint64_t eight = 0;
    std::memcpy(&eight, from, sizeof eight);
    return eight;
  }
  /// A byte 1 for each of eight bits, the lowest first in memory.
  [[nodiscard]] static std::uint64_t spread(std::uint32_t bits) noexcept {
    constexpr std::uint64_t own =
        std::endian::native == std::endian::little ? 0x8040201008040201U : 0x0102040810204080U;
    constexpr std::uint64_t each = 0x0101010101010101U;
    return ((bits * each & own) + 0x7f * each) >> 7U & each;
  }
  /// Whether any byte of those that have a 1 is 255.
  [[nodiscard]] static bool any_full(std::uint64_t bytes, std::uint64_t ones) noexcept {
    const std::uint64_t left = ~(bytes & (255 * ones));  // 0 where it is
    return ((left - 0x0101010101010101U) & ~left & 0x8080808080808080U) != 0;
  }

  std::array<std::uint8_t, tile_cells> visits_{};
  ObstacleBits ever_hit_{};
  std::array<std::uint16_t, tile_side> before_row_{};  // hits_ of the rows above
  std::vector<Hits> hits_;
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

  /// The grid again whose cells() these are, with the same options: from a file.
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
    auto write = cells_.writer();
    marks.for_each_tile([&](TileAddress address, const ObstacleBits& passed, const ObstacleBits& stopped) {
      OccupancyTile& tile = write.tile(address);
      for (std::size_t row = 0; row < tile_side; ++row)
        if (passed[row] != 0) tile.count(row, passed[row], stopped[row]);
    });
    for (std::size_t i = 0, next = 0; i < ends.size(); i = next) {
      const Point mean = mean_of_run(ends, i, next);
      write.tile(tile_of(mean.cell))
          .move_mean(place_in_tile(mean.cell), mean.column - mean.cell.column, mean.row - mean.cell.row);
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
      Tile* const tiles = tiles_.data();  // not looked up again after every word that is written
      const TileAddress low = first_;
      const std::int32_t columns = columns_;
      const auto tile = [&](CellAddress cell) -> Tile& {
        const TileAddress at = tile_of(cell);
        return tiles[static_cast<std::size_t>((at.row - low.row) * columns + (at.column - low.column))];
      };
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

    /// visit(tile, passed, stopped) for every tile with a mark.
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
        visit(TileAddress{first_.column + t % columns_, first_.row + t / columns_}, marks.passed,
              marks.stopped);
      }
    }

  private:
    struct Tile {
      ObstacleBits passed{}, stopped{};
      ObstacleBits upright{};  // passed, a word a column and a bit a row
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
