// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Mapper::save and Mapper::loaded: all that a mapper is, so that going on from a file is going on.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/grid/shared_tiles.hpp>
#include <cairn/io/carmen.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>

#include "mapper.hpp"
#include "support/archive.hpp"
#include "support/paths_archive.hpp"

namespace cairn {
inline namespace CAIRN_ABI {

// Found by the archive, beside the types.
template <class Archive>
void parts(Archive& archive, LaserScan& s) {
  archive(s.first_angle, s.angle_step, s.nearest, s.farthest, s.range);
}
template <class Archive>
void parts(Archive& archive, StampedScan& s) {
  archive(s.time, s.T_odom_laser, s.T_odom_robot, s.scan);
}
template <class Archive>
void parts(Archive& archive, ScanPoint& p) {
  archive(p.x, p.y);
}
template <class Archive>
void parts(Archive& archive, OccupancyCell& c) {
  archive(c.visits, c.hits, c.mean_x, c.mean_y);
}
template <class Archive>
void parts(Archive& archive, TileAddress& a) {
  archive(a.column, a.row);
}
template <class Archive>
void parts(Archive& archive, EndPointModel& m) {
  archive(m.sigma, m.outliers, m.unknown, m.independence);
}

}  // namespace CAIRN_ABI
}  // namespace cairn

namespace grid_slam {

using example::expect_covariance;
using example::expect_place;
using example::Reader;
using example::Writer;

template <class Archive>
void parts(Archive& archive, StepRecord& s) {
  archive(s.scan, s.effective_size, s.resampled, s.moved, s.pose);
}
template <class Archive>
void parts(Archive& archive, Loop& l) {
  archive(l.first, l.last, l.T_first_last, l.covariance);
}

template <class Archive>
void parts(Archive& archive, Asked& a) {
  archive(a.error, a.at, a.since, a.whole);
}

namespace {

constexpr std::string_view kind = "cairngrd";
constexpr std::uint64_t version = 6;

/// Grids that share tiles: every tile once, and for each grid the numbers of its own.
template <class Cell>
struct TileStore {
  struct Tile {
    cairn::TileAddress address;
    std::vector<Cell> cells;
  };
  std::vector<Tile> tiles;
  std::vector<std::vector<std::uint32_t>> of_grid;

  template <class Archive>
  friend void parts(Archive& archive, Tile& t) {
    archive(t.address, t.cells);
  }
  template <class Archive>
  friend void parts(Archive& archive, TileStore& s) {
    archive(s.tiles, s.of_grid);
  }

  void add(const cairn::SharedTiles<Cell>& grid) {
    auto& numbers = of_grid.emplace_back();
    grid.for_each_tile([&](cairn::TileAddress address, const auto& tile) {
      const auto [place, fresh] = known_.try_emplace(&tile, static_cast<std::uint32_t>(tiles.size()));
      if (fresh) {
        std::vector<Cell>& cells = tiles.emplace_back(Tile{address, {}}).cells;
        cells.reserve(cairn::tile_cells);
        for (std::size_t k = 0; k < cairn::tile_cells; ++k) cells.push_back(tile[k]);
      }
      numbers.push_back(place->second);
    });
  }

  [[nodiscard]] std::vector<cairn::SharedTiles<Cell>> grids(const Reader& reader) const {
    expect_near_each_other(reader);
    std::vector<cairn::SharedTiles<Cell>> single(tiles.size()), all(of_grid.size());
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      if (tiles[i].cells.size() != cairn::tile_cells) reader.refuse("a tile of the map has another size");
      if (!std::ranges::all_of(tiles[i].cells, possible)) reader.refuse("a cell has more hits than visits");
      single[i].writable_tile(tiles[i].address) = typename cairn::SharedTiles<Cell>::Tile(
          std::span(tiles[i].cells).template first<cairn::tile_cells>());
    }
    for (std::size_t g = 0; g < all.size(); ++g)
      for (const std::uint32_t number : of_grid[g]) {
        if (number >= tiles.size()) reader.refuse("the map names a tile that it does not have");
        all[g].share_tile(tiles[number].address, single[number]);
      }
    return all;
  }

private:
  static bool possible(const Cell& cell) {
    if constexpr (requires { cell.hits; }) return cell.hits <= cell.visits;
    return true;
  }

  /// Tiles far apart cost memory in between, once for each grid: 2^24 places (128 MB), 19 km in square at 5
  /// cm for thirty grids, are more than any building and less than what a made-up file could ask for.
  void expect_near_each_other(const Reader& reader) const {
    if (tiles.empty()) return;
    constexpr double side = 16, most = 1 << 24;  // tiles of a block; places
    const auto by_column = [](const Tile& t) { return t.address.column; };
    const auto by_row = [](const Tile& t) { return t.address.row; };
    const auto [left, right] = std::ranges::minmax(tiles, {}, by_column);
    const auto [low, high] = std::ranges::minmax(tiles, {}, by_row);
    const auto blocks = [](std::int32_t from, std::int32_t to) {
      return static_cast<double>(std::int64_t{to} - from) / side + 2;
    };
    const double area =
        blocks(left.address.column, right.address.column) * blocks(low.address.row, high.address.row);
    if (!(area * static_cast<double>(of_grid.size()) <= most))
      reader.refuse("the map's tiles lie too far apart");
  }

