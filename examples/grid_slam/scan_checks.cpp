// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "scan_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/io/text.hpp>
#include <cairn/manifold/so2.hpp>

namespace grid_slam {

namespace {

using cairn::BeamKind;
using cairn::LaserScan;
using cairn::StampedScan;

/// Indices of scans that the robot took at so many metres from the one before.
std::vector<std::size_t> scans_apart(const std::vector<StampedScan>& scans, double metres) {
  std::vector<std::size_t> apart;
  for (std::size_t i = 0; i < scans.size(); ++i)
    if (apart.empty() ||
        (scans[i].T_odom_laser.translation() - scans[apart.back()].T_odom_laser.translation()).norm() >=
            metres)
      apart.push_back(i);
  return apart;
}

double mean_difference(const LaserScan& before, const LaserScan& after, std::ptrdiff_t shift) {
  constexpr double most = 1;  // [m]: another object
  const auto size = static_cast<std::ptrdiff_t>(after.size());
  double sum = 0, count = 0;
  for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, -shift); i < std::min(size, size - shift); ++i) {
    const auto now = static_cast<std::size_t>(i), then = static_cast<std::size_t>(i + shift);
    if (after.kind(now) != BeamKind::hit || before.kind(then) != BeamKind::hit) continue;
    sum += std::min(
        most, std::abs(static_cast<double>(after.range[now]) - static_cast<double>(before.range[then])));
    count += 1;
  }
  return count > 0 ? sum / count : most;
}

/// Two scans between which the robot turned almost on the spot.
struct Turn {
  const LaserScan *before, *after;
  double beams;  ///< by odometry and the scans' angles
};

std::vector<Turn> turns_on_the_spot(const std::vector<StampedScan>& scans) {
  constexpr double least_turn = 0.1, most_turn = 0.5;  // [rad]: more than beams apart, and scans overlap
  constexpr double on_the_spot = 0.15;                 // [m]
  std::vector<Turn> turns;
  std::size_t first = 0;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    const cairn::SE2 moved = scans[first].T_odom_laser.inverse() * scans[i].T_odom_laser;
    const double turn = std::abs(moved.angle());
    if (turn < least_turn && moved.translation().norm() < on_the_spot) continue;
    const LaserScan &before = scans[first].scan, &after = scans[i].scan;
    first = i;
    if (turn < least_turn || turn > most_turn || moved.translation().norm() > on_the_spot) continue;
    if (before.size() != after.size() || before.angle_step != after.angle_step || after.angle_step == 0)
      continue;
    const double beams = moved.angle() / after.angle_step;
    if (std::abs(beams) >= 1.5 && std::abs(beams) < 0.5 * static_cast<double>(after.size()))
      turns.push_back({&before, &after, beams});
  }
  return turns;
}

/// How surely scans have to turn otherwise than odometry says.
struct Sureness {
  std::size_t turns;   // at least
  double share, cost;  // of the turns in which they differ less, at least; of all differences, less than
};
constexpr Sureness nothing_comes_of_it{20, 0.9, 0.6};

/// What the scans differ by if they turn by shift(beams), where that is less than by as many as odometry
/// says.
template <class Shift>
std::optional<double> better(const std::vector<Turn>& turns, const Sureness& sure, const Shift& shift) {
  double less = 0, cost = 0, other_cost = 0;
  for (const Turn& turn : turns) {
    const auto by = [&](double beams) {
      return mean_difference(*turn.before, *turn.after, static_cast<std::ptrdiff_t>(std::round(beams)));
    };
    const double with = by(turn.beams), other = by(shift(turn.beams));
    less += other < with ? 1 : 0;
    cost += with;
    other_cost += other;
  }
  const bool is_better = turns.size() >= sure.turns &&
                         less >= sure.share * static_cast<double>(turns.size()) &&
                         other_cost < sure.cost * cost;
  return is_better ? std::optional(other_cost) : std::nullopt;
}

/// Scans just before and after that see the same place from elsewhere or at another time, one of each at
/// most: as far as odometry knows the step, and no copies.
std::vector<std::size_t> scans_near(const std::vector<StampedScan>& scans, std::size_t k) {
  constexpr std::size_t farthest = 6;
  constexpr double most_turn = 0.05, most_way = 0.5;  // [rad], [m]
  std::vector<std::size_t> near;
  for (const bool before : {true, false})
    for (std::size_t d = 1; d <= farthest; ++d) {
      if (before ? d > k : k + d >= scans.size()) break;
      const std::size_t other = before ? k - d : k + d;
      const cairn::SE2 moved = scans[k].T_odom_laser.inverse() * scans[other].T_odom_laser;
      if (std::abs(moved.angle()) > most_turn || moved.translation().norm() > most_way) break;
      if (scans[other].scan.range == scans[k].scan.range) continue;
      near.push_back(other);
      break;
    }
  return near;
}

