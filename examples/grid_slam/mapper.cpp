// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "mapper.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <exception>
#include <functional>
#include <numbers>
#include <string>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/io/text.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/scan/correlative.hpp>
#include <cairn/scan/match.hpp>

#include "filled_path.hpp"
#include "odometry_frame.hpp"
#include "room.hpp"

namespace grid_slam {

namespace {

using cairn::Matrix;
using cairn::ScanPoint;
using cairn::SE2;
using cairn::Vector;

std::vector<SE2> poses_on(const std::vector<cairn::PathPose<SE2>>& path) {
  std::vector<SE2> poses;
  poses.reserve(path.size());
  for (const auto& each : path) poses.push_back(each.pose);
  return poses;
}

/// Scans: none lags so far behind odometry.
constexpr std::size_t longest_delay = 4;

/// Of a step of odometry from one scan to the next: less than any wheel's least count.
bool is_still(const SE2& moved) {
  return moved.translation().norm() < 1e-4 && std::abs(moved.angle()) < 1e-4;
}

/// Of the beams that came back in both scans the share that did so from elsewhere; 0 where beams are others.
double share_of_changed(const cairn::LaserScan& a, const cairn::LaserScan& b) {
  if (a.size() != b.size() || a.angle_step != b.angle_step || a.first_angle != b.first_angle) return 0;
  double both = 0, changed = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a.kind(i) != cairn::BeamKind::hit || b.kind(i) != cairn::BeamKind::hit) continue;
    const auto before = static_cast<double>(a.range[i]), now = static_cast<double>(b.range[i]);
    both += 1;
    changed += std::abs(now - before) > 0.1 + 0.02 * now ? 1 : 0;
  }
  return both > 0 ? changed / both : 0;
}

/// [m]: where a first scan is looked for, farther points say little more and cost much.
constexpr double first_view = 12;

/// Points of several scans, seen from the last pose.
std::vector<ScanPoint> seen_together(const std::vector<SE2>& poses,
                                     const std::vector<std::vector<ScanPoint>>& points, std::size_t first,
                                     std::size_t last) {
  std::vector<ScanPoint> all;
  for (std::size_t k = first; k <= last; ++k) {
    const SE2 T = poses[last].inverse() * poses[k];
    for (const ScanPoint& p : cairn::thinned(points[k - 1], 0.1)) {
      const Vector<2> q = T * Vector<2>(p.x, p.y);
      all.push_back({q(0), q(1)});
    }
  }
  return all;
}

/// What a point is worth by its distance from the obstacles of a map, around a place.
cairn::ScoreGrid scores_around(const cairn::OccupancyGrid& grid, double x, double y, double reach) {
  const cairn::GridGeometry& geometry = grid.geometry();
  const cairn::CellAddress low = geometry.cell_of(x - reach, y - reach);
  const int side = static_cast<int>(2 * reach / geometry.cell_size) + 1;
  cairn::ScoreGrid scores(geometry, low, side, side);
  constexpr double sigma = 0.1;  // [m], about the lattice's own coarseness
  const int radius = static_cast<int>(std::ceil(3 * sigma / geometry.cell_size));
  constexpr int fineness = 16;  // of squared distances [1/cells^2]
  std::vector<std::uint8_t> worth;
  for (int k = 0; k <= fineness * 9 * radius * radius; ++k) {
    const double squared = geometry.cell_size * geometry.cell_size * k / fineness;
    worth.push_back(squared > 9 * sigma * sigma
                        ? std::uint8_t{0}
                        : static_cast<std::uint8_t>(255 * std::exp(-0.5 * squared / (sigma * sigma))));
  }
  grid.cells().for_each_tile([&](cairn::TileAddress address, const auto& tile) {
    const cairn::CellAddress corner = cairn::corner_of(address);
    for (int i = 0; i < cairn::tile_cells; ++i) {
      const cairn::OccupancyCell& cell = tile[static_cast<std::size_t>(i)];
      if (!cell.is_obstacle()) continue;
      const int column = corner.column + i % cairn::tile_side - low.column,
                row = corner.row + i / cairn::tile_side - low.row;
      for (int r = std::max(0, row - radius); r <= std::min(side - 1, row + radius); ++r)
        for (int c = std::max(0, column - radius); c <= std::min(side - 1, column + radius); ++c) {
          const float dx = static_cast<float>(column - c) + cell.point_x() - 0.5F;
          const float dy = static_cast<float>(row - r) + cell.point_y() - 0.5F;
          const auto k = static_cast<std::size_t>(fineness * (dx * dx + dy * dy));
          scores(c, r) = std::max(scores(c, r), worth[k]);
        }
    }
  });
  return scores;
}

}  // namespace

