// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/gaussian.hpp>

#include "floor_plan.hpp"
#include "mapper.hpp"
#include "run.hpp"
#include "stop_mapper.hpp"

namespace newest_pose_test {
namespace {

using namespace cairn;
using namespace grid_slam;

/// A mapper that has taken `count` scans of a drive, each seen `late` scans before odometry was where it is,
/// and where the laser was at the last one, seen from the first.
struct Driven {
  Mapper mapper;
  SE2 truth;
};

Driven driven(std::uint64_t seed, std::size_t count, std::size_t late) {
  const Drive drive = simulated_drive({.seed = seed});
  Driven d{Mapper({.particles = 8, .seed = seed, .threads = 2}), {}};
  for (std::size_t i = late; i < count; ++i) {
    StampedScan scan = drive.log.scans[i];
    scan.scan = drive.log.scans[i - late].scan;
    // What belongs to the newest processed scan is asked then.
    if (d.mapper.add(scan)) d.truth = drive.truth.front().inverse() * drive.truth[i - late];
  }
  return d;
}

double squared_distance(const Gaussian<SE2>& pose, const SE2& truth) {
  const Cholesky<3> root(pose.covariance);
  REQUIRE(root.good());
  return root.whiten(local(pose.mean, truth)).squaredNorm();
}

constexpr int drives = 5;

/// Of means of as many squared distances, from the pose that is told and from that of the particles alone.
void expect_spread(double told, double by_particles) {
  CAPTURE(told);
  CAPTURE(by_particles);
  // The mean of five chi-squares of three degrees of freedom is below this 995 times of 1000. It is below 1,
  // for the steps' errors are not as independent as they are taken to be: each is matched to the map that the
  // ones before have made.
  const double most = chi_square_quantile(0.995, 3 * drives) / drives;
  CHECK(told < most);
  CHECK(told > 0.05);
  // What the particles alone say is far too sure: they have one ancestor.
  CHECK(by_particles > most);
}

}  // namespace

TEST_SUITE("grid_slam/newest_pose") {
  TEST_CASE("newest_pose: the truth is in its spread, whether scans are in time or late") {
    for (const std::size_t late : {std::size_t{0}, std::size_t{1}}) {
      CAPTURE(late);
      double told = 0, by_particles = 0;
      for (std::uint64_t seed = 1; seed <= drives; ++seed) {
        const Driven d = driven(seed, 280, late);
        CHECK(std::abs(d.mapper.delay().mean() - static_cast<double>(late)) < 0.3);
        told += squared_distance(d.mapper.newest(), d.truth) / drives;
        by_particles += squared_distance(d.mapper.belief().pose(), d.truth) / drives;
      }
      expect_spread(told, by_particles);
    }
  }

  TEST_CASE("newest_pose: the report shows it as it is, not the particles' spread alone") {
    CarmenLog log = simulated_drive({.seed = 2}).log;
    log.scans.resize(280);
    Mapper mapper({.particles = 8, .seed = 2, .threads = 2});
    Results r = run(mapper, log, {}, {}, 4);
    REQUIRE(r.snapshots.size() == 4);
    CHECK(r.snapshots.back().newest == r.newest.covariance);
    const Matrix<3> by_particles = r.steps.back().pose.covariance;
    CHECK(r.newest.covariance(0, 0) + r.newest.covariance(1, 1) >
          9 * (by_particles(0, 0) + by_particles(1, 1)));
    const auto page = report(r);
    if (!page) return;
    for (StepRecord& step : r.steps) step.pose.covariance *= 4;
    CHECK(report(r) == page);
    for (Snapshot& s : r.snapshots) s.newest *= 4;
    CHECK(report(r) != page);
  }

  TEST_CASE(
      "newest_pose: of DP-SLAM's map, the truth is in its spread, with scans matched or drawn from motion") {
    for (const StopProposal proposal : {StopProposal::match, StopProposal::motion}) {
      CAPTURE(proposal == StopProposal::match);
      StopMapperOptions options = proposal == StopProposal::match ? matching_stops() : StopMapperOptions{};
      options.start = SE2();
      options.storage = StopStorage::tiles;
      options.particles = proposal == StopProposal::match ? 8 : 16;
      options.threads = 2;
      double told = 0, by_particles = 0;
      for (std::uint64_t seed = 1; seed <= drives; ++seed) {
        const Drive drive = simulated_drive({.seed = seed});
        CarmenLog log = drive.log;
        log.scans.resize(280);
        options.seed = seed;
        const Results r = run_stop_mapper(log, options, {});
        const SE2 truth = drive.truth.front().inverse() * drive.truth[r.steps.back().scan];
        told += squared_distance(r.newest, truth) / drives;
        by_particles += squared_distance(r.steps.back().pose, truth) / drives;
      }
      expect_spread(told, by_particles);
    }
  }

  TEST_CASE(
      "newest_pose: of DP-SLAM's map, drawn from motion, each frame has its own, the same on tree and "
      "tiles") {
    CarmenLog log = simulated_drive({.seed = 2}).log;
    log.scans.resize(60);
    StopMapperOptions options{.storage = StopStorage::tiles, .particles = 10};
    const Results tiles = run_stop_mapper(log, options, {}, {}, 3);
    options.storage = StopStorage::ancestry;
    const Results tree = run_stop_mapper(log, options, {}, {}, 3);
    REQUIRE(tiles.snapshots.size() == 3);
    CHECK(tiles.newest.covariance == tree.newest.covariance);
    for (const Results* r : {&tiles, &tree}) {
      CHECK(r->snapshots.back().newest == r->newest.covariance);
      CHECK(r->snapshots[0].newest.trace() < r->snapshots[1].newest.trace());
    }
  }

  TEST_CASE("newest_pose: a closed loop takes back what the lap has gathered") {
    const std::size_t all = simulated_drive({.seed = 1}).log.scans.size();
    const auto width = [](const Driven& d) {
      return d.mapper.newest().covariance.topLeftCorner<2, 2>().trace();
    };
    const Driven before = driven(1, 3 * all / 4, 0), after = driven(1, all, 0);
    REQUIRE(before.mapper.loops().empty());
    REQUIRE(!after.mapper.loops().empty());
    CHECK(width(after) < 0.25 * width(before));
    CHECK(squared_distance(after.mapper.newest(), after.truth) < chi_square_quantile(0.995, 3));
  }
}

}  // namespace newest_pose_test