/// Whether a beam ends near a point, given by its range [m] and angle: by as much as a wall's points are
/// apart there, and more.
bool ends_near(const LaserScan& scan, std::size_t beam, double range, double angle) {
  if (scan.kind(beam) != BeamKind::hit) return false;
  const auto r = static_cast<double>(scan.range[beam]);
  const double along = r - range, across = std::sqrt(r * range) * (scan.angle(beam) - angle);
  return std::hypot(along, across) < 0.1 + 2 * std::abs(scan.angle_step) * range;
}

bool has_point(const LaserScan& scan, const cairn::Vector<2>& p) {
  if (scan.angle_step == 0) return false;
  // From the first beam on, the way that beams go: a scan may see all around.
  const double whole = scan.angle_step > 0 ? 2 * std::numbers::pi : -2 * std::numbers::pi;
  double turn = cairn::SO2(std::atan2(p(1), p(0)) - scan.first_angle).angle();
  if (turn / scan.angle_step < -2) turn += whole;
  const double beam = std::round(turn / scan.angle_step);
  for (const double next : {beam, beam - 1, beam + 1, beam - 2, beam + 2}) {
    if (!(next >= 0 && next < static_cast<double>(scan.size()))) continue;
    const auto i = static_cast<std::size_t>(next);
    if (ends_near(scan, i, p.norm(), scan.first_angle + turn)) return true;
  }
  return false;
}

}  // namespace

std::optional<double> reading_of_no_return(const std::vector<StampedScan>& scans) {
  constexpr double apart = 0.3;       // [m]: a wall's range has changed by then
  constexpr std::size_t least = 10;   // scans
  constexpr std::size_t one_of = 20;  // of the scans that are looked at, or more
  float largest = 0;
  for (const StampedScan& each : scans)
    for (std::size_t i = 0; i < each.scan.size(); ++i)
      if (each.scan.kind(i) == BeamKind::hit) largest = std::max(largest, each.scan.range[i]);
  if (!(largest > 0)) return std::nullopt;  // no hit, so there is nothing that is taken for one
  const std::vector<std::size_t> looked_at = scans_apart(scans, apart);
  const auto with_it = static_cast<std::size_t>(std::ranges::count_if(looked_at, [&](std::size_t k) {
    return std::ranges::find(scans[k].scan.range, largest) != scans[k].scan.range.end();
  }));
  if (with_it < least || with_it * one_of < looked_at.size()) return std::nullopt;
  return static_cast<double>(largest);
}

ScanTurns scan_turns(const std::vector<StampedScan>& scans) {
  const std::vector<Turn> turns = turns_on_the_spot(scans);
  if (better(turns, nothing_comes_of_it, [](double beams) { return -beams; })) return ScanTurns::against;
  if (better(turns, nothing_comes_of_it, [](double) { return 0.0; })) return ScanTurns::not_at_all;
  return ScanTurns::as_said;
}

std::optional<double> other_field_of_view(const std::vector<StampedScan>& scans) {
  constexpr double half_turn = std::numbers::pi;
  const bool all_half = std::ranges::all_of(scans, [](const StampedScan& each) {
    const double seen = static_cast<double>(each.scan.size()) * each.scan.angle_step;
    // Of 180 or 181 beams they are SICK's: what does not fit then is a robot that turns less than its wheels
    // say.
    return each.scan.size() > 181 && std::abs(each.scan.first_angle + half_turn / 2) < 1e-6 &&
           std::abs(seen - half_turn) < 1.5 * each.scan.angle_step;
  });
  if (!all_half) return std::nullopt;
  const std::vector<Turn> turns = turns_on_the_spot(scans);
  // Of ACES, Intel, FR079 and CSAIL, read as if they saw more or less than half a turn, the right one has
  // 0.49 to 0.87 of the differences, in 0.70 to 0.98 of the turns less; wrong ones of what is right have 1.1
  // to 2.5 of them, in at most 0.36 of the turns less.
  constexpr Sureness clear{40, 0.6, 0.93};
  std::optional<double> best;
  double least = std::numeric_limits<double>::infinity();
  for (const double view : {4 * half_turn / 3, 3 * half_turn / 2, 2 * half_turn}) {
    const auto shift = [&](double beams) { return beams * half_turn / view; };
    if (const auto cost = better(turns, clear, shift); cost && *cost < least) {
      best = view;
      least = *cost;
    }
  }
  return best;
}

