// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How many beams a metre of each cell stops, and how likely a reading is along a whole beam: DP-SLAM's map.
///
/// A cell holds the beams h that stopped in it and the length L that beams travelled in it. It stops
///   rho = (h + w rho0) / (L + w)    beams a metre,
/// the mean of a Gamma posterior. A beam that meets cells i with chords d_i stops in cell i with
/// probability reach_i p_i, p_i = 1 - exp(-rho_i d_i), reach_i the product of 1 - p_k before it; what is left
/// at the end of its range is no return. So glass, hedges and poles thinner than a cell have a place in the
/// map. (A. Eliazar, R. Parr, "DP-SLAM 2.0", ICRA 2004, sec. III; their code leaves the prior's stops out, so
/// that a cell seen empty once can never stop a beam.)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/grid/ray.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/scan/scan.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

struct StopCell {
  float stops = 0;
  float length = 0;  ///< [m]

  friend bool operator==(const StopCell&, const StopCell&) = default;
};

struct StopOptions {
  GridGeometry geometry{};
  double prior_stops_per_metre = 0.125;
  double prior_cells = 4;      ///< length that the prior is worth, in cells
  double sigma = 0.05;         ///< of a range [m]
  double outliers = 0.05;      ///< share of readings that say nothing: half anywhere, half no return
  double independence = 0.15;  ///< share of the beams' evidence that counts
  std::size_t every = 1;       ///< of the beams is asked how likely it is; all are taken in

  [[nodiscard]] bool valid() const noexcept {
    const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
    return positive(geometry.cell_size) && std::isfinite(geometry.origin_x) &&
           std::isfinite(geometry.origin_y) && positive(prior_stops_per_metre) && positive(prior_cells) &&
           positive(sigma) && outliers > 0 && outliers < 1 && independence > 0 && independence <= 1 &&
           every > 0;
  }
};

/// Over SharedTiles<StopCell> or Ancestry<StopCell>: the same numbers, bit for bit.
template <class Storage = SharedTiles<StopCell>>
class StopGrid {
public:
  /// Throws Error where an option is out of its range.
  explicit StopGrid(const StopOptions& options = {}) : options_(options) {
    if (!options.valid()) raise("StopGrid: expected options within their ranges");
  }

  [[nodiscard]] const StopOptions& options() const noexcept { return options_; }
  [[nodiscard]] const Storage& cells() const noexcept { return cells_; }

  /// Beams that a metre in the cell stops [1/m].
  [[nodiscard]] double stops_per_metre(const StopCell& cell) const noexcept {
    const double weight = options_.prior_cells * options_.geometry.cell_size;
    return (static_cast<double>(cell.stops) + weight * options_.prior_stops_per_metre) /
           (static_cast<double>(cell.length) + weight);
  }

  /// Calls visit(distance, probability) for the cells along a beam, `distance` [m] being the middle of the
  /// chord, and returns the probability that the beam is not stopped until `end`. Throws Error where the beam
  /// leaves the plane of cells.
  template <class Visit>
  double along_beam(double x, double y, double angle, double end, Visit&& visit) const {
    double reach = 1;
    walk(x, y, angle, end, [&](CellAddress cell, double from, double chord) {
      const double stopped = -reach * std::expm1(-stops_per_metre(cells_.read(cell)) * chord);
      visit(from + 0.5 * chord, stopped);
      reach -= stopped;
    });
    return reach;
  }

  /// What log_likelihood() asks of the grid at many poses near each other: what was read once is kept. Lives
  /// no longer than the grid, and only until it or one that it shares a tree with is changed.
  class Prepared {
  public:
    explicit Prepared(const StopGrid& grid) : grid_(&grid), read_(grid.cells_.reader()) {}

    /// As StopGrid's.
    [[nodiscard]] double log_likelihood(const LaserScan& scan, const SE2& pose) {
      const StopOptions& options = grid_->options_;
      double sum = 0;
      for (std::size_t i = 0; i < scan.size(); i += options.every) {
        const BeamKind kind = scan.kind(i);
        if (kind == BeamKind::invalid) continue;
        const double angle = pose.angle() + scan.angle(i), half = 0.5 * options.outliers;
        sum += kind == BeamKind::no_return
                   ? std::log((1 - options.outliers) * reach(pose, angle, scan.farthest) + half)
                   : std::log((1 - options.outliers) * density(pose, angle, scan.range[i]) +
                              half / scan.farthest);
      }
      return options.independence * sum;
    }