Mapper::Mapper(const MapperOptions& options) : options_(options) {
  if (options.particles == 0) cairn::raise("Mapper: expected at least one particle");
  if (!options.model.valid()) cairn::raise("Mapper: expected a scan model within its ranges");
  static_cast<void>(empty_map());
}

OccupancyMap Mapper::empty_map() const {
  return {cairn::OccupancyGrid({{options_.cell_size, 0, 0}, options_.field_radius}), options_.model};
}

const Mapper::Belief& Mapper::belief() const {
  CAIRN_EXPECTS(belief_.has_value(), "belief() needs a mapper that has taken a scan");
  return *belief_;
}

cairn::Gaussian<SE2> Mapper::newest() const {
  cairn::Gaussian<SE2> pose = belief().pose();
  if (!frozen_) pose.covariance += covariance_of_end(belief_->path(belief_->best()), loops_);
  return pose;
}

bool Mapper::add(const cairn::StampedScan& given) {
  cairn::StampedScan scan = given;
  if (scans_.empty()) T_odom_first_ = scan.T_odom_laser;
  scan.T_odom_laser = seen_from(T_odom_first_, scan.T_odom_laser);
  const Motion before = motion_;
  const Unseen unseen_before = unseen_;
  const std::size_t steps = steps_.size();
  bool due = scans_.empty(), stopped = false;
  if (due) {
    begin(scan.scan);
  } else {
    const SE2 moved = scans_.back().T_odom_laser.inverse() * scan.T_odom_laser;
    accumulate(moved);
    // Where the robot stops the direction may change, so no step goes on beyond that.
    stopped = stands(scan);
    due = motion_.distance >= options_.step_distance || motion_.angle >= options_.step_angle ||
          (stopped && motion_.distance > 2 * options_.standstill);
    if (!due && stopped) motion_.stood = true;
    if (!is_still(moved)) unseen_.still_since = scans_.size();
  }
  scans_.push_back(std::move(scan));
  const bool stuck = !due && odometry_is_stuck();
  due = due || stuck;
  try {
    if (due) process(scans_.back(), stopped, stuck);
  } catch (const std::exception&) {
    if (steps_.size() == steps) {  // the belief does not know of the scan
      scans_.pop_back();
      points_.resize(steps);
      motion_ = before;
      unseen_ = unseen_before;
    }
    throw;
  }
  return due;
}

bool Mapper::stands(const cairn::StampedScan& next) const {
  constexpr std::size_t most = 32;  // copies: the times of some logs are all the same
  std::size_t before = scans_.size() - 1;
  while (before > 0 && scans_[before].time == next.time && scans_.size() - before < most) --before;
  if (scans_[before].time == next.time) before = scans_.size() - 1;
  const SE2 moved = scans_[before].T_odom_laser.inverse() * next.T_odom_laser;
  return moved.translation().norm() < options_.standstill;
}

bool Mapper::odometry_is_stuck() const {
  constexpr double many = 0.5;  // more than people around the robot hide and bare
  const std::size_t settled = unseen_.still_since + longest_delay;
  if (steps_.empty() || scans_.size() <= settled + 1) return false;
  const std::size_t then = std::max(settled, steps_.back().scan);
  return share_of_changed(scans_[then].scan, scans_.back().scan) > many;
}

void Mapper::begin(const cairn::LaserScan& scan) {
  travelled_.push_back(0);
  if (window_) start_ = place_in_window(scan);
  if (frozen_)
    belief_.emplace(start_->mean, *frozen_, options_.particles);
  else
    belief_.emplace(options_.start.value_or(T_odom_first_), empty_map(), options_.particles);
}

