// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "joint_rival.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/filter/gaussian.hpp>

#include "ekf_slam.hpp"
#include "scores.hpp"
#include "slam.hpp"

namespace {

using namespace fastslam;
using cairn::SE2;
using cairn::Vector;

constexpr std::uint64_t first_seed = 101, drives = 3;

/// The loop of loop_map(), `times` as large, with times^2 as many landmarks over the same strip beside the
/// way.
PointMap larger_loop(int times) {
  PointMap map = loop_map();
  cairn::Random random(3);
  const std::size_t count = map.landmarks.size() * static_cast<std::size_t>(times * times);
  for (Vector<2>& point : map.way) point *= times;
  map.landmarks.clear();
  while (map.landmarks.size() < count) {
    const double way = random.uniform(0, 200.0 * times), across = random.uniform(-8, 8);
    const double x = 60.0 * times, y = 40.0 * times;
    if (way < x)
      map.landmarks.emplace_back(way, across);
    else if (way < x + y)
      map.landmarks.emplace_back(x + across, way - x);
    else if (way < 2 * x + y)
      map.landmarks.emplace_back(way - x - y, y + across);
    else
      map.landmarks.emplace_back(across, way - 2 * x - y);
  }
  return map;
}

/// Medians of the drives.
struct Figures {
  std::vector<double> error, nees, seconds;
  [[nodiscard]] static double middle(std::vector<double> values) {
    std::ranges::sort(values);
    return values[values.size() / 2];
  }
};

double path_error(const std::vector<SE2>& path, const std::vector<SE2>& truth) {
  std::vector<Vector<2>> is, places;
  for (std::size_t k = 0; k < path.size(); ++k) {
    places.push_back(path[k].translation());
    is.push_back(truth[k].translation());
  }
  return rms(places, is, rigid_fit(places, is));
}

/// Both filters' path as it was known at each moment: what a robot steers by.
void measure(Figures& figures, const std::vector<cairn::Gaussian<SE2>>& beliefs, double seconds,
             const LandmarkLog& log) {
  std::vector<SE2> path, truth;
  double nees = 0;
  for (std::size_t k = 0; k < beliefs.size(); ++k) {
    truth.push_back(log.start->inverse() * log.truth[k].pose);
    path.push_back(beliefs[k].mean);
    nees += cairn::nees(beliefs[k], truth.back()) / static_cast<double>(beliefs.size());
  }
  figures.error.push_back(path_error(path, truth));
  figures.nees.push_back(nees);
  figures.seconds.push_back(seconds);
}

}  // namespace

void add_joint_rival(cairn_bench::Scoreboard& board) {
  for (const int times : {1, 2, 3}) {
    const PointMap map = larger_loop(times);
    const std::size_t frames = 400 * static_cast<std::size_t>(times);
    std::vector<LandmarkLog> logs;
    Figures joint;
    for (std::uint64_t seed = first_seed; seed < first_seed + drives; ++seed) {
      logs.push_back(simulated(map, seed, frames));
      const EkfSlamRun ekf = ekf_slam(logs.back());
      measure(joint, ekf.poses, ekf.cpu_seconds, logs.back());
    }
    for (const std::size_t particles : {10U, 100U}) {
      Figures ours;
      for (std::size_t i = 0; i < logs.size(); ++i) {
        const Results r = run(logs[i], {.particles = particles, .seed = first_seed + i});
        std::vector<cairn::Gaussian<SE2>> beliefs;
        for (const StepRecord& step : r.steps) beliefs.push_back(step.pose);
        measure(ours, beliefs, r.cpu_seconds, logs[i]);
      }
      const std::string title = std::to_string(map.landmarks.size()) + " landmarks, " +
                                std::to_string(frames) + " frames, M = " + std::to_string(particles) + ": ";
      const auto add = [&](const char* name, const char* unit, const std::vector<double>& values,
                           const std::vector<double>& rival) {
        board.add({.name = title + name,
                   .measured = Figures::middle(values),
                   .unit = unit,
                   .rival = Figures::middle(rival),
                   .rival_name = "EKF-SLAM"});
      };
      add("path as known at each moment, rms", "m", ours.error, joint.error);
      add("mean NEES of the pose, of 3 numbers", "", ours.nees, joint.nees);
      add("CPU", "s", ours.seconds, joint.seconds);
    }
  }
}
