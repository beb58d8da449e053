// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "scan_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>

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

}  // namespace

std::optional<double> reading_of_no_return(const std::vector<StampedScan>& scans) {
  constexpr double apart = 0.3;       // [m]: a wall's range has changed by then
  constexpr std::size_t least = 10;   // scans
  constexpr std::size_t one_of = 20;  // of the scans that are looked at, or more
  float largest = 0;
  for (const StampedScan& each : scans)
    for (std::size_t i = 0; i < each.scan.size(); ++i)
      if (each.scan.kind(i) == BeamKind::hit) largest = std::max(largest, each.scan.range[i]);
  const std::vector<std::size_t> looked_at = scans_apart(scans, apart);
  const auto with_it = static_cast<std::size_t>(std::ranges::count_if(looked_at, [&](std::size_t k) {
    return std::ranges::find(scans[k].scan.range, largest) != scans[k].scan.range.end();
  }));
  if (with_it < least || with_it * one_of < looked_at.size()) return std::nullopt;
  return static_cast<double>(largest);
}

bool turns_against_odometry(const std::vector<StampedScan>& scans) {
  constexpr double least_turn = 0.1, most_turn = 0.5;  // [rad]: more than beams apart, and scans overlap
  constexpr double on_the_spot = 0.15;                 // [m]
  constexpr double least = 20, nearly_all = 0.9, far_better = 0.6;
  double turns = 0, against = 0, cost = 0, cost_against = 0;
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
    const double beams = std::round(moved.angle() / after.angle_step);
    if (!(std::abs(beams) >= 2 && std::abs(beams) < 0.5 * static_cast<double>(after.size()))) continue;
    const auto shift = static_cast<std::ptrdiff_t>(beams);
    const double with = mean_difference(before, after, shift), other = mean_difference(before, after, -shift);
    turns += 1;
    against += other < with ? 1 : 0;
    cost += with;
    cost_against += other;
  }
  return turns >= least && against >= nearly_all * turns && cost_against < far_better * cost;
}

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
  double beams = 0, hits = 0;
  for (const StampedScan& each : log.scans)
    for (std::size_t i = 0; i < each.scan.size(); ++i) {
      beams += 1;
      hits += each.scan.kind(i) == BeamKind::hit ? 1 : 0;
    }
  constexpr double few = 0.1;
  if (hits > 0 && hits < few * beams)
    notes.push_back("no more than " + cairn::shortest(std::ceil(1000 * hits / beams) / 10) +
                    " % of the beams have a range that counts as a return: are the ranges metres?");
  if (turns_against_odometry(log.scans))
    cairn::raise(name +
                 ": expected beams that run counter-clockwise, as odometry's headings do; scans turn "
                 "against odometry (reverse the order of the ranges, or the sign of the headings)");
  return notes;
}

}  // namespace grid_slam