Mapper Mapper::localiser(const std::filesystem::path& path, const MapRequest& wanted,
                         const std::optional<PlaceWindow>& window) {
  MapRequest of_map = wanted;
  of_map.particles.reset();
  const Mapper saved = loaded(path, of_map);
  MapperOptions options = saved.options_;
  options.particles = wanted.particles.value_or(options.particles);
  options.loops.on = false;
  Mapper mapper(options);
  mapper.frozen_ = saved.belief()[saved.belief().best()].map;
  mapper.start_ = saved.belief().pose();
  mapper.start_->covariance +=
      Matrix<3>(Vector<3>(0.04, 0.04, 0.01).asDiagonal());  // it may have been pushed
  mapper.window_ = window;
  if (!window) return mapper;
  const PlaceWindow& w = *window;
  if (!(w.left < w.right && w.bottom < w.top) || !std::isfinite(w.right - w.left) ||
      !std::isfinite(w.top - w.bottom))
    cairn::raise("expected a window whose left is below its right, and whose bottom is below its top");
  const double widest = std::floor((cairn::ScoreGrid::most - 1) * options.cell_size - 2 * first_view);
  if (const double wide = std::max(w.right - w.left, w.top - w.bottom); wide > widest)
    cairn::raise("expected a window of no more than " + cairn::shortest(widest) +
                 " m a side, in a map of cells of " + cairn::shortest(options.cell_size) + " m; found " +
                 cairn::shortest(wide) + " m");
  bool known = false;
  const cairn::GridGeometry& geometry = mapper.frozen_->grid.geometry();
  mapper.frozen_->grid.cells().for_each_tile([&](cairn::TileAddress address, const auto& tile) {
    const cairn::CellAddress corner = cairn::corner_of(address);
    for (int i = 0; i < cairn::tile_cells; ++i) {
      const cairn::CellAddress cell{corner.column + i % cairn::tile_side, corner.row + i / cairn::tile_side};
      const double x = geometry.center_x(cell), y = geometry.center_y(cell);
      known = known || (tile[static_cast<std::size_t>(i)].known() && w.left < x && x < w.right &&
                        w.bottom < y && y < w.top);
    }
  });
  if (!known) cairn::raise("the window lies outside of the map");
  return mapper;
}

cairn::Gaussian<SE2> Mapper::place_in_window(const cairn::LaserScan& scan) {
  const double x = 0.5 * (window_->left + window_->right), y = 0.5 * (window_->bottom + window_->top);
  const double half_x = window_->right - x, half_y = window_->top - y;
  std::vector<ScanPoint> near;
  for (const ScanPoint& p : cairn::scan_points(scan))
    if (std::hypot(p.x, p.y) < first_view) near.push_back(p);
  const cairn::OccupancyGrid& grid = frozen_->grid;
  const cairn::CorrelativeSearch search(scores_around(grid, x, y, std::max(half_x, half_y) + first_view), 6);
  const auto found =
      search.find_places(cairn::thinned(near, 0.2), SE2(x, y, 0), {half_x, half_y, std::numbers::pi}, 4, {},
                         options_.loops.enough_score);
  if (found.empty()) cairn::raise("no place in the window explains the first scan");
  const Matrix<3> floor = Vector<3>(0.0025, 0.0025, 0.0004).asDiagonal();
  std::vector<cairn::Gaussian<SE2>> starts;
  std::vector<double> evidence;
  for (const cairn::CorrelativeMatch& place : found) {
    const auto result =
        cairn::match(grid, near, place.pose, place.pose, Matrix<3>::Zero(), {.model = options_.model});
    const cairn::Cholesky<3> information(result.information);
    if (result.status == cairn::MatchStatus::few_inliers || !information.good())
      starts.push_back({place.pose, 4 * floor});
    else
      starts.push_back({result.pose, information.inverse() + floor});
    evidence.push_back(options_.evidence_share * result.log_likelihood);
  }
  const double total = cairn::log_sum_exp(evidence);
  // The likeliest first, of equals the one that was found first.
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const double share = std::exp(evidence[i] - total);
    const auto next = std::ranges::upper_bound(places_, share, std::ranges::greater{}, &PossiblePlace::share);
    places_.insert(next, {starts[i].mean, share});
  }
  const auto best = static_cast<std::size_t>(std::ranges::max_element(evidence) - evidence.begin());
  return starts[best];
}

