// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "run.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <exception>

#include <cairn/io/text.hpp>
#include <cairn/scan/scan.hpp>

#include "filled_path.hpp"

namespace grid_slam {

void measure(Results& r, const std::vector<cairn::PoseRelation>& relations) {
  if (relations.empty()) return;
  r.of_odometry = cairn::relation_error(r.odometry, relations);
  r.of_drawn = cairn::relation_error(r.drawn, relations);
  r.of_means = cairn::relation_error(r.means, relations);
  r.of_rematched = cairn::relation_error(r.rematched, relations);
  const std::size_t missing = r.of_means->missing;
  if (missing == relations.size())
    r.notes.push_back("none of the " + std::to_string(missing) +
                      " relations has poses of the path at both of its times: are they of this log?");
  else if (missing > 0)
    r.notes.push_back(std::to_string(missing) + " of " + std::to_string(relations.size()) +
                      " relations have no pose of the path at one of their times");
}

void end_of_data(Results& r, const cairn::CarmenLog& log, std::size_t next, const std::string& why) {
  r.data_ended = true;
  const cairn::StampedScan& scan = log.scans[next];
  std::string where = "scan " + std::to_string(next + 1) + " (";
  if (scan.line > 0) where += "line " + std::to_string(scan.line) + ", ";
  where += "time " + cairn::shortest(scan.time);
  if (next > 0)
    where += ", by odometry " +
             cairn::shortest(std::round(
                 (scan.T_odom_laser.translation() - log.scans[next - 1].T_odom_laser.translation()).norm())) +
             " m from the one before";
  r.ended_early = "ended after " + std::to_string(next) + " of " + std::to_string(log.scans.size()) +
                  " scans: " + where + "): " + why;
}

void add_notes(Results& r, const std::vector<cairn::StampedScan>& scans) {
  if (!r.map.has_picture()) r.notes.push_back(why_no_picture(r.map));
  if (std::ranges::all_of(scans, [](const auto& each) { return cairn::scan_points(each.scan).empty(); }))
    r.notes.emplace_back("no scan has a beam that came back: the map is empty, and the path is odometry's");
}

Results run(Mapper& mapper, const cairn::CarmenLog& log, const std::vector<cairn::PoseRelation>& relations,
            const std::function<std::optional<std::string>()>& on_scan, std::size_t frames) {
  Results r;
  r.seed = mapper.options().seed;
  r.particles = mapper.options().particles;
  r.threads = mapper.options().threads;
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  const std::size_t count = log.scans.size();
  const std::size_t begun = mapper.scans().size();
  for (std::size_t i = 0; i < count; ++i) {
    try {
      mapper.add(log.scans[i]);
    } catch (const std::exception& error) {
      if (mapper.scans().size() == begun) throw;
      end_of_data(r, log, i, error.what());
      break;
    }
    if (on_scan) r.ended_early = on_scan();
    if (r.ended_early) break;
    if (is_film_frame(i, count, frames)) r.snapshots.push_back(snapshot_of(mapper));
  }
  if (frames > 0 && !mapper.scans().empty()) r.snapshots.push_back(snapshot_of(mapper));
  r.scans = mapper.scans().size();
  r.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  r.cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  r.steps = mapper.steps();
  r.loops = mapper.loops();
  r.places = mapper.places();
  r.drawn = mapper.trajectory(false);
  r.odometry = odometry_from(r.drawn.front().pose, mapper.scans());
  r.means = mapper.trajectory(true);
  r.rematched = mapper.rematched();
  for (const auto& pose : mapper.belief().path(mapper.belief().best()))
    if (pose.step > 0) r.drawn_from.push_back(pose.drawn_from);
  r.newest = mapper.newest();
  r.newest_has_path = !mapper.localises();
  r.delay = mapper.delay().mean();
  r.delay_spread = mapper.delay().spread();
  r.map = map_image(mapper.belief()[mapper.belief().best()].map.grid);
  r.bytes = map_bytes(mapper.belief());
  for (std::size_t i = 0; i < mapper.belief().size(); ++i) {
    if (i > 0 && mapper.belief()[i].node == mapper.belief()[i - 1].node) continue;  // the same path
    auto& path = r.paths.emplace_back();
    for (const auto& pose : mapper.belief().path(i)) path.push_back(pose.pose);
  }
  measure(r, relations);
  add_notes(r, mapper.scans());
  constexpr double enough = 0.5;  // of the points; moved furniture and people take a fifth or so away
  if (const std::optional<double> explained = mapper.explained(); explained && *explained < enough)
    r.notes.push_back(
        "the map explains no more than " + cairn::shortest(std::round(100 * *explained)) +
        " % of the scans' points: the robot is elsewhere, or began elsewhere (--window looks for the "
        "place where it began)");
  if (const std::size_t unseen = mapper.steps_unseen(); unseen > 0)
    r.notes.push_back("scans moved on where odometry stood, " + std::to_string(unseen) +
                      " times: these steps are by scans alone");
  return r;
}

Results run(const cairn::CarmenLog& log, const MapperOptions& options,
            const std::vector<cairn::PoseRelation>& relations,
            const std::function<std::optional<std::string>()>& on_scan) {
  Mapper mapper(options);
  return run(mapper, log, relations, on_scan);
}

}  // namespace grid_slam
