// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "run.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/filter/conditional.hpp>

#include "support/gathered_spread.hpp"

namespace gamma_slam {

namespace {

using cairn::CellAddress;
using cairn::Gaussian;
using cairn::Matrix;
using cairn::SE2;
using cairn::Vector;

Matrix<3> motion_noise(const TerrainScan& scan, bool first, const RunOptions& options) {
  const Matrix<3> exact = 1e-12 * Matrix<3>::Identity();
  if (first) return exact;
  const double slip = options.per_metre * scan.moved.translation().norm();
  const Matrix<3> common =
      Vector<3>(slip * slip, slip * slip, options.turn_sigma * options.turn_sigma).asDiagonal();
  return scan.moved_covariance + common + exact;
}

/// Scans and the map that some of them made, for example::spread_of_poses().
template <class Cell>
struct OldGround {
  const std::vector<TerrainScan>* scans;
  ElevationMap<Cell> map;
  std::size_t inserted = 0;

  void insert(std::size_t k, const SE2& pose) {
    map.insert(pose, (*scans)[k]);
    inserted = k + 1;
  }
  template <class Visit>
  void for_each_cell(std::size_t k, const SE2& pose, const Visit& visit) const {
    for (const GroundPoint& p : (*scans)[k].points) {
      const Vector<2> at = pose * Vector<2>(p.x, p.y);
      visit(map.options().geometry.cell_of(at(0), at(1)));
    }
  }
  [[nodiscard]] auto evidence(std::size_t k) const {
    TerrainScan scan = (*scans)[k];
    scan.climbed = scan.climbed_variance = 0;  // since the map's last scan
    for (std::size_t i = inserted; i <= k; ++i) {
      scan.climbed += (*scans)[i].climbed;
      scan.climbed_variance += (*scans)[i].climbed_variance;
    }
    return [this, scan = std::move(scan)](const SE2& pose) { return map.log_likelihood(pose, scan); };
  }
};

/// The newest pose, and how far it may be off.
template <class Cell>
Gaussian<SE2> newest_pose(const cairn::MappedPaths<ElevationMap<Cell>>& belief,
                          const example::GatheredSpread& spread, const Drive& drive,
                          const RunOptions& options) {
  constexpr double farther = 20;  // [m]: twice what a camera reaches, before and after a pose
  Gaussian<SE2> pose = spread.pose(belief);
  std::vector<SE2> path;
  for (const auto& each : belief.path(belief.best())) path.push_back(each.pose);
  path.erase(path.begin());  // the start, which the first scan repeats
  path.back() = pose.mean;
  const OldGround<Cell> nothing{&drive.scans, ElevationMap<Cell>(options.map)};
  pose.covariance = example::spread_of_poses(nothing, path, spread.along(path.size(), pose),
                                             {path.size() - 1}, farther, options.seed)
                        .front();
  return pose;
}

/// A rectangle of cells, both corners inside.
struct CellBox {
  CellAddress low{cairn::farthest_cell, cairn::farthest_cell}, high{-low.column, -low.row};