void Mapper::accumulate(const SE2& moved) {
  motion_.distance += moved.translation().norm();
  motion_.angle += std::abs(moved.angle());
}

Matrix<3> Mapper::motion_noise() const {
  if (steps_.empty() && frozen_) return start_->covariance;
  if (steps_.empty()) return Vector<3>(1e-6, 1e-6, 1e-6).asDiagonal();
  const OdometryNoise& n = options_.odometry;
  const double d = motion_.distance, a = motion_.angle;
  const double along = n.offset + n.per_metre * d + n.per_radian * a;
  // A way without scans (a hole in the log) is as many turns as it would have been steps, each with an error
  // of its own; were it one error that grows with the way, 12 m would leave the heading open by 35 degrees.
  // (A quick turn between two scans is one turn: counted as several it cost ACES a relation of 1 m.)
  const double steps = std::max(1.0, d / (2 * options_.step_distance));
  const double turn = n.angle_offset + n.angle_per_metre * d / steps + n.angle_per_radian * a / steps;
  return Vector<3>(along * along, along * along, steps * turn * turn).asDiagonal();
}

cairn::Gaussian<SE2> Mapper::motion_step(bool forwards) const {
  const auto moved = [&](double delay) {
    return delayed_motion(scans_, steps_.back().scan, scans_.size() - 1, delay, forwards);
  };
  const double delay = delay_.mean(), most = delay + delay_.spread(),
               least = std::max(0.0, delay - delay_.spread());
  const double open =
      cairn::SO2(moved(most).angle() - moved(least).angle()).angle() * (delay_.spread() / (most - least));
  // The way is odometry's own: where it starts and stops, a delay moves it by less than its noise.
  const SE2 way = moved(0);
  Matrix<3> covariance = motion_noise();
  covariance(2, 2) += open * open;
  return {SE2(way.x(), way.y(), moved(delay).angle()), covariance};
}

void Mapper::learn_delay(const Matrix<3>& noise) {
  const auto& newest = belief_->newest(belief_->best());
  const double seen = newest.drawn_from.covariance(2, 2);
  if (seen > 0.25 * noise(2, 2)) return;  // the scan did not say how far the robot turned
  const SE2 moved = newest.before.inverse() * newest.drawn_from.mean;
  delay_.learn(scans_, steps_.back().scan, scans_.size() - 1, moved.angle(), std::sqrt(noise(2, 2) + seen));
}

void Mapper::process(const cairn::StampedScan& scan, bool stopped, bool stuck) {
  const std::size_t index = scans_.size() - 1;
  const bool first = steps_.empty();
  const Matrix<3> noise = motion_noise();
  const std::array<cairn::Gaussian<SE2>, 2> ways =
      first ? std::array<cairn::Gaussian<SE2>, 2>{} : std::array{motion_step(true), motion_step(false)};
  // Where odometry does not see the robot move, it may be anywhere within reach; it is also when it moves on.
  const bool unseen = stuck || unseen_.newest;
  const bool may_turn_back = motion_.stood && motion_.distance > 2 * options_.standstill;
  const double far = options_.slip_distance, round = options_.slip_angle;
  const Matrix<3> slipped = Vector<3>(far * far, far * far, round * round).asDiagonal();
  const auto motion = [&](const SE2& x, std::size_t regime) {
    cairn::RegimeMotion<SE2> result;
    if (first) return cairn::RegimeMotion<SE2>{{{regime, 1, {x, noise}}}};
    const auto mode = [&](std::size_t way, double share) {
      result.modes.push_back({way, share, {x * ways[way].mean, ways[way].covariance}});
    };
    const double turn = may_turn_back ? options_.turn_back : options_.turn_unseen;
    if (unseen) {
      mode(regime, 1);
      result.modes.back().motion.covariance += slipped;
      return result;
    }
    mode(regime, 1 - turn - options_.slip);
    mode(1 - regime, turn);
    mode(regime, options_.slip);
    result.modes.back().motion.covariance += slipped;
    return result;
  };
  points_.push_back(cairn::scan_points(scan.scan));
  FromMatch proposal;
  proposal.widened = options_.widened;
  proposal.draws = options_.draws;
  proposal.evidence_share = options_.evidence_share;
  const cairn::ConditionalFilter filter{.resample_below = options_.resample_below,
                                        .evidence_share = options_.evidence_share,
                                        .insert = !frozen_.has_value(),
                                        .seed = options_.seed,
                                        .threads = options_.threads};
  std::atomic<bool> all_have_room = true;
  const auto with_room = [&](const OccupancyMap& map, const cairn::RegimeMotion<SE2>& moved,
                             const OccupancyMap::Observation& z, cairn::Random& random) {
    cairn::Proposed<SE2> proposed = proposal(map, moved, z, random);
    if (!frozen_ && !map.has_room_for(proposed.pose, z)) {
      forbid(proposed);
      all_have_room = false;
    }
    return proposed;
  };
  const cairn::MappingStep step = filter.step(*belief_, motion, with_room, points_.back());
  if (!step.accepted()) refuse_step(step.status, all_have_room, options_.cell_size);
  if (!first && !unseen) learn_delay(noise);
  unseen_.newest = stuck;
  unseen_.steps += stuck ? 1 : 0;
  travelled_.push_back(travelled_.back() + motion_.distance);
  steps_.push_back({index, step.effective_size, step.resampled, false, belief_->pose()});
  const bool still_open = motion_.stood && !may_turn_back;  // it has only turned since it stood
  motion_ = Motion{};
  motion_.stood = stopped || still_open;
  if (options_.loops.on) look_for_loop();
}

