// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "run.hpp"

#include <chrono>
#include <cmath>
#include <ctime>
#include <set>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/conditional.hpp>

#include "batch.hpp"

namespace line_slam {

namespace {

using cairn::SE3;
using cairn::Vector;

/// Seen three times, and known across itself wherever it was seen first.
bool is_believed(const cairn::MappedLandmark<MappedLine>& landmark) {
  constexpr std::uint32_t sightings = 3;
  constexpr double sigma = 0.2;  // [m]
  const auto& [mean, covariance] = landmark.belief;
  return landmark.sightings >= sightings && mean.line.sigma_across(0, covariance) < sigma &&
         mean.line.sigma_across(1, covariance) < sigma;
}

void judge(MadeMap& made, const Map& map, const Drive& drive) {
  std::set<std::uint32_t> edges;
  double sum = 0;
  std::size_t count = 0;
  map.for_each([&](std::uint32_t number, const cairn::MappedLandmark<MappedLine>& landmark) {
    if (!is_believed(landmark)) {
      ++made.tentative;
      return;
    }
    made.lines.push_back({number, landmark.belief, landmark.sightings});
    const MappedLine& line = landmark.belief.mean;
    if (line.edge == no_edge) {
      ++made.of_nothing;
      return;
    }
    edges.insert(line.edge);
    const Edge& edge = drive.campus.edges()[line.edge];
    const cairn::Line truth = cairn::Line::through(edge.from, edge.to);
    for (const Vector<3>& p : {line.from, line.middle(), line.to}) {
      const double d = truth.distance(p);
      sum += d * d;
      ++count;
    }
  });
  made.edges = edges.size();
  made.rms = count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0;
  sum = 0;
  for (std::size_t k = 0; k < made.path.size(); ++k)
    sum += (made.path[k].translation() - drive.truth[k].translation()).squaredNorm();
  made.path_rms = made.path.empty() ? 0 : std::sqrt(sum / static_cast<double>(made.path.size()));
}

/// The map along a path that is taken for true.
MadeMap mapped_along(const Drive& drive, std::vector<SE3> path, const Map& empty) {
  Map map = empty;
  cairn::Random random(1);
  for (std::size_t k = 0; k < path.size(); ++k) {
    const auto chosen = map.choose(path[k], drive.frames[k].seen, random);
    map.insert(path[k], drive.frames[k].seen, chosen.choice);
  }
  MadeMap made;
  made.path = std::move(path);
  judge(made, map, drive);
  return made;
}

std::vector<SE3> path_of(const Belief& belief, std::size_t particle) {
  std::vector<SE3> path;
  for (const auto& each : belief.path(particle)) path.push_back(each.pose);
  path.erase(path.begin());  // the start
  return path;
}

}  // namespace

Results run(const Drive& drive, const RunOptions& options,
            const std::function<std::optional<std::string>()>& on_frame) {
  if (options.particles == 0) cairn::raise("line_slam: expected at least one particle");
  Results r{.options = options, .drive = drive.options};
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  LineSensor sensor;
  sensor.rig = std::make_shared<const Rig>(drive.rig);
  sensor.sigma = drive.options.detector.sigma;
  const Map empty(sensor, options.landmarks);
  Belief belief(drive.truth.front(), empty, options.particles);
  const cairn::ConditionalFilter filter{.resample_below = options.resample_below,
                                        .redraw = true,
                                        .seed = options.seed,
                                        .threads = options.threads};
  const cairn::FromLandmarks proposal{
      .weight = cairn::FromLandmarks::Weight::evidence, .associations = 2, .hypotheses = 10};
  std::vector<SE3> odometry;
  for (const Frame& frame : drive.frames) {
    const auto motion = [&](const SE3& x, std::size_t) {
      return cairn::Gaussian<SE3>{x * frame.moved.mean, frame.moved.covariance};
    };
    const cairn::MappingStep did = filter.step(belief, motion, proposal, frame.seen);
    if (!did.accepted())
      cairn::raise("frame " + std::to_string(odometry.size()) + ": " + explain(did.status));
    odometry.push_back((odometry.empty() ? drive.truth.front() : odometry.back()) * frame.moved.mean);
    std::size_t known = 0;
    for (const std::uint32_t n : belief[0].choice)
      known += n != cairn::new_landmark && n != cairn::no_landmark;
    r.steps.push_back(
        {did.effective_size, did.resampled, frame.seen.size(), known, belief[0].map.size(), belief.pose()});
    if (on_frame) r.ended_early = on_frame();
    if (r.ended_early) break;
  }
  const std::size_t best = belief.best();
  if (options.smoothings == 0) {
    r.slam.path = path_of(belief, best);
    judge(r.slam, belief[best].map, drive);
  } else {
    std::vector<SE3> path = path_of(belief, best);
    for (int i = 0; i < options.smoothings; ++i) path = smoothed(drive, path, empty);
    r.slam = mapped_along(drive, std::move(path), empty);
  }
  for (std::size_t i = 0; i < belief.size(); ++i)
    if (i == 0 || belief[i].node != belief[i - 1].node) r.paths.push_back(path_of(belief, i));
  const auto frames = static_cast<std::ptrdiff_t>(odometry.size());
  r.exact = mapped_along(drive, {drive.truth.begin(), drive.truth.begin() + frames}, empty);
  r.odometry = mapped_along(drive, std::move(odometry), empty);
  r.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  r.cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  return r;
}

}  // namespace line_slam