  void hold(CellAddress cell) {
    low = {std::min(low.column, cell.column), std::min(low.row, cell.row)};
    high = {std::max(high.column, cell.column), std::max(high.row, cell.row)};
  }
};

/// The terrain's square where there is one, else what the maps know, and no more than a picture can hold.
template <class Map>
CellBox box_of(const std::optional<Terrain>& terrain, const Map& a, const Map& b) {
  CellBox box;
  if (terrain) {
    const auto half =
        static_cast<std::int32_t>(std::floor(Terrain::half_side / a.options().geometry.cell_size));
    box.hold({-half, -half});
    box.hold({half - 1, half - 1});
    return box;
  }
  for (const Map* map : {&a, &b})
    map->cells().for_each_tile([&](cairn::TileAddress tile, const auto& cells) {
      const CellAddress corner = cairn::corner_of(tile);
      for (int i = 0; i < cairn::tile_cells; ++i)
        if (cells[static_cast<std::size_t>(i)].known())
          box.hold({corner.column + i % cairn::tile_side, corner.row + i / cairn::tile_side});
    });
  constexpr std::int32_t most = 4000;  // cells a side
  if (box.low.column > box.high.column) return {{0, 0}, {0, 0}};
  box.high = {std::min(box.high.column, box.low.column + most), std::min(box.high.row, box.low.row + most)};
  return box;
}

/// A pixel a cell, by what is said of each: sigma, or nothing.
template <class SigmaOf>
SigmaImage image_of(double cell_size, const CellBox& box, const SigmaOf& sigma_of) {
  constexpr double darkest = 0.2;  // [m]
  const std::int32_t columns = box.high.column - box.low.column + 1, rows = box.high.row - box.low.row + 1;
  SigmaImage map{cairn::Image(columns, rows, 255), box.low.column * cell_size, (box.high.row + 1) * cell_size,
                 cell_size};
  for (std::int32_t row = 0; row < rows; ++row)
    for (std::int32_t column = 0; column < columns; ++column)
      if (const auto sigma = sigma_of(CellAddress{box.low.column + column, box.high.row - row}))
        map.image(column, row) =
            static_cast<std::uint8_t>(std::lrint(235 * (1 - std::min(1.0, *sigma / darkest))));
  return map;
}

template <class Cell>
SigmaImage image_of(const ElevationMap<Cell>& map, const CellBox& box) {
  const ElevationOptions& options = map.options();
  return image_of(options.geometry.cell_size, box, [&](CellAddress at) -> std::optional<double> {
    const Cell& cell = map.cells().read(at);
    if (!cell.known()) return std::nullopt;
    return cell.spread(options.prior).expected_sigma();
  });
}

template <class Cell>
Coverage coverage_of(const ElevationMap<Cell>& map, const Terrain& terrain) {
  constexpr double enough = 10;
  const ElevationOptions& options = map.options();
  const double side = options.geometry.cell_size;
  Coverage result;
  map.cells().for_each_tile([&](cairn::TileAddress tile, const auto& cells) {
    for (int i = 0; i < cairn::tile_cells; ++i) {
      const cairn::HeightSpread spread = cells[static_cast<std::size_t>(i)].spread(options.prior);
      if (spread.nu < options.prior.nu + enough) continue;
      const CellAddress corner = cairn::corner_of(tile);
      const double sigma = terrain.sigma_in((corner.column + i % cairn::tile_side) * side,
                                            (corner.row + i / cairn::tile_side) * side, side);
      ++result.cells;
      result.covered += spread.sigma_quantile(0.05) < sigma && sigma < spread.sigma_quantile(0.95);
      result.log_ratio += std::log(spread.expected_sigma() / sigma);
    }
  });
  if (result.cells > 0) result.log_ratio /= static_cast<double>(result.cells);
  return result;
}

template <class Cell>
void map_drive(Results& r, const Drive& drive, const std::function<std::optional<std::string>()>& on_scan) {
  using Map = ElevationMap<Cell>;
  const RunOptions& options = r.options;
  cairn::MappedPaths<Map> belief(drive.truth.front(), Map(options.map), options.particles);
  Map by_odometry(options.map);
  example::GatheredSpread spread;
  const cairn::ConditionalFilter filter{
      .resample_below = options.resample_below, .seed = options.seed, .threads = options.threads};
  for (const TerrainScan& scan : drive.scans) {
    const Matrix<3> noise = motion_noise(scan, r.scans == 0, options);
    const auto motion = [&](const SE2& x, std::size_t) { return Gaussian<SE2>{x * scan.moved, noise}; };
    const bool wide = noise(2, 2) > options.wide_turn * options.wide_turn;
    const cairn::FromMotion proposal{.draws = wide ? options.draws : 1};
    const cairn::MappingStep step = filter.step(belief, motion, proposal, scan);
    if (!step.accepted())
      cairn::raise("scan " + std::to_string(r.scans) + ": " + cairn::explain(step.status));
    spread.take(belief);
    r.resampled += step.resampled;
    r.effective_size.push_back(step.effective_size);
    r.time.push_back(scan.time);
    r.truth.push_back(drive.truth[r.scans]);
    r.odometry.push_back(r.scans == 0 ? drive.truth.front() : r.odometry.back() * scan.moved);
    by_odometry.insert(r.odometry.back(), scan);
    ++r.scans;
    if (on_scan) r.ended_early = on_scan();
    if (r.ended_early) break;
  }
  for (std::size_t i = 0; i < belief.size(); ++i) {
    if (i > 0 && belief[i].node == belief[i - 1].node) continue;
    auto& path = r.paths.emplace_back();
    for (const auto& each : belief.path(i)) path.push_back(each.pose);
  }
  // The path begins with the start, which the first scan repeats.
  for (const auto& each : belief.path(belief.best())) r.path.push_back(each.pose);
  r.path.erase(r.path.begin());
  r.newest = newest_pose(belief, spread, drive, options);
  const Map& best = belief[belief.best()].map;
  const CellBox box = box_of(drive.terrain, best, by_odometry);
  r.odometry_map = image_of(by_odometry, box);
  r.filter_map = image_of(best, box);
  if (!drive.terrain) return;
  r.true_map = image_of(options.map.geometry.cell_size, box, [&](CellAddress at) -> std::optional<double> {
    const double side = options.map.geometry.cell_size;
    if (!best.cells().read(at).known()) return std::nullopt;
    return drive.terrain->sigma_in(at.column * side, at.row * side, side);
  });
  r.coverage = coverage_of(best, *drive.terrain);
}

}  // namespace

double Results::mean_error(const std::vector<SE2>& poses) const {
  double sum = 0;
  for (std::size_t i = 0; i < poses.size(); ++i)
    sum += (poses[i].translation() - truth[i].translation()).norm();
  return poses.empty() ? 0 : sum / static_cast<double>(poses.size());
}

double Results::end_error(const std::vector<SE2>& poses) const {
  return poses.empty() ? 0 : (poses.back().translation() - truth[poses.size() - 1].translation()).norm();
}

Results run(const Drive& drive, const RunOptions& options,
            const std::function<std::optional<std::string>()>& on_scan) {
  if (options.particles == 0 || options.draws == 0)
    cairn::raise("expected at least one particle and one draw");
  Results r;
  r.options = options;
  r.drive = drive.name;
  const auto begin = std::chrono::steady_clock::now();
  if (options.cells == Cells::heights)
    map_drive<cairn::HeightCell>(r, drive, on_scan);
  else
    map_drive<cairn::VarianceCell>(r, drive, on_scan);
  if (!r.ended_early) r.ended_early = drive.ended_early;
  r.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return r;
}

}  // namespace gamma_slam
