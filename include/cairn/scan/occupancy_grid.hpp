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
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
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
  /// Probability that the cell stops a beam, under Jeffreys' prior; 1/2 where nothing is known.
  [[nodiscard]] double occupancy() const noexcept { return (hits + 0.5) / (visits + 1.0); }
  friend bool operator==(const OccupancyCell&, const OccupancyCell&) = default;
};

/// Options of an occupancy map.
struct OccupancyOptions {
  GridGeometry geometry{};
  double field_radius = 5;  ///< how far from an obstacle the field reaches [cells], at most 6
};

/// Occupancy counts and the distance field of their obstacles.
class OccupancyGrid {
public:
  explicit OccupancyGrid(const OccupancyOptions& options = {})
      : geometry_(options.geometry), field_(options.field_radius) {
    if (!(geometry_.cell_size > 0) || !std::isfinite(geometry_.cell_size) ||
        !std::isfinite(geometry_.origin_x) || !std::isfinite(geometry_.origin_y))
      raise("OccupancyGrid: expected a cell size above zero and a finite origin");
  }

  /// The grid again whose cells() and field().tiles() these are, with the same options: from a file.
  OccupancyGrid(const OccupancyOptions& options, SharedTiles<OccupancyCell> cells,
                SharedTiles<NearestObstacle> field)
      : OccupancyGrid(options) {
    cells_ = std::move(cells);
    field_ = DistanceField(options.field_radius, std::move(field));
    cells_.for_each_tile([&](TileAddress, const auto&) { empty_ = false; });
  }

  [[nodiscard]] const GridGeometry& geometry() const noexcept { return geometry_; }
  [[nodiscard]] const SharedTiles<OccupancyCell>& cells() const noexcept { return cells_; }
  [[nodiscard]] const DistanceField& field() const noexcept { return field_; }
  [[nodiscard]] bool empty() const noexcept { return empty_; }

  /// Takes in the end points of a scan made at `pose`: a hit in each cell with a point, free what lies
  /// between the scanner and the points. Throws Error where the map would become too wide, or where one scan
  /// spans more than 2^28 cells.
  void insert(const SE2& pose, const std::vector<ScanPoint>& points) {
    std::vector<CellAddress> changed;
    take_in(pose, points, changed);
    rebuild_around(changed);
  }

  /// Scans in their order, as insert() one by one, with the field built once at the end. `pose(i)` and
  /// `points(i)` give scan i.
  template <class Pose, class Points>
  void insert_all(std::size_t count, const Pose& pose, const Points& points) {
    std::vector<CellAddress> changed;
    for (std::size_t i = 0; i < count; ++i) {
      take_in(pose(i), points(i), changed);
      if (changed.size() < 100000) continue;
      std::ranges::sort(changed);
      changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
    }
    std::ranges::sort(changed);
    changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
    rebuild_around(changed);
  }

private:
  struct Point {
    double column, row;  // in cells
    CellAddress cell;
  };

  void take_in(const SE2& pose, const std::vector<ScanPoint>& points, std::vector<CellAddress>& changed) {
    const std::vector<Point> ends = placed(pose, points);
    if (ends.empty()) return;
    Marks marks(at(pose.x(), pose.y()), ends);
    for (const Point& end : ends) marks.ray(end);
    for (const Point& end : ends) marks.hit(end);
    marks.for_each_tile([&](TileAddress tile, const auto& visit_cells) {
      auto& out = cells_.writable_tile(tile);
      visit_cells([&](CellAddress cell, std::uint8_t mark) {
        if (count(out[place_in_tile(cell)], mark == Marks::stopped)) changed.push_back(cell);
      });
    });
    for (std::size_t i = 0, next = 0; i < ends.size(); i = next) {
      const Point mean = mean_of_run(ends, i, next);
      if (move_mean(mean)) changed.push_back(mean.cell);
    }
    empty_ = false;
  }

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

  /// What one scan says of the cells in its bounding box, once each.
  class Marks {
  public:
    static constexpr std::uint8_t passed = 1, stopped = 2;

