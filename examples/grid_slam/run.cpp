// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "run.hpp"

#include <chrono>
#include <ctime>

#include "filled_path.hpp"

namespace grid_slam {

void measure(Results& r, const std::vector<cairn::PoseRelation>& relations) {
  if (relations.empty()) return;
  r.of_odometry = cairn::relation_error(r.odometry, relations);
  r.of_drawn = cairn::relation_error(r.drawn, relations);
  r.of_means = cairn::relation_error(r.means, relations);
  r.of_rematched = cairn::relation_error(r.rematched, relations);
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
  for (std::size_t i = 0; i < count; ++i) {
    mapper.add(log.scans[i]);
    if (on_scan) r.ended_early = on_scan();
    if (r.ended_early) break;
    if ((i + 1) * frames / count != i * frames / count && i + 1 < count)
      r.snapshots.push_back(snapshot_of(mapper));
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
  r.newest = mapper.newest();
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
  return r;
}

Results run(const cairn::CarmenLog& log, const MapperOptions& options,
            const std::vector<cairn::PoseRelation>& relations,
            const std::function<std::optional<std::string>()>& on_scan) {
  Mapper mapper(options);
  return run(mapper, log, relations, on_scan);
}

}  // namespace grid_slam
