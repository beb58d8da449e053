// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "stop_mapper.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <ctime>
#include <exception>
#include <set>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/grid/ancestry.hpp>
#include <cairn/grid/shared_tiles.hpp>

#include "filled_path.hpp"
#include "loop_closing.hpp"
#include "map_image.hpp"
#include "odometry_frame.hpp"
#include "room.hpp"
#include "run.hpp"
#include "support/gathered_spread.hpp"

namespace grid_slam {

namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::SE2;
using cairn::StopCell;
using cairn::Vector;
using OnScan = std::function<std::optional<std::string>()>;

/// ConditionalMap over stops.
template <class Storage>
struct StopMap {
  using Pose = SE2;
  using Observation = cairn::LaserScan;
  cairn::StopGrid<Storage> grid;

  [[nodiscard]] double log_likelihood(const Pose& x, const Observation& z) const {
    return grid.log_likelihood(z, x);
  }
  /// Nothing where there is no room for it.
  void insert(const Pose& x, const Observation& z) {
    if (has_room_for(x, z)) grid.insert(z, x);
  }

  [[nodiscard]] bool has_room_for(const Pose& x, const Observation& z) const {
    return has_room(grid.options().geometry, grid.cells(), x, z.farthest);
  }

  /// For many draws from near one pose.
  struct Prepared {
    typename cairn::StopGrid<Storage>::Prepared grid;
    [[nodiscard]] double log_likelihood(const Pose& x, const Observation& z) {
      return grid.log_likelihood(z, x);
    }
  };
  [[nodiscard]] Prepared prepared() const { return {grid.prepared()}; }

  // What a StopMapper asks of a map.
  static StopMap empty(const StopMapperOptions& options) { return {cairn::StopGrid<Storage>(options.map)}; }
  static Observation observed(const cairn::LaserScan& scan) { return scan; }
  static cairn::FromMotion proposal(const StopMapperOptions& options) { return {.draws = options.draws}; }
  [[nodiscard]] const auto& stops() const { return grid; }
};

/// The same, with occupancy beside it for the proposal to match scans to.
template <class Storage>
struct MatchedStopMap {
  using Pose = SE2;
  struct Observation {
    cairn::LaserScan scan;
    std::vector<cairn::ScanPoint> points;
  };
  StopMap<Storage> stop_map;
  OccupancyMap occupancy;

  [[nodiscard]] double log_likelihood(const Pose& x, const Observation& z) const {
    return stop_map.log_likelihood(x, z.scan);
  }
  void insert(const Pose& x, const Observation& z) {
    stop_map.insert(x, z.scan);
    occupancy.insert(x, z.points);
  }

  [[nodiscard]] bool has_room_for(const Pose& x, const Observation& z) const {
    return stop_map.has_room_for(x, z.scan) && occupancy.has_room_for(x, z.points);
  }

  /// Draws where the occupancy says, and weighs by the stops: the weight is exact for any density that single
  /// poses are drawn from.
  struct Match {
    FromMatch match{.widened = 1, .draws = 1};

    [[nodiscard]] cairn::Proposed<SE2> operator()(const MatchedStopMap& map, const Gaussian<SE2>& motion,
                                                  const Observation& z, cairn::Random& random) const {
      const cairn::RegimeMotion<SE2> only{{{0, 1, motion}}};
      cairn::Proposed<SE2> drawn = match(map.occupancy, only, z.points, random);
      const double by_stops = map.log_likelihood(drawn.pose, z);
      drawn.log_weight += by_stops - drawn.log_likelihood;
      drawn.log_likelihood = by_stops;
      return drawn;
    }
  };

  static MatchedStopMap empty(const StopMapperOptions& options) {
    const MapperOptions as{};
    return {StopMap<Storage>::empty(options),
            {cairn::OccupancyGrid({options.map.geometry, as.field_radius}), as.model}};
  }
  static Observation observed(const cairn::LaserScan& scan) { return {scan, cairn::scan_points(scan)}; }
  static Match proposal(const StopMapperOptions&) { return {}; }
  [[nodiscard]] const auto& stops() const { return stop_map.grid; }
};

/// Scans and the stops that some of them made, for example::spread_of_poses().
struct OldStops {
  std::vector<const cairn::LaserScan*> scans;
  cairn::StopGrid<cairn::SharedTiles<StopCell>> grid;

