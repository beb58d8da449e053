// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The best pose of a scan in a window, exactly: correlation by branch and bound.
///
/// A pose's score is the mean, over the scan's points, of what the cell that each falls into is worth. Poses
/// are those of a lattice: headings so close that the farthest point moves less than a cell, translations by
/// whole cells. A square of 2^h x 2^h translations is bounded by scores of which each is the largest of such
/// a square, so that most of the window is never looked at and yet nothing better is missed. (W. Hess, D.
/// Kohler, H. Rapp, D. Andor, "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016, sec. V; E. Olson,
/// "Real-time correlative scan matching", ICRA 2009.)
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/scan/scan.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What a point is worth in each cell of a rectangle, 0 to 255; 0 outside.
class ScoreGrid {
public:
  static constexpr int most = 1 << 14;  ///< columns, and rows

  /// `columns` x `rows` cells from `corner` on, all 0. Throws Error on bad sizes.
  ScoreGrid(const GridGeometry& geometry, CellAddress corner, int columns, int rows)
      : geometry_(geometry), corner_(corner), columns_(columns), rows_(rows) {
    if (columns < 1 || rows < 1 || columns > most || rows > most)
      raise("ScoreGrid: expected 1 to 16384 columns and rows, found " + std::to_string(columns) + " x " +
            std::to_string(rows));
    scores_.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  }

  [[nodiscard]] const GridGeometry& geometry() const noexcept { return geometry_; }
  [[nodiscard]] CellAddress corner() const noexcept { return corner_; }
  [[nodiscard]] int columns() const noexcept { return columns_; }
  [[nodiscard]] int rows() const noexcept { return rows_; }

  /// By column and row from the corner.
  [[nodiscard]] int at(int column, int row) const noexcept {
    if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return 0;
    return scores_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)];
  }
  [[nodiscard]] std::uint8_t& operator()(int column, int row) noexcept {
    CAIRN_ASSERT(column >= 0 && row >= 0 && column < columns_ && row < rows_, "a cell of the grid");
    return scores_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)];
  }

  /// Each cell the larger of itself and of those `shift` cells on, to either axis and to both: squares of
  /// `shift` cells become squares of twice as many. The result reaches `shift` cells further down and left.
  [[nodiscard]] ScoreGrid largest_of_two(int shift) const {
    ScoreGrid wide(geometry_, {corner_.column - shift, corner_.row - shift}, columns_ + shift, rows_ + shift);
    const auto columns = static_cast<std::size_t>(columns_), step = static_cast<std::size_t>(shift);
    std::vector<std::uint8_t> row(columns + step);
    for (int r = 0; r < rows_; ++r) {
      const std::uint8_t* from = scores_.data() + static_cast<std::size_t>(r) * columns;
      std::copy_n(from, columns, row.begin());
      std::fill_n(row.begin() + static_cast<std::ptrdiff_t>(columns), step, std::uint8_t{0});
      for (std::size_t c = 0; c < columns; ++c) row[c + step] = std::max(row[c + step], from[c]);
      for (const int to : {r, r + shift}) {
        std::uint8_t* target = wide.scores_.data() + static_cast<std::size_t>(to) * row.size();
        for (std::size_t c = 0; c < row.size(); ++c) target[c] = std::max(target[c], row[c]);
      }
    }
    return wide;
  }

private:
  GridGeometry geometry_;
  CellAddress corner_;
  int columns_, rows_;
  std::vector<std::uint8_t> scores_;
};

/// Poses to look at: up to these distances from the middle, to either side.
struct SearchWindow {
  double x = 1;        ///< [m], along the world's axes
  double y = 1;        ///< [m]
  double angle = 0.3;  ///< [rad], at most pi
};

/// From where on two poses are two places, by either.
struct PlacesApart {
  double distance = 1;  ///< [m]
  double angle = 0.5;   ///< [rad]
};

/// The best pose of the lattice and its score, the mean worth of the points over 255.
struct CorrelativeMatch {
  SE2 pose;
  double score = 0;
};

namespace detail {

/// The translations of one heading, and the tree of squares over them.
class TranslationSearch {
public:
  using Cells = std::vector<std::pair<int, int>>;  // of the points, from the grid's corner
  /// Translations that are not looked at: less than `radius` cells from (x, y).
  struct Disc {
    double x, y, radius;
  };

  TranslationSearch(const std::vector<ScoreGrid>& levels, const Cells& cells, int reach_x, int reach_y,
                    const std::vector<Disc>& taken)
      : levels_(levels), cells_(cells), reach_x_(reach_x), reach_y_(reach_y), taken_(taken) {}