  private:
    /// The probability that a beam comes to `end`.
    [[nodiscard]] double reach(const SE2& from, double angle, double end) {
      double stops = 0;  // expected, so far: only their sum counts, and one exponential serves all cells
      grid_->walk(from.x(), from.y(), angle, end, [&](CellAddress cell, double, double chord) {
        stops += grid_->stops_per_metre(read_(cell)) * chord;
      });
      return std::exp(-stops);
    }
    /// The density [1/m] of a reading `range` of a beam that nothing disturbs.
    [[nodiscard]] double density(const SE2& from, double angle, double range) {
      const double sigma = grid_->options_.sigma;
      const double norm = 1 / (sigma * std::sqrt(2 * std::numbers::pi));
      double stops = 0, sum = 0;
      grid_->walk(from.x(), from.y(), angle, range + 3 * sigma,
                  [&](CellAddress cell, double before, double chord) {
                    const double here = grid_->stops_per_metre(read_(cell)) * chord;
                    if (const double z = (range - (before + 0.5 * chord)) / sigma; std::abs(z) < 4)
                      sum -= std::exp(-stops - 0.5 * z * z) * std::expm1(-here);
                    stops += here;
                  });
      return norm * sum;
    }

    const StopGrid* grid_;
    typename Storage::Reader read_;
  };
  [[nodiscard]] Prepared prepared() const { return Prepared(*this); }

  /// log density [1/m] of the scan's ranges, or probability where nothing came back, times the independence.
  [[nodiscard]] double log_likelihood(const LaserScan& scan, const SE2& pose) const {
    return prepared().log_likelihood(scan, pose);
  }

  /// Takes a scan in: a stop in each hit's cell, and the lengths of all beams. Throws Error where a beam ends
  /// too far away or the map would become too wide, and is as it was.
  void insert(const LaserScan& scan, const SE2& pose) {
    [[maybe_unused]] const auto guard = guarded();
    expect_room(scan, pose);
    auto write = cells_.writer();
    for (std::size_t i = 0; i < scan.size(); ++i) {
      const BeamKind kind = scan.kind(i);
      if (kind == BeamKind::invalid) continue;
      CellAddress last;
      walk(pose.x(), pose.y(), pose.angle() + scan.angle(i), length_of(scan, i),
           [&](CellAddress cell, double, double chord) {
             write(cell).length += static_cast<float>(chord);
             last = cell;
           });
      if (kind == BeamKind::hit) write(last).stops += 1;
    }
  }

private:
  struct Place {
    double x, y;
  };
  /// Where a beam that starts at (x, y) ends.
  [[nodiscard]] Place end_of(double x, double y, double angle, double end) const {
    const Place to{x + end * std::cos(angle), y + end * std::sin(angle)};
    if (!options_.geometry.contains(x, y) || !options_.geometry.contains(to.x, to.y))
      raise("StopGrid: expected beams less than 2^28 cells from the origin");
    return to;
  }
  /// How far the beam went that a scan's reading says something of.
  [[nodiscard]] static double length_of(const LaserScan& scan, std::size_t i) {
    return scan.kind(i) == BeamKind::hit ? static_cast<double>(scan.range[i]) : scan.farthest;
  }
  void expect_room(const LaserScan& scan, const SE2& pose) const {
    const GridGeometry& g = options_.geometry;
    bool any = false;
    CellAddress low, high;
    const auto widen = [&](double x, double y) {
      const CellAddress cell = g.cell_of(x, y);
      low = any ? CellAddress{std::min(low.column, cell.column), std::min(low.row, cell.row)} : cell;
      high = any ? CellAddress{std::max(high.column, cell.column), std::max(high.row, cell.row)} : cell;
      any = true;
    };
    for (std::size_t i = 0; i < scan.size(); ++i) {
      if (scan.kind(i) == BeamKind::invalid) continue;
      const Place end = end_of(pose.x(), pose.y(), pose.angle() + scan.angle(i), length_of(scan, i));
      if (!any) widen(pose.x(), pose.y());
      widen(end.x, end.y);
    }
    if (any) cells_.expect_room(tile_of(low), tile_of(high));
  }

  template <class Visit>
  void walk(double x, double y, double angle, double end, Visit&& visit) const {
    const GridGeometry& g = options_.geometry;
    const Place to = end_of(x, y, angle, end);
    double from = 0;
    walk_ray(g.column_of(x), g.row_of(y), g.column_of(to.x), g.row_of(to.y),
             [&](CellAddress cell, double length) {
               const double chord = length * g.cell_size;
               visit(cell, from, chord);
               from += chord;
             });
  }

  /// What keeps grids of one tree apart while this one is written; nothing where they share no tree.
  [[nodiscard]] auto guarded() const {
    if constexpr (requires { cells_.guard(); })
      return cells_.guard();
    else
      return 0;
  }

  StopOptions options_;
  Storage cells_;
};

}}  // namespace cairn::CAIRN_ABI