  void insert(std::size_t k, const SE2& pose) {
    if (has_room(grid.options().geometry, grid.cells(), pose, scans[k]->farthest))
      grid.insert(*scans[k], pose);
  }
  template <class Visit>
  void for_each_cell(std::size_t k, const SE2& pose, const Visit& visit) const {
    for (const cairn::ScanPoint& p : cairn::scan_points(*scans[k])) {
      const Vector<2> at = pose * Vector<2>(p.x, p.y);
      visit(grid.options().geometry.cell_of(at(0), at(1)));
    }
  }
  [[nodiscard]] auto evidence(std::size_t k) const {
    return [prepared = grid.prepared(), scan = scans[k]](const SE2& pose) mutable {
      return prepared.log_likelihood(*scan, pose);
    };
  }
};

/// Bytes of all particles' stops, what they share counted once.
template <class Map>
std::size_t bytes_of(const cairn::MappedPaths<Map>& belief) {
  if constexpr (requires { belief[0].map.stops().cells().bytes(); }) {
    return belief[0].map.stops().cells().bytes();
  } else {
    std::set<const void*> seen;
    std::size_t bytes = 0;
    for (std::size_t i = 0; i < belief.size(); ++i)
      belief[i].map.stops().cells().for_each_tile([&](cairn::TileAddress, const auto& tile) {
        if (seen.insert(&tile).second) bytes += sizeof tile;
      });
    return bytes;
  }
}

/// Puts in what the stops would take otherwise, and of a tree who its nodes are.
template <class Map>
void put_memory(Snapshot& s, const cairn::MappedPaths<Map>& belief) {
  if constexpr (requires { belief[0].map.stops().cells().as_tiles(); }) {
    const auto tiles = belief[0].map.stops().cells().as_tiles();
    constexpr std::size_t bytes = sizeof(cairn::SharedTiles<StopCell>::Tile);
    s.tile_bytes = bytes * tiles.shared;
    s.separate_bytes = bytes * tiles.separate;
    s.ancestors = ancestors_of(belief.record());
  } else {
    for (std::size_t i = 0; i < belief.size(); ++i)
      belief[i].map.stops().cells().for_each_tile(
          [&](cairn::TileAddress, const auto& tile) { s.separate_bytes += sizeof tile; });
  }
}

template <class Map>
class StopMapper {
public:
  using Belief = cairn::MappedPaths<Map>;

  StopMapper(const SE2& T_odom_first, const StopMapperOptions& options)
      : options_(options),
        T_odom_first_(T_odom_first),
        belief_(options.start.value_or(T_odom_first), Map::empty(options), options.particles) {}

  void add(const cairn::StampedScan& given) {
    cairn::StampedScan scan = given;
    if (options_.start) scan.T_odom_laser = seen_from(T_odom_first_, scan.T_odom_laser);
    bool due = scans_.empty();
    if (!due) {
      const SE2 moved = scans_.back().T_odom_laser.inverse() * scan.T_odom_laser;
      moved_ = moved_ * moved;
      distance_ += moved.translation().norm();
      angle_ += std::abs(moved.angle());
      due = distance_ >= options_.step_distance || angle_ >= options_.step_angle;
    }
    scans_.push_back(std::move(scan));
    try {
      if (due) process(scans_.back());
    } catch (const std::exception&) {  // the belief does not know of the scan
      scans_.pop_back();
      throw;
    }
  }
  [[nodiscard]] const std::vector<cairn::StampedScan>& scans() const { return scans_; }