void Mapper::look_for_loop() {
  const LoopOptions& options = options_.loops;
  const double before = looked_, now = travelled_.back();
  if (now - before < options.check_every) return;
  looked_ = now;
  const auto path = belief_->path(belief_->best());
  const std::vector<SE2> poses = poses_on(path);
  const ChainCovariance uncertain(drawn_steps(path));
  std::optional<Look> part;
  for (const std::size_t near : old_places(poses, uncertain)) {
    const LoopWindow window = loop_window(uncertain.between(near, poses.size() - 1));
    // A wide look costs more, and one of them is enough to make the next ones narrow.
    if (!(std::floor(now / window.every) > std::floor(before / window.every))) continue;
    const std::optional<Look> look = looked_at(poses, uncertain, near, window);
    if (!look) continue;
    if (look->whole) return take_loop(*look);
    if (!part) part = look;
  }
  if (part) take_loop(*part);
}

std::optional<Mapper::Look> Mapper::looked_at(const std::vector<SE2>& poses, const ChainCovariance& uncertain,
                                              std::size_t near, const LoopWindow& window) const {
  const auto found = measured_loop(poses, near, window);
  if (!found) return std::nullopt;
  const Loop& loop = found->loop;
  const SE2 seen = poses[loop.first].inverse() * poses[loop.last];
  const Vector<3> error = cairn::local(seen, loop.T_first_last);
  const cairn::Cholesky<3> root(Matrix<3>(uncertain.between(loop.first, loop.last) + loop.covariance));
  if (!root.good() || root.whiten(error).squaredNorm() > options_.loops.gate) return std::nullopt;
  const double enough = options_.loops.enough_inliers;
  const bool far_off = error.head<2>().norm() > options_.loops.bridged;
  const bool whole = found->inliers >= enough && (far_off || found->matched >= enough);
  if (!whole && !far_off) return std::nullopt;
  return Look{loop, whole, error, window.every};
}

Mapper::LoopWindow Mapper::loop_window(const Matrix<3>& covariance) const {
  const LoopOptions& options = options_.loops;
  const double reach = std::clamp(3 * std::sqrt(covariance(0, 0) + covariance(1, 1)), 0.3, options.reach);
  const double turn = std::clamp(3 * std::sqrt(covariance(2, 2)), 0.05, 0.35);
  return {reach, turn, std::max(options.check_every, options.check_share * reach)};
}

void Mapper::take_loop(const Look& look) {
  const LoopOptions& options = options_.loops;
  const bool far = look.error.head<2>().norm() > options.moved || std::abs(look.error(2)) > options.turned;
  if (far) {
    if (!believed(look)) return;
  } else if (!loops_.empty() && travelled_.back() - travelled_[loops_.back().last] < options.spacing) {
    return;
  }
  loops_.push_back(look.loop);
  if (far) move_paths();
}

