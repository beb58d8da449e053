// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "rivals.hpp"

#ifdef CAIRN_BENCH_GMAPPING
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>

#include <gmapping/gridfastslam/gridslamprocessor.h>
#include <gmapping/sensor/sensor_range/rangesensor.h>

#include <cairn/core/check.hpp>
#endif

namespace grid_slam_bench {

#ifndef CAIRN_BENCH_GMAPPING
std::optional<RivalPath> gmapping(const cairn::CarmenLog&, std::uint64_t) {
  return std::nullopt;
}
#else
namespace {

using cairn::SE2;

GMapping::OrientedPoint oriented(const SE2& pose) {
  return {pose.x(), pose.y(), pose.angle()};
}

/// It tells of every scan on the standard error stream.
class Silence {
public:
  Silence() : kept_(std::cerr.rdbuf(nothing_.rdbuf())) {}
  ~Silence() { std::cerr.rdbuf(kept_); }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

private:
  struct Nothing : std::streambuf {
    int overflow(int letter) override { return letter; }
  };
  struct Stream : std::ostream {
    Stream() : std::ostream(&none) {}
    Nothing none;
  } nothing_;
  std::streambuf* kept_;
};

/// The laser of a log, each beam at the angle that the log gives it.
std::unique_ptr<GMapping::RangeSensor> laser_of(const cairn::LaserScan& scan, double farthest) {
  auto laser =
      std::make_unique<GMapping::RangeSensor>("FLASER", static_cast<unsigned>(scan.size()), scan.angle_step,
                                              GMapping::OrientedPoint(0, 0, 0), 0, farthest);
  for (std::size_t i = 0; i < scan.size(); ++i) laser->beams()[i].pose.theta = scan.angle(i);
  laser->updateBeamsLookup();
  return laser;
}

/// What slam_gmapping sets where nobody says otherwise.
void set_up(GMapping::GridSlamProcessor& slam, GMapping::RangeSensor& laser, double farthest,
            const SE2& start) {
  constexpr double side = 100;  // [m] to each side
  slam.setSensorMap({{laser.getName(), &laser}});
  slam.setMatchingParameters(farthest, farthest, 0.05, 1, 0.05, 0.05, 5, 0.075, 3, 0);
  slam.setMotionModelParameters(0.1, 0.2, 0.1, 0.2);
  slam.setUpdateDistances(1.0, 0.5, 0.5);
  slam.setUpdatePeriod(-1);
  slam.setgenerateMap(false);
  slam.init(30, -side, -side, side, side, 0.05, oriented(start));
  slam.setllsamplerange(0.01);
  slam.setllsamplestep(0.01);
  slam.setlasamplerange(0.005);
  slam.setlasamplestep(0.005);
  slam.setminimumScore(0);
}

/// The path of the best particle, from its newest pose back.
RivalPath path_of(const GMapping::GridSlamProcessor& slam, const std::vector<std::size_t>& processed) {
  RivalPath path{processed, {}, 0};
  const auto& best = slam.getParticles()[static_cast<std::size_t>(slam.getBestParticleIndex())];
  for (const auto* node = best.node; node != nullptr && node->reading != nullptr; node = node->parent)
    path.poses.emplace_back(node->pose.x, node->pose.y, node->pose.theta);
  std::ranges::reverse(path.poses);
  if (path.poses.size() != processed.size())
    cairn::raise("GMapping: expected a pose for each scan that it processed");
  return path;
}

}  // namespace

std::optional<RivalPath> gmapping(const cairn::CarmenLog& log, std::uint64_t seed) {
  const cairn::LaserScan& first = log.scans.front().scan;
  const double farthest = first.farthest;
  const auto laser = laser_of(first, farthest);
  const Silence silence;
  std::ostream nowhere(nullptr);
  ::srand48(static_cast<long>(seed));
  GMapping::GridSlamProcessor slam(nowhere);
  set_up(slam, *laser, farthest, log.scans.front().T_odom_laser);
  std::vector<std::size_t> processed;
  const std::clock_t begin = std::clock();
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    const cairn::StampedScan& scan = log.scans[i];
    if (scan.scan.size() != first.size()) cairn::raise("GMapping: expected scans of equally many beams");
    std::vector<double> ranges;
    for (std::size_t k = 0; k < scan.scan.size(); ++k)
      ranges.push_back(scan.scan.kind(k) == cairn::BeamKind::hit ? static_cast<double>(scan.scan.range[k])
                                                                 : farthest);
    GMapping::RangeReading reading(static_cast<unsigned>(ranges.size()), ranges.data(), laser.get(),
                                   scan.time);
    reading.setPose(oriented(scan.T_odom_laser));
    if (slam.processScan(reading)) processed.push_back(i);
  }
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  RivalPath path = path_of(slam, processed);
  path.cpu_seconds = seconds;
  return path;
}
#endif

}  // namespace grid_slam_bench