  void put_into(Results& r) const {
    r.steps = steps_;
    r.scans = scans_.size();
    const auto path = belief_.path(belief_.best());
    r.odometry = odometry_from(path.front().pose, scans_);
    const auto filled = [&](const auto& pose) {
      return filled_path(scans_, steps_.size(), [&](std::size_t k) { return steps_[k].scan; }, pose);
    };
    r.drawn = filled([&](std::size_t k) { return path[k + 1].pose; });
    // The mean of what was drawn from is an estimate where that knew of the scan, and none where it did not.
    r.means =
        scans_are_matched() ? filled([&](std::size_t k) { return path[k + 1].drawn_from.mean; }) : r.drawn;
    r.rematched = r.means;
    for (const auto& pose : path)
      if (pose.step > 0) r.drawn_from.push_back(pose.drawn_from);
    r.drawn_by_scans = scans_are_matched();
    r.newest = pose();
    if (!scans_are_matched()) put_spread_into(r);
    r.map = map_picture();
    r.bytes = bytes_of(belief_);
    for (std::size_t i = 0; i < belief_.size(); ++i) {
      if (i > 0 && belief_[i].node == belief_[i - 1].node) continue;
      auto& each = r.paths.emplace_back();
      for (const auto& pose : belief_.path(i)) each.push_back(pose.pose);
    }
  }

  [[nodiscard]] Snapshot snapshot() const {
    Snapshot s{.scans = scans_.size(),
               .processed = steps_.size(),
               .effective_size = steps_.back().effective_size,
               .newest = pose().covariance,
               .map = PackedMap(map_picture()),
               .bytes = bytes_of(belief_)};
    put_memory(s, belief_);
    put_paths(s, belief_);
    return s;
  }

private:
  [[nodiscard]] bool scans_are_matched() const { return options_.proposal == StopProposal::match; }

  /// With the covariance that the path has gathered: where scans are matched, from steps that are as sure as
  /// the grid mapper's.
  [[nodiscard]] Gaussian<SE2> pose() const {
    if (!scans_are_matched()) return spread_.pose(belief_);
    Gaussian<SE2> pose = belief_.pose();
    pose.covariance += covariance_of_end(belief_.path(belief_.best()), {});
    return pose;
  }

  /// Of the newest pose, and of the frames', from the best path.
  void put_spread_into(Results& r) const {
    constexpr double farther = 2;  // [m]: errors of scans nearer by are the newest one's own
    std::vector<SE2> path;
    for (const auto& each : belief_.path(belief_.best())) path.push_back(each.pose);
    path.erase(path.begin());  // the start, where the first scan is
    path.back() = r.newest.mean;
    cairn::StopOptions all_beams = options_.map;  // so few poses are asked about here
    all_beams.every = 1;
    OldStops nothing{{}, cairn::StopGrid<cairn::SharedTiles<StopCell>>(all_beams)};
    for (const StepRecord& step : steps_) nothing.scans.push_back(&scans_[step.scan].scan);
    std::vector<std::size_t> asked;
    for (const Snapshot& s : r.snapshots) asked.push_back(s.processed - 1);
    asked.push_back(steps_.size() - 1);
    const auto spread = example::spread_of_poses(
        std::move(nothing), path, spread_.along(path.size(), r.newest), asked, farther, options_.seed);
    for (std::size_t i = 0; i < r.snapshots.size(); ++i) r.snapshots[i].newest = spread[i];
    r.newest.covariance = spread.back();
  }

  [[nodiscard]] MapImage map_picture() const {
    const auto& grid = belief_[belief_.best()].map.stops();
    return image_of(options_.map.geometry, grid.cells(), [&](const StopCell& cell) {
      constexpr double enough = 0.2;  // of the beams through a cell
      if (!(cell.length > 0)) return unknown_grey;
      const double stopped = -std::expm1(-grid.stops_per_metre(cell) * options_.map.geometry.cell_size);
      return stopped > enough ? occupied_grey : free_grey;
    });
  }