    Marks(const Point& start, const std::vector<Point>& ends) : start_(start) {
      CellAddress low = start.cell, high = start.cell;
      for (const Point& end : ends) {
        low = {std::min(low.column, end.cell.column), std::min(low.row, end.cell.row)};
        high = {std::max(high.column, end.cell.column), std::max(high.row, end.cell.row)};
      }
      first_ = tile_of(low);
      columns_ = tile_of(high).column - first_.column + 1;
      rows_ = tile_of(high).row - first_.row + 1;
      constexpr std::int64_t most = 1 << 18;  // 16384 cells in square, 268 MB
      if (std::int64_t{columns_} * rows_ > most)
        raise("OccupancyGrid: expected a scan over at most 2^28 cells: farther beams, or larger cells?");
      marks_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) * tile_cells);
    }

    void ray(const Point& end) {
      walk_ray(start_.column, start_.row, end.column, end.row,
               [&](CellAddress cell, double) { marks_[place(cell)] |= passed; });
    }
    void hit(const Point& end) { marks_[place(end.cell)] = stopped; }

    /// visit(tile, cells) with cells(f) calling f(cell, mark), for every tile with a mark.
    template <class Visit>
    void for_each_tile(const Visit& visit) const {
      for (std::int32_t t = 0; t < columns_ * rows_; ++t) {
        const TileAddress tile{first_.column + t % columns_, first_.row + t / columns_};
        const std::uint8_t* marks = marks_.data() + static_cast<std::size_t>(t) * tile_cells;
        if (std::all_of(marks, marks + tile_cells, [](std::uint8_t m) { return m == 0; })) continue;
        const CellAddress corner = corner_of(tile);
        visit(tile, [&](const auto& f) {
          for (int i = 0; i < tile_cells; i += 8) {
            std::uint64_t eight = 0;
            std::memcpy(&eight, marks + i, 8);
            if (eight == 0) continue;
            for (int k = i; k < i + 8; ++k)
              if (marks[k] != 0)
                f(CellAddress{corner.column + k % tile_side, corner.row + k / tile_side}, marks[k]);
          }
        });
      }
    }

  private:
    [[nodiscard]] std::size_t place(CellAddress cell) const noexcept {
      const TileAddress tile = tile_of(cell);
      const auto number = (tile.row - first_.row) * columns_ + (tile.column - first_.column);
      return static_cast<std::size_t>(number) * tile_cells + place_in_tile(cell);
    }

    Point start_;
    TileAddress first_{};
    std::int32_t columns_ = 0, rows_ = 0;
    std::vector<std::uint8_t> marks_;
  };

  /// Counts a scan in a cell; true where the cell has become an obstacle, or is none any more.
  static bool count(OccupancyCell& cell, bool stopped) noexcept {
    const bool before = cell.is_obstacle();
    if (cell.visits == 255) {
      cell.visits = 128;
      cell.hits = static_cast<std::uint8_t>((cell.hits + 1) / 2);
    }
    ++cell.visits;
    if (stopped) ++cell.hits;
    return before != cell.is_obstacle();
  }

  /// Moves the mean hit point of the end's cell towards it; true where the field would show it elsewhere.
  bool move_mean(const Point& end) {
    OccupancyCell& cell = cells_.write(end.cell);
    const auto moved = [&](std::uint16_t& mean, double fraction) {
      const double before = mean, target = 65535.0 * fraction;
      mean = static_cast<std::uint16_t>(std::lrint(before + (target - before) / std::max<int>(1, cell.hits)));
      return shown(mean) != shown(static_cast<std::uint16_t>(before));
    };
    const bool x = moved(cell.mean_x, end.column - end.cell.column);
    const bool y = moved(cell.mean_y, end.row - end.cell.row);
    return (x || y) && cell.is_obstacle();
  }
  /// The mean as the field rounds it.
  [[nodiscard]] static int shown(std::uint16_t mean) noexcept {
    return (static_cast<int>(mean) * NearestObstacle::steps + 32768) >> 16;
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

  /// Rebuilds the field of the cells that the changed ones reach, as obstacles or through the normals.
  void rebuild_around(const std::vector<CellAddress>& changed) {
    const int reach = field_.apron() + normal_reach;
    std::vector<std::pair<TileAddress, TilePart>> parts;
    for (const CellAddress& cell : changed) {
      const TileAddress low = tile_of({cell.column - reach, cell.row - reach});
      const TileAddress high = tile_of({cell.column + reach, cell.row + reach});
      for (std::int32_t row = low.row; row <= high.row; ++row)
        for (std::int32_t column = low.column; column <= high.column; ++column) {
          const CellAddress corner = corner_of({column, row});
          const int x = cell.column - corner.column, y = cell.row - corner.row;
          parts.push_back({{column, row},
                           {std::max(0, x - reach), std::max(0, y - reach),
                            std::min(tile_side, x + reach + 1), std::min(tile_side, y + reach + 1)}});
        }
    }
    std::ranges::sort(parts, {}, &std::pair<TileAddress, TilePart>::first);
    for (std::size_t i = 0; i < parts.size();) {
      auto [tile, part] = parts[i];
      for (; i < parts.size() && parts[i].first == tile; ++i) {
        const TilePart& other = parts[i].second;
        part = {std::min(part.left, other.left), std::min(part.bottom, other.bottom),
                std::max(part.right, other.right), std::max(part.top, other.top)};
      }
      field_.rebuild(tile, part, obstacles_around(tile, part));
    }
  }

  static constexpr int normal_reach = 2;  // cells to either side whose points make a line
  static constexpr int widest =
      tile_side + 2 * (static_cast<int>(DistanceField::largest_radius) + normal_reach);

  /// The hit points in and around a part of a tile, in cells from the tile's corner; x is `nothing` where
  /// there is none.
  struct Window {
    static constexpr float nothing = -1e9F;
    int columns = 0, rows = 0;
    std::array<float, static_cast<std::size_t>(widest* widest)> x, y;
    [[nodiscard]] std::size_t place(int column, int row) const noexcept {
      return static_cast<std::size_t>(row * columns + column);
    }
  };

  void fill(Window& window, TileAddress tile, const TilePart& part, int margin) const {
    window.columns = part.right - part.left + 2 * margin;
    window.rows = part.top - part.bottom + 2 * margin;
    const CellAddress corner = corner_of(tile);
    std::size_t place = 0;
    for (int row = part.bottom - margin; row < part.top + margin; ++row)
      for (int column = part.left - margin; column < part.right + margin;) {
        const CellAddress cell{corner.column + column, corner.row + row};
        const auto* cells = cells_.tile(tile_of(cell));
        const int run = std::min(part.right + margin - column, tile_side - (cell.column & 31));
        const OccupancyCell* c = cells == nullptr ? nullptr : cells->data() + place_in_tile(cell);
        for (int k = 0; k < run; ++k, ++column, ++place) {
          window.x[place] = Window::nothing;
          if (c == nullptr || !c[k].is_obstacle()) continue;
          window.x[place] = static_cast<float>(column) + static_cast<float>(c[k].mean_x) / 65536.0F;
          window.y[place] = static_cast<float>(row) + static_cast<float>(c[k].mean_y) / 65536.0F;
        }
      }
  }

  /// The point at a place of the window with the normal of the line through it and its neighbours.
  [[nodiscard]] static Obstacle obstacle_at(const Window& window, int column, int row) noexcept {
    const std::size_t center = window.place(column, row);
    Obstacle o{window.x[center], window.y[center], 0, 0};
    float n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
    for (int r = row - normal_reach; r <= row + normal_reach; ++r)
      for (int c = column - normal_reach; c <= column + normal_reach; ++c) {
        const std::size_t place = window.place(c, r);
        if (window.x[place] == Window::nothing) continue;
        const float x = window.x[place] - o.x, y = window.y[place] - o.y;
        n += 1;
        sx += x;
        sy += y;
        sxx += x * x;
        sxy += x * y;
        syy += y * y;
      }
    if (n < 3) return o;
    const float xx = sxx - sx * sx / n, xy = sxy - sx * sy / n, yy = syy - sy * sy / n;
    const float half = 0.5F * (xx + yy);
    const float root = std::sqrt(std::max(0.0F, 0.25F * (xx - yy) * (xx - yy) + xy * xy));
    constexpr float thin = 0.1F;  // variance across a line over that along it
    if (!(half - root < thin * (half + root))) return o;
    const float angle = 0.5F * std::atan2(2 * xy, xx - yy);  // of the line
    o.normal_x = -std::sin(angle);
    o.normal_y = std::cos(angle);
    return o;
  }

  [[nodiscard]] std::vector<Obstacle> obstacles_around(TileAddress tile, const TilePart& part) const {
    Window window;
    fill(window, tile, part, field_.apron() + normal_reach);
    std::vector<Obstacle> obstacles;
    for (int row = normal_reach; row < window.rows - normal_reach; ++row)
      for (int column = normal_reach; column < window.columns - normal_reach; ++column)
        if (window.x[window.place(column, row)] != Window::nothing)
          obstacles.push_back(obstacle_at(window, column, row));
    return obstacles;
  }

  GridGeometry geometry_;
  SharedTiles<OccupancyCell> cells_;
  DistanceField field_;
  bool empty_ = true;
};

}}  // namespace cairn::CAIRN_ABI