std::vector<std::vector<std::size_t>> unconfirmed(const std::vector<StampedScan>& scans) {
  std::vector<std::vector<std::size_t>> all(scans.size());
  for (std::size_t k = 0; k < scans.size(); ++k) {
    const LaserScan& scan = scans[k].scan;
    const std::vector<std::size_t> others = scans_near(scans, k);
    if (others.empty()) continue;
    for (std::size_t i = 0; i < scan.size(); ++i) {
      if (scan.kind(i) != BeamKind::hit) continue;
      const auto r = static_cast<double>(scan.range[i]);
      const auto beside = [&](std::size_t beam) {
        return beam < scan.size() && ends_near(scan, beam, r, scan.angle(i));
      };
      if (beside(i - 1) || beside(i + 1)) continue;
      const cairn::Vector<2> p(r * std::cos(scan.angle(i)), r * std::sin(scan.angle(i)));
      const bool seen = std::ranges::any_of(others, [&](std::size_t other) {
        return has_point(scans[other].scan,
                         scans[other].T_odom_laser.inverse() * (scans[k].T_odom_laser * p));
      });
      if (!seen) all[k].push_back(i);
    }
  }
  return all;
}

namespace {

/// Beams spread over so wide a field of view, around what is ahead.
void see(LaserScan& scan, double view) {
  const auto n = static_cast<double>(scan.size());
  scan.first_angle = -view / 2;
  scan.angle_step = view / (scan.size() % 2 == 1 ? std::max(1.0, n - 1) : std::max(1.0, n));
}

/// Readings that nothing confirms are taken for none, where there are too many of them for what moves about
/// and for thin things.
std::optional<std::string> without_unconfirmed(cairn::CarmenLog& log) {
  constexpr double many = 0.03;
  const auto alone = unconfirmed(log.scans);
  double count = 0, hits = 0;
  for (std::size_t k = 0; k < log.scans.size(); ++k) {
    count += static_cast<double>(alone[k].size());
    for (std::size_t i = 0; i < log.scans[k].scan.size(); ++i)
      hits += log.scans[k].scan.kind(i) == BeamKind::hit ? 1 : 0;
  }
  if (!(count > many * hits)) return std::nullopt;
  for (std::size_t k = 0; k < log.scans.size(); ++k)
    for (const std::size_t beam : alone[k]) log.scans[k].scan.range[beam] = 0;
  return cairn::shortest(std::round(100 * count / hits)) +
         " % of the readings are met in no beam beside and in no scan before or after (dust, rain, "
         "a sensor's errors): they are left out";
}

}  // namespace

std::vector<std::string> check_scans(cairn::CarmenLog& log, const std::string& name) {
  std::vector<std::string> notes;
  // Some scanners have several such readings, which say what went wrong (SICK: 8.191, 8.187, 8.183 m).
  constexpr int readings = 3;
  constexpr double together = 0.97;
  std::optional<double> largest;
  for (int k = 0; k < readings; ++k) {
    const std::optional<double> next = reading_of_no_return(log.scans);
    if (!next || (largest && *next < together * *largest)) break;
    if (!largest) largest = next;
    for (StampedScan& each : log.scans) each.scan.farthest = std::min(each.scan.farthest, *next);
    notes = {"readings of " + cairn::shortest(static_cast<float>(*next)) +
             " m and more, the log's largest, are met all along the way: they are taken for no return"};
  }
  double beams = 0, hits = 0, invalid = 0;
  for (const StampedScan& each : log.scans)
    for (std::size_t i = 0; i < each.scan.size(); ++i) {
      beams += 1;
      hits += each.scan.kind(i) == BeamKind::hit ? 1 : 0;
      invalid += each.scan.kind(i) == BeamKind::invalid ? 1 : 0;
    }
  if (invalid == beams)
    notes.push_back("no reading is as much as " + cairn::shortest(log.scans.front().scan.nearest) +
                    " m: all are invalid, and nothing is known of any beam");
  constexpr double few = 0.1;
  const bool strange = hits > 0 && hits < few * beams;
  if (strange)
    notes.push_back("no more than " + cairn::shortest(std::ceil(1000 * hits / beams) / 10) +
                    " % of the beams have a range that counts as a return: are the ranges metres?");
  switch (scan_turns(log.scans)) {
    case ScanTurns::as_said:
      break;
    case ScanTurns::against:
      cairn::raise(name +
                   ": expected beams that run counter-clockwise, as odometry's headings do; scans turn "
                   "against odometry (reverse the order of the ranges, or the sign of the headings)");
    case ScanTurns::not_at_all:
      cairn::raise(name +
                   ": expected headings in radians; scans do not turn where odometry does (multiply "
                   "headings in degrees by pi / 180)");
  }
  if (const std::optional<double> view = other_field_of_view(log.scans)) {
    for (StampedScan& each : log.scans) see(each.scan, *view);
    notes.push_back(
        "scans turn as odometry does if they see " +
        cairn::shortest(std::round(*view * 180 / std::numbers::pi)) +
        " degrees, which is what they are taken for: FLASER lines do not say it, half a turn is usual");
  }
  if (const auto note = strange ? std::nullopt : without_unconfirmed(log)) notes.push_back(*note);
  return notes;
}

}  // namespace grid_slam
