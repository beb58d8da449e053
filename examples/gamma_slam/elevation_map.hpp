// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The ground as the map of a particle: Gamma-SLAM's cells over shared tiles.
///
/// Each point of a scan counts in every particle: where it falls into a cell that nobody has seen, the prior
/// says how likely it is. Particles that run into the unknown would win otherwise. With HeightCell the map
/// also holds how high the vehicle stands: given the path that is a Gaussian, estimated by comparing each
/// scan with the cells already known.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/grid/height_cell.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/manifold/se2.hpp>

#include "drive.hpp"

namespace gamma_slam {

struct ElevationOptions {
  cairn::GridGeometry geometry{.cell_size = 0.2};
  cairn::HeightPrior prior{};
  /// Evidence of a scan counts for this share of itself: its points err together, by pitch, roll and
  /// matching.
  double independence = 0.01;
  /// A height counts for this share of one in a cell: scans of one pass see the same stones.
  double heights_share = 0.2;
  double altitude_sigma = 0.02;  ///< of a cell's mean by what all its points have in common [m]
};

/// ConditionalMap of cells of type VarianceCell or HeightCell.
template <class Cell>
class ElevationMap {
public:
  using Pose = cairn::SE2;
  using Observation = TerrainScan;
  static constexpr bool keeps_means = std::is_same_v<Cell, cairn::HeightCell>;

  explicit ElevationMap(const ElevationOptions& options = {}) : options_(options), model_(options.prior) {
    if (!(options.geometry.cell_size > 0) || !std::isfinite(options.geometry.cell_size))
      cairn::raise("ElevationMap: expected a cell size above zero");
    if (!(options.independence > 0 && options.independence <= 1))
      cairn::raise("ElevationMap: expected an independence above 0 and up to 1");
    if (!(options.heights_share > 0 && options.heights_share <= 1))
      cairn::raise("ElevationMap: expected a share of heights above 0 and up to 1");
  }

  [[nodiscard]] const ElevationOptions& options() const noexcept { return options_; }
  [[nodiscard]] const cairn::SharedTiles<Cell>& cells() const noexcept { return cells_; }
  /// How high the vehicle stands above where it began [m].
  [[nodiscard]] double altitude() const noexcept { return altitude_; }

  [[nodiscard]] double log_likelihood(const Pose& x, const Observation& z) const {
    std::vector<Visit> visits = visits_of(x, z);
    lift(visits, altitude_after(visits, z).value);
    double sum = 0;
    for (const Visit& visit : visits) sum += cells_.read(visit.cell).log_evidence(visit.heights, model_);
    return options_.independence * sum;
  }

  void insert(const Pose& x, const Observation& z) {
    std::vector<Visit> visits = visits_of(x, z);
    const Altitude altitude = altitude_after(visits, z);
    altitude_ = altitude.value;
    variance_ = altitude.variance;
    lift(visits, altitude_);
    for (const Visit& visit : visits) cells_.write(visit.cell).insert(visit.heights, options_.heights_share);
  }

private:
  struct Visit {
    cairn::CellAddress cell;
    cairn::HeightSums heights;
  };
  struct Altitude {
    double value, variance;
  };

  /// The scan's points by cells, row by row.
  [[nodiscard]] std::vector<Visit> visits_of(const Pose& x, const Observation& z) const {
    const double c = std::cos(x.angle()), s = std::sin(x.angle());
    std::vector<cairn::CellAddress> cells;
    cells.reserve(z.points.size());
    cairn::CellAddress low{cairn::farthest_cell, cairn::farthest_cell}, high{-low.column, -low.row};
    for (const GroundPoint& p : z.points) {
      const double px = x.x() + c * p.x - s * p.y, py = x.y() + s * p.x + c * p.y;
      if (!options_.geometry.contains(px, py))
        cairn::raise("ElevationMap: expected points less than 2^28 cells from the origin");
      const cairn::CellAddress cell = options_.geometry.cell_of(px, py);
      low = {std::min(low.column, cell.column), std::min(low.row, cell.row)};
      high = {std::max(high.column, cell.column), std::max(high.row, cell.row)};
      cells.push_back(cell);
    }
    std::vector<Visit> visits;
    if (cells.empty()) return visits;
    const std::int32_t columns = high.column - low.column + 1;
    std::vector<cairn::HeightSums> box(static_cast<std::size_t>(columns) *
                                       static_cast<std::size_t>(high.row - low.row + 1));
    for (std::size_t i = 0; i < cells.size(); ++i)
      box[static_cast<std::size_t>((cells[i].row - low.row) * columns + cells[i].column - low.column)].add(
          z.points[i].height);
    for (std::size_t i = 0; i < box.size(); ++i)
      if (box[i].count > 0)
        visits.push_back({{low.column + static_cast<std::int32_t>(i) % columns,
                           low.row + static_cast<std::int32_t>(i) / columns},
                          box[i]});
    return visits;
  }

  static void lift(std::vector<Visit>& visits, double altitude) {
    if constexpr (keeps_means)
      for (Visit& visit : visits) visit.heights.mean += altitude;
  }

  /// The altitude given what odometry says it climbed, and what the known cells say of it.
  [[nodiscard]] Altitude altitude_after(const std::vector<Visit>& visits, const Observation& z) const {
    const Altitude before{altitude_ + z.climbed, variance_ + z.climbed_variance};
    if constexpr (keeps_means) {
      if (!(before.variance > 0)) return before;
      double information = 1 / before.variance, sum = 0;  // about the value before
      for (const Visit& visit : visits) {
        const cairn::HeightCell& cell = cells_.read(visit.cell);
        if (cell.seen.count < 3) continue;
        const cairn::HeightSpread spread = cell.spread(options_.prior);
        const double variance = spread.squares / spread.nu * (1 / visit.heights.count + 1 / cell.seen.count) +
                                options_.altitude_sigma * options_.altitude_sigma;
        const double weight = options_.independence / variance;
        information += weight;
        sum += weight * (cell.seen.mean - visit.heights.mean - before.value);
      }
      return {before.value + sum / information, 1 / information};
    }
    return before;
  }

  ElevationOptions options_;
  cairn::HeightModel model_;
  cairn::SharedTiles<Cell> cells_;
  double altitude_ = 0, variance_ = 0;
};

}  // namespace gamma_slam