  /// Raises `best` (a sum of scores) and writes its translation where one is better.
  bool run(long& best, std::pair<int, int>& where) {
    found_ = false;
    const int top = static_cast<int>(levels_.size()) - 1, side = 1 << top;
    for (int y = -reach_y_; y <= reach_y_; y += side)
      for (int x = -reach_x_; x <= reach_x_; x += side)
        descend(top, x, y, bound(top, x, y, best), best, where);
    return found_;
  }

private:
  /// No translation of a square has more. Where that is no more than `best`, some number that is not either:
  /// what is left of the points is not looked at once it cannot raise the sum so far.
  [[nodiscard]] long bound(int level, int x, int y, long best) const {
    const ScoreGrid& grid = levels_[static_cast<std::size_t>(level)];
    const int margin = (1 << level) - 1;
    constexpr long most = 255;
    long sum = most * static_cast<long>(cells_.size());
    for (const auto& [column, row] : cells_) {
      sum -= most - grid.at(column + x + margin, row + y + margin);
      if (sum <= best) break;
    }
    return sum;
  }

  void descend(int level, int x, int y, long upper, long& best, std::pair<int, int>& where) {
    if (upper <= best || is_taken(x, y, (1 << level) - 1)) return;
    if (level == 0) {
      best = upper;
      where = {x, y};
      found_ = true;
      return;
    }
    struct Child {
      int x, y;
      long upper;
    };
    // Most promising first; of equals the one met first. (Four are inserted by hand: gcc 12 warns of
    // reads past the end where std::sort is given so small an array.)
    std::array<Child, 4> children{};
    std::size_t count = 0;
    const int half = 1 << (level - 1);
    for (const int dy : {0, half})
      for (const int dx : {0, half}) {
        if (x + dx > reach_x_ || y + dy > reach_y_) continue;
        const Child child{x + dx, y + dy, bound(level - 1, x + dx, y + dy, best)};
        std::size_t place = count++;
        for (; place > 0 && children[place - 1].upper < child.upper; --place)
          children[place] = children[place - 1];
        children[place] = child;
      }
    for (std::size_t i = 0; i < count; ++i) {
      const Child& child = children[i];
      descend(level - 1, child.x, child.y, child.upper, best, where);
    }
  }

  /// Whether a disc holds all of the square from (x, y) on that is `more` cells wider than one.
  [[nodiscard]] bool is_taken(int x, int y, int more) const {
    for (const Disc& disc : taken_) {
      const double dx = std::max(std::abs(x - disc.x), std::abs(x + more - disc.x));
      const double dy = std::max(std::abs(y - disc.y), std::abs(y + more - disc.y));
      if (dx * dx + dy * dy < disc.radius * disc.radius) return true;
    }
    return false;
  }

  const std::vector<ScoreGrid>& levels_;
  const Cells& cells_;
  int reach_x_, reach_y_;
  const std::vector<Disc>& taken_;
  bool found_ = false;
};

}  // namespace detail

/// Searches windows of one grid: the pyramid of bounds is made once.
class CorrelativeSearch {
public:
  /// Squares of up to 2^(levels - 1) cells a side are bounded; 1 to 8 levels. Throws Error.
  explicit CorrelativeSearch(ScoreGrid grid, int levels = 6) {
    if (levels < 1 || levels > 8) raise("CorrelativeSearch: expected 1 to 8 levels");
    levels_.push_back(std::move(grid));
    for (int level = 1; level < levels; ++level)
      levels_.push_back(levels_.back().largest_of_two(1 << (level - 1)));
  }

  /// The pose of the lattice around `middle` with the largest score above `least`; nothing where none is, or
  /// there is no point. Throws Error on a window that is not finite, a middle too far from the grid's origin,
  /// or points as heading_step().
  [[nodiscard]] std::optional<CorrelativeMatch> find(std::span<const ScanPoint> points, const SE2& middle,
                                                     const SearchWindow& window, double least = 0) const {
    return find_beside({}, {}, points, middle, window, least);
  }

  /// Up to `count` places in the order of falling scores, each the best of the lattice that is `apart` or
  /// more from all before it, by so many metres or so many radians: look-alikes, if there are any. Throws as
  /// find().
  [[nodiscard]] std::vector<CorrelativeMatch> find_places(std::span<const ScanPoint> points,
                                                          const SE2& middle, const SearchWindow& window,
                                                          std::size_t count, const PlacesApart& apart,
                                                          double least = 0) const {
    std::vector<CorrelativeMatch> places;
    while (places.size() < count) {
      const auto next = find_beside(places, apart, points, middle, window, least);
      if (!next) break;
      places.push_back(*next);
    }
    return places;
  }

  /// Whether `found` is one of several places that look alike: whether another pose of the lattice, `apart`
  /// or more from it, has more than `share` of its score. As in a corridor all of whose doors are equal.
  /// Throws as find().
  [[nodiscard]] bool has_look_alike(const CorrelativeMatch& found, std::span<const ScanPoint> points,
                                    const SE2& middle, const SearchWindow& window, const PlacesApart& apart,
                                    double share) const {
    return find_beside({found}, apart, points, middle, window, share * found.score).has_value();
  }