/// One look may be deceived by places that look alike. Two that ask for the same are believed; where they
/// explain but a part, those of so long a path that the last has no scan of the first.
bool Mapper::believed(const Look& look) {
  const double now = travelled_.back();
  const bool again =
      asked_ && now - asked_->at < 2.5 * look.every &&
      (look.error - asked_->error).head<2>().norm() < 0.1 + 0.2 * look.error.head<2>().norm() &&
      std::abs(look.error(2) - asked_->error(2)) < 0.03;
  const bool enough = again && ((look.whole && asked_->whole) || now - asked_->since >= options_.loops.query);
  asked_ = Asked{look.error, now, again ? asked_->since : now, look.whole};
  if (enough) asked_.reset();
  return enough;
}

std::vector<std::size_t> Mapper::old_places(const std::vector<SE2>& poses,
                                            const ChainCovariance& uncertain) const {
  const LoopOptions& options = options_.loops;
  struct Place {
    std::size_t pose;
    double distance;
  };
  std::vector<Place> places;  // the nearest pose of each visit
  double left = -options.apart;
  for (std::size_t k = 1; k < poses.size() && travelled_.back() - travelled_[k] >= options.apart; ++k) {
    const double distance = (poses[k].translation() - poses.back().translation()).norm();
    if (distance > options.reach) continue;
    if (places.empty() || travelled_[k] - left > 0.5 * options.apart)
      places.push_back({k, distance});
    else if (distance < places.back().distance)
      places.back() = {k, distance};
    left = travelled_[k];
  }
  std::vector<std::size_t> near;
  for (const bool in_sight : {true, false})  // those first, then the oldest: they tell most
    for (const Place& place : places) {
      if ((place.distance <= 0.5 * options.view) != in_sight || near.size() == options.places) continue;
      const Matrix<3> covariance = uncertain.between(place.pose, poses.size() - 1);
      if (place.distance < 2 + 3 * std::sqrt(covariance(0, 0) + covariance(1, 1))) near.push_back(place.pose);
    }
  return near;
}

std::optional<Mapper::MeasuredLoop> Mapper::measured_loop(const std::vector<SE2>& poses, std::size_t near,
                                                          const LoopWindow& window) const {
  const LoopOptions& options = options_.loops;
  const auto by_path = [&](double at) {
    return static_cast<std::size_t>(std::ranges::lower_bound(travelled_, at) - travelled_.begin());
  };
  // As far as scans see, what stands around `near` is seen from the window; beyond, the way there has to be.
  const double submap = options.submap + std::max(0.0, window.reach - 0.5 * options.view);
  const std::size_t begin = std::max<std::size_t>(1, by_path(travelled_[near] - submap));
  const std::size_t end = std::max(
      near + 1, std::min(by_path(travelled_[near] + submap), by_path(travelled_.back() - options.apart)));
  const double cell = std::max(options_.cell_size, options.least_cell);
  cairn::OccupancyGrid grid({{cell, 0, 0}, options_.field_radius});
  for (std::size_t i = begin; i < end; ++i) grid.insert(poses[i], points_[i - 1]);
  const std::size_t last = poses.size() - 1;
  const std::size_t since = std::max<std::size_t>(1, by_path(travelled_[last] - options.query));
  const std::vector<ScanPoint> query = cairn::thinned(seen_together(poses, points_, since, last), 0.05);
  const SE2 now = poses[last];
  const int levels = window.reach > 0.5 * options.view ? 8 : 6;  // a wide window is worth two more to build
  const cairn::CorrelativeSearch search(scores_around(grid, now.x(), now.y(), options.view + window.reach),
                                        levels);
  std::vector<ScanPoint> seen;
  for (const ScanPoint& p : query)
    if (std::hypot(p.x, p.y) < options.view) seen.push_back(p);
  const std::vector<ScanPoint> coarse = cairn::thinned(seen, 0.25);
  const cairn::SearchWindow around{window.reach, window.reach, window.turn};
  const auto found = search.find(coarse, now, around, options.enough_score);
  if (!found) return std::nullopt;
  const cairn::MatchOptions fine{.model = options_.model};
  const auto result = cairn::match(grid, seen, found->pose, found->pose, Matrix<3>::Zero(), fine);
  const cairn::Cholesky<3> information(result.information);
  const double least = options.enough_of_many;
  if (result.inliers < least || result.matched < least || !information.good()) return std::nullopt;
  const SE2 shift = now.inverse() * found->pose;
  const bool moves = shift.translation().norm() > options.moved || std::abs(shift.angle()) > options.turned;
  // In a corridor whose doors all look alike the best place is one of many.
  if (moves &&
      search.has_look_alike(*found, coarse, now, around, {options.look_alike, 1}, options.still_alike))
    return std::nullopt;
  std::size_t first = begin;
  const auto distance = [&](std::size_t i) {
    return (poses[i].translation() - result.pose.translation()).norm();
  };
  for (std::size_t i = begin; i < end; ++i)
    if (distance(i) < distance(first)) first = i;
  const Matrix<3> floor = Vector<3>(1e-4, 1e-4, 1e-5).asDiagonal();
  return MeasuredLoop{{first, last, poses[first].inverse() * result.pose, information.inverse() + floor},
                      result.inliers,
                      result.matched};
}