  void process(const cairn::StampedScan& scan) {
    Matrix<3> noise = Vector<3>(1e-6, 1e-6, 1e-6).asDiagonal();
    if (!steps_.empty()) {
      const OdometryNoise& n = options_.odometry;
      const double along = n.offset + n.per_metre * distance_ + n.per_radian * angle_;
      const double turn = n.angle_offset + n.angle_per_metre * distance_ + n.angle_per_radian * angle_;
      noise = Vector<3>(along * along, along * along, turn * turn).asDiagonal();
    }
    const cairn::ConditionalFilter filter{
        .resample_below = options_.resample_below, .seed = options_.seed, .threads = options_.threads};
    const auto motion = [&](const SE2& x, std::size_t) { return Gaussian<SE2>{x * moved_, noise}; };
    std::atomic<bool> all_have_room = true;
    const auto propose = Map::proposal(options_);
    const auto with_room = [&](const Map& map, const Gaussian<SE2>& moved, const typename Map::Observation& z,
                               cairn::Random& random) {
      cairn::Proposed<SE2> proposed = propose(map, moved, z, random);
      if (!map.has_room_for(proposed.pose, z)) {
        forbid(proposed);
        all_have_room = false;
      }
      return proposed;
    };
    const cairn::MappingStep step = filter.step(belief_, motion, with_room, Map::observed(scan.scan));
    if (!step.accepted()) refuse_step(step.status, all_have_room, options_.map.geometry.cell_size);
    if (!scans_are_matched()) spread_.take(belief_);
    steps_.push_back({scans_.size() - 1, step.effective_size, step.resampled, false, belief_.pose()});
    moved_ = SE2();
    distance_ = angle_ = 0;
  }

  StopMapperOptions options_;
  SE2 T_odom_first_;  // of the laser, at the first scan
  Belief belief_;
  example::GatheredSpread spread_;
  std::vector<cairn::StampedScan> scans_;
  std::vector<StepRecord> steps_;
  SE2 moved_;
  double distance_ = 0, angle_ = 0;
};

template <class Map>
void map_log(Results& r, const cairn::CarmenLog& log, const StopMapperOptions& options, const OnScan& on_scan,
             std::size_t frames) {
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  StopMapper<Map> mapper(log.scans.front().T_odom_laser, options);
  const std::size_t count = log.scans.size();
  for (std::size_t i = 0; i < count; ++i) {
    try {
      mapper.add(log.scans[i]);
    } catch (const std::exception& error) {
      if (mapper.scans().empty()) throw;
      end_of_data(r, log, mapper.scans().size(), error.what());
      break;
    }
    if (on_scan) r.ended_early = on_scan();
    if (r.ended_early) break;
    if (is_film_frame(i, count, frames)) r.snapshots.push_back(mapper.snapshot());
  }
  if (frames > 0) r.snapshots.push_back(mapper.snapshot());
  r.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  r.cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  mapper.put_into(r);
  add_notes(r, mapper.scans());
}

}  // namespace

StopMapperOptions matching_stops() {
  const MapperOptions mapper{};
  StopMapperOptions options;
  options.proposal = StopProposal::match;
  options.particles = mapper.particles;
  options.map.independence = 0.4;
  options.odometry = mapper.odometry;
  options.step_distance = mapper.step_distance;
  options.step_angle = mapper.step_angle;
  return options;
}

Results run_stop_mapper(const cairn::CarmenLog& log, const StopMapperOptions& options,
                        const std::vector<cairn::PoseRelation>& relations, const OnScan& on_scan,
                        std::size_t frames) {
  if (log.scans.empty()) cairn::raise("expected a log with a scan");
  if (options.draws == 0) cairn::raise("expected at least one draw a particle");
  Results r;
  r.seed = options.seed;
  r.particles = options.particles;
  r.threads = options.threads;
  const auto map_with = [&]<class Storage>() {
    if (options.proposal == StopProposal::motion)
      map_log<StopMap<Storage>>(r, log, options, on_scan, frames);
    else
      map_log<MatchedStopMap<Storage>>(r, log, options, on_scan, frames);
  };
  if (options.storage == StopStorage::tiles)
    map_with.template operator()<cairn::SharedTiles<StopCell>>();
  else
    map_with.template operator()<cairn::Ancestry<StopCell>>();
  measure(r, relations);
  return r;
}

}  // namespace grid_slam