  /// The score of one pose, in the cells that its points fall into.
  [[nodiscard]] double score(std::span<const ScanPoint> points, const SE2& pose) const {
    long sum = 0;
    for (const auto& [column, row] : cells_of(points, pose)) sum += levels_.front().at(column, row);
    return points.empty() ? 0 : static_cast<double>(sum) / (255.0 * static_cast<double>(points.size()));
  }

  /// Between neighbouring headings [rad]: the farthest point moves by less than a cell. Throws Error on
  /// points that are not finite, or 2^20 cells or more away.
  [[nodiscard]] double heading_step(std::span<const ScanPoint> points) const {
    const double cell = levels_.front().geometry().cell_size;
    double farthest = 3 * cell;
    for (const ScanPoint& p : points) {
      const double away = std::hypot(p.x, p.y);
      if (!(away < (1 << 20) * cell))
        raise("CorrelativeSearch: expected finite points less than 2^20 cells from the scanner");
      farthest = std::max(farthest, away);
    }
    return std::acos(1 - 0.5 * cell * cell / (farthest * farthest));
  }

private:
  [[nodiscard]] std::optional<CorrelativeMatch> find_beside(const std::vector<CorrelativeMatch>& taken,
                                                            const PlacesApart& apart,
                                                            std::span<const ScanPoint> points,
                                                            const SE2& middle, const SearchWindow& window,
                                                            double least) const {
    check(middle, window);
    const double step = heading_step(points);
    if (points.empty() || least >= 1) return std::nullopt;  // 1 is the largest score
    const GridGeometry& geometry = levels_.front().geometry();
    const int reach_x = static_cast<int>(window.x / geometry.cell_size);
    const int reach_y = static_cast<int>(window.y / geometry.cell_size);
    const int headings = static_cast<int>(window.angle / step);
    const double scale = 255.0 * static_cast<double>(points.size());
    long best = static_cast<long>(std::floor(std::max(0.0, least) * scale));
    std::optional<CorrelativeMatch> found;
    for (int k = 0; k <= 2 * headings; ++k) {  // 0, 1, -1, 2, -2, ...: the likely ones first
      const int heading = k % 2 == 1 ? (k + 1) / 2 : -k / 2;
      const SE2 turned(middle.x(), middle.y(), middle.angle() + heading * step);
      std::vector<detail::TranslationSearch::Disc> discs;
      for (const CorrelativeMatch& place : taken)
        if (std::abs(wrapped(place.pose.angle() - turned.angle())) < apart.angle)
          discs.push_back({(place.pose.x() - middle.x()) / geometry.cell_size,
                           (place.pose.y() - middle.y()) / geometry.cell_size,
                           apart.distance / geometry.cell_size});
      const auto cells = cells_of(points, turned);
      std::pair<int, int> where;
      if (!detail::TranslationSearch(levels_, cells, reach_x, reach_y, discs).run(best, where)) continue;
      found = {SE2(turned.x() + where.first * geometry.cell_size,
                   turned.y() + where.second * geometry.cell_size, turned.angle()),
               static_cast<double>(best) / scale};
    }
    return found;
  }

  void check(const SE2& middle, const SearchWindow& window) const {
    const GridGeometry& geometry = levels_.front().geometry();
    const double widest = 1000 * geometry.cell_size;
    if (!(window.x >= 0 && window.x <= widest && window.y >= 0 && window.y <= widest && window.angle >= 0 &&
          window.angle <= std::numbers::pi))
      raise("CorrelativeSearch: expected a window of up to 1000 cells and pi to either side");
    if (!geometry.contains(middle.x(), middle.y()) || !std::isfinite(middle.angle()))
      raise("CorrelativeSearch: expected a finite middle less than 2^28 cells from the grid's origin");
  }

  [[nodiscard]] detail::TranslationSearch::Cells cells_of(std::span<const ScanPoint> points,
                                                          const SE2& pose) const {
    const GridGeometry& geometry = levels_.front().geometry();
    const CellAddress corner = levels_.front().corner();
    const double c = std::cos(pose.angle()), s = std::sin(pose.angle());
    detail::TranslationSearch::Cells cells;
    cells.reserve(points.size());
    for (const ScanPoint& p : points) {
      const double x = pose.x() + c * p.x - s * p.y, y = pose.y() + s * p.x + c * p.y;
      if (!geometry.contains(x, y)) continue;
      const CellAddress cell = geometry.cell_of(x, y);
      cells.emplace_back(cell.column - corner.column, cell.row - corner.row);
    }
    return cells;
  }

  std::vector<ScoreGrid> levels_;
};

}}  // namespace cairn::CAIRN_ABI