void Mapper::move_paths() {
  Belief& belief = *belief_;
  cairn::Random random(options_.seed, ~steps_.size());
  const std::vector<std::size_t> first = belief.concentrate(options_.loops.survivors, random);
  std::vector<std::size_t> distinct;
  for (std::size_t i = 0; i < first.size(); ++i)
    if (first[i] == i) distinct.push_back(i);
  std::vector<std::vector<cairn::PathPose<SE2>>> paths(distinct.size());
  std::vector<OccupancyMap> maps(distinct.size(), empty_map());
  cairn::parallel_for(distinct.size(), options_.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      // Streams of the filter have the step in their upper half; these have all ones there.
      cairn::Random own(options_.seed, ~(steps_.size() * belief.size() + distinct[i] + 1));
      paths[i] = moved_by(belief.path(distinct[i]), loops_, own);
      for (std::size_t k = 0; k < points_.size(); ++k) maps[i].grid.insert(paths[i][k + 1].pose, points_[k]);
    }
  });
  for (std::size_t i = 0; i < distinct.size(); ++i)
    belief.move(distinct[i], std::move(paths[i]), std::move(maps[i]));
  for (std::size_t i = 0; i < first.size(); ++i)
    if (first[i] != i) belief.copy_path(first[i], i);
  steps_.back().moved = true;
}

std::optional<double> Mapper::explained() const {
  if (!frozen_) return std::nullopt;
  const auto path = belief().path(belief().best());
  double all = 0, near = 0;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const auto count = static_cast<double>(points_[k].size());
    near += count *
            cairn::evaluate(frozen_->grid, points_[k], path[k + 1].drawn_from.mean, frozen_->model).matched;
    all += count;
  }
  return all > 0 ? near / all : 0;
}

std::vector<cairn::StampedPose2> Mapper::trajectory(bool means) const {
  // Where no scan says anything, the means of the steps follow the poses drawn before them, which is a walk.
  if (means && std::ranges::all_of(points_, &std::vector<ScanPoint>::empty))
    return odometry_from(belief().path(belief().best()).front().pose, scans_);
  const auto path = belief().path(belief().best());
  return filled_path(
      scans_, steps_.size(), [&](std::size_t k) { return steps_[k].scan; },
      [&](std::size_t k) { return means ? path[k + 1].drawn_from.mean : path[k + 1].pose; }, delay_.mean());
}

std::vector<cairn::StampedPose2> Mapper::rematched() const {
  std::vector<cairn::StampedPose2> all = trajectory(true);
  const OccupancyMap& map = belief()[belief().best()].map;
  const Matrix<3> prior = Vector<3>(400, 400, 2500).asDiagonal();  // 5 cm, 0.02 rad: what odometry may err
  cairn::parallel_for(all.size(), options_.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto found = cairn::match(map.grid, cairn::scan_points(scans_[i].scan), all[i].pose, all[i].pose,
                                      prior, {.model = map.model});
      if (found.status != cairn::MatchStatus::few_inliers) all[i].pose = found.pose;
    }
  });
  return all;
}

}  // namespace grid_slam