  std::map<const void*, std::uint32_t> known_;  // looked up only; its order decides nothing
};

bool growing(const std::vector<double>& numbers) {
  return std::ranges::is_sorted(numbers) && (numbers.empty() || numbers.front() >= 0);
}

}  // namespace

/// What of a mapper is neither a map nor a path.
template <class Archive>
void Mapper::plain_parts(Archive& archive, Mapper& m) {
  archive(m.steps_, m.points_, m.travelled_, m.scans_, m.loops_);
  archive(m.motion_.distance, m.motion_.angle, m.motion_.stood, m.delay_);
  archive(m.looked_, m.asked_);
  archive(m.unseen_.still_since, m.unseen_.steps, m.unseen_.newest, m.T_odom_first_);
}

void Mapper::expect_sound(const Reader& reader) const {
  if (scans_.empty() || travelled_.size() != steps_.size() + 1 || points_.size() != steps_.size())
    reader.refuse("the map has not as many scans as steps");
  if (steps_.empty() || steps_.front().scan != 0 || steps_.back().scan >= scans_.size() ||
      std::ranges::adjacent_find(steps_, std::ranges::greater_equal{}, &StepRecord::scan) != steps_.end())
    reader.refuse("the steps are not in the order of the scans");
  if (!growing(travelled_) || !(motion_.distance >= 0 && motion_.angle >= 0))
    reader.refuse("the way travelled is not one");
  if (unseen_.still_since >= scans_.size()) reader.refuse("odometry stands since a scan that there is not");
  if (!delay_.is_distribution()) reader.refuse("the shares of the scans' delays do not sum to one");
  if (asked_ && !(asked_->since >= 0 && asked_->since <= asked_->at))
    reader.refuse("a look came before its first");
  for (const Loop& loop : loops_) {
    if (loop.first >= loop.last || loop.last >= travelled_.size())
      reader.refuse("a loop joins poses that there are not");
    expect_place(reader, loop.T_first_last);
    expect_covariance(reader, loop.covariance);
  }
  for (const StepRecord& step : steps_) {
    expect_place(reader, step.pose.mean);
    expect_covariance(reader, step.pose.covariance);
  }
  expect_place(reader, T_odom_first_);
  for (const cairn::StampedScan& scan : scans_) {
    expect_place(reader, scan.T_odom_laser);
    expect_place(reader, scan.T_odom_robot);
  }
}

void Mapper::save(const std::filesystem::path& path) const {
  if (!belief_) cairn::raise("a map without a scan is not saved");
  if (frozen_) cairn::raise("a map that is only localised in is not saved again");
  Mapper copy = *this;  // the archive's functions serve reading too, so they want what may be changed
  MapperOptions& options = copy.options_;
  cairn::PathsRecord<cairn::SE2> record = belief_->record();
  TileStore<cairn::OccupancyCell> cells;
  for (std::size_t i = 0; i < belief_->size(); ++i) cells.add((*belief_)[i].map.grid.cells());
  Writer writer;
  writer(options.cell_size, options.field_radius, options.model, options.particles, options.seed, record,
         cells);
  cells = {};  // as large as the file
  plain_parts(writer, copy);
  cairn::write_file_atomically(path, std::move(writer).file(kind, version));
}

Mapper Mapper::loaded(const std::filesystem::path& path, const MapRequest& wanted) {
  const std::string bytes = cairn::read_file(path, "a map of grid_slam");
  Reader reader(bytes, kind, version, path.string());
  try {
    return loaded(reader, wanted);
  } catch (const cairn::Error& error) {  // of what the numbers were given to
    if (std::string_view(error.what()).starts_with(path.string())) throw;
    reader.refuse(error.what());
  }
}

Mapper Mapper::loaded(Reader& reader, const MapRequest& wanted) {
  MapperOptions options;
  cairn::PathsRecord<cairn::SE2> record;
  TileStore<cairn::OccupancyCell> cells;
  reader(options.cell_size, options.field_radius, options.model, options.particles, options.seed, record,
         cells);
  if (wanted.cell_size && *wanted.cell_size != options.cell_size)
    reader.refuse("expected cells of " + cairn::shortest(*wanted.cell_size) +
                  " m, found a map with cells of " + cairn::shortest(options.cell_size) + " m");
  if (wanted.particles && *wanted.particles != options.particles)
    reader.refuse("expected " + std::to_string(*wanted.particles) + " particles, found a map of " +
                  std::to_string(options.particles));
  options.seed = wanted.seed.value_or(options.seed);
  options.threads = wanted.threads;
  Mapper mapper(options);
  plain_parts(reader, mapper);
  reader.expect_end();
  if (record.particles.size() != options.particles) reader.refuse("the map has other particles than it says");
  mapper.expect_sound(reader);
  constexpr std::size_t regimes = 2;  // forwards, backwards
  expect_paths(reader, record, mapper.travelled_.size(), regimes);
  auto cell_grids = cells.grids(reader);
  std::vector<OccupancyMap> maps;
  for (std::size_t i = 0; i < cell_grids.size(); ++i)
    maps.push_back(
        {cairn::OccupancyGrid({{options.cell_size, 0, 0}, options.field_radius}, std::move(cell_grids[i])),
         options.model});
  mapper.belief_.emplace(record, std::move(maps));
  return mapper;
}

}  // namespace grid_slam
