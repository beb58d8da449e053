// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "slam.hpp"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <optional>

#include "mapper.hpp"
#include "redrawing.hpp"
#include "scores.hpp"

namespace fastslam {

namespace {

using cairn::SE2;
using cairn::StampedPose2;
using cairn::Vector;

/// Weighted mean of all particles' paths, pose by pose.
std::vector<SE2> mean_path(const Belief& belief) {
  std::vector<SE2> mean = means_of(belief, belief.best());
  std::vector<cairn::Vector<3>> shift(mean.size(), cairn::Vector<3>::Zero());
  const std::vector<double> weights = belief.particles().weights();
  for (std::size_t i = 0; i < belief.size(); ++i) {
    const std::vector<SE2> path = means_of(belief, i);
    for (std::size_t k = 0; k < mean.size(); ++k) shift[k] += weights[i] * cairn::local(mean[k], path[k]);
  }
  for (std::size_t k = 0; k < mean.size(); ++k) mean[k] = cairn::retract(mean[k], shift[k]);
  return mean;
}

std::vector<FoundLandmark> landmarks_of(const Map& map) {
  std::vector<FoundLandmark> found;
  map.for_each([&](std::uint32_t number, const auto& landmark) {
    found.push_back({number, landmark.belief, landmark.sightings, landmark.log_odds});
  });
  return found;
}

/// Every so-manieth place of a particle's path, from the newest back.
std::vector<Vector<2>> thinned_path(const Belief& belief, std::size_t particle) {
  const auto path = belief.path(particle);
  const std::size_t every = path.size() / 150 + 1;
  std::vector<Vector<2>> places;
  for (std::size_t back = 0; back < path.size(); back += every)
    places.push_back(path[path.size() - 1 - back].pose.translation());
  return places;
}

Snapshot snapshot_of(const Belief& belief, double time) {
  constexpr std::size_t most_paths = 12;
  Snapshot s{time, {thinned_path(belief, belief.best())}, landmarks_of(belief[belief.best()].map)};
  for (std::size_t i = 1; i < belief.size() && s.paths.size() < most_paths; ++i)
    if (belief[i].node != belief[i - 1].node) s.paths.push_back(thinned_path(belief, i));
  return s;
}

}  // namespace

std::vector<StampedPose2> filled(const LandmarkLog& log, const std::vector<SE2>& poses) {
  std::vector<StampedPose2> all;
  std::size_t next = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    all.push_back({log.frames[k].time, poses[k]});
    for (; next < log.between.size() && log.between[next].frame == k; ++next) {
      const Between& b = log.between[next];
      SE2 pose = poses[k] * b.moved;
      if (k + 1 < poses.size()) {
        const double share = (b.time - log.frames[k].time) / (log.frames[k + 1].time - log.frames[k].time);
        const Vector<3> gap = cairn::local(poses[k] * log.frames[k + 1].moved.mean, poses[k + 1]);
        pose = cairn::retract(pose, Vector<3>(share * gap));
      }
      all.push_back({b.time, pose});
    }
  }
  return all;
}

Results run(Mapper& mapper, const OnFrame& on_frame) {
  const LandmarkLog& log = mapper.log();
  const SlamOptions& options = mapper.options();
  Results r{.name = log.name,
            .seed = options.seed,
            .particles = options.particles,
            .threads = options.threads,
            .proposal = options.proposal,
            .identities_known = log.has_identities(log.frames.size()),
            .notes = log.notes};
  for (const auto& [id, place] : log.landmarks) r.true_landmarks.push_back(place);
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  const std::size_t every = std::max<std::size_t>(1, log.frames.size() / 40);
  std::optional<Mapper> finished;  // at the log's end: the path and map that are handed over
  while (mapper.has_next() && !r.ended_early) {
    mapper.step();
    if (!mapper.has_next()) finished.emplace(mapper).finish();
    if (on_frame) r.ended_early = on_frame();
    // The last is what is handed over: the film ends with it.
    if (mapper.steps().size() % every == 0 || finished || r.ended_early)
      r.snapshots.push_back(
          snapshot_of((finished ? *finished : mapper).belief(), mapper.steps().back().time));
  }
  r.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  r.cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  const Mapper& end = finished ? *finished : mapper;
  const Belief& belief = end.belief();
  if (end.doubted() > 0)
    r.notes.push_back(std::to_string(end.doubted()) +
                      (end.doubted() == 1 ? " sighting is" : " sightings are") +
                      " not of what the name says: left out");
  if (!end.redraws())
    r.notes.push_back(
        "paths are never drawn again: the covariance of the pose is how far the particles that are left "
        "differ, and too sure");
  else if (options.particles < least_particles_of_a_spread)
    r.notes.push_back("a covariance of the pose by fewer than " +
                      std::to_string(least_particles_of_a_spread) +
                      " particles is too sure: expected more as --particles");
  r.steps = end.steps();
  std::vector<SE2> odometry;
  for (std::size_t k = 0; k < r.steps.size(); ++k) {
    const SE2& moved = log.frames[k].moved.mean;
    odometry.push_back(odometry.empty() ? moved : odometry.back() * moved);
  }
  r.odometry = filled(log, odometry);
  r.best = filled(log, means_of(belief, belief.best()));
  r.mean = filled(log, mean_path(belief));
  r.landmarks = landmarks_of(belief[belief.best()].map);
  r.node_copies = belief[belief.best()].map.node_copies();
  measure(r, log);
  return r;
}

Results run(const LandmarkLog& log, const SlamOptions& options, const OnFrame& on_frame) {
  Mapper mapper(log, options);
  return run(mapper, on_frame);
}

}  // namespace fastslam
