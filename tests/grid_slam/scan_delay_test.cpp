// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "scan_delay.hpp"

#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>

#include "floor_plan.hpp"
#include "run.hpp"
#include "support/random.hpp"

namespace scan_delay_test {
namespace {

using namespace cairn;
using namespace grid_slam;

/// Scans of a robot that drives an arc at a constant velocity.
std::vector<StampedScan> arc(std::size_t count, const Vector<3>& velocity) {
  std::vector<StampedScan> scans(count);
  for (std::size_t i = 0; i < count; ++i)
    scans[i].T_odom_laser = SE2(3, -2, 0.4) * SE2::exp(Vector<3>(static_cast<double>(i) * velocity));
  return scans;
}

void expect_same(const SE2& a, const SE2& b) {
  CHECK(local(a, b).norm() < 1e-12);
}

/// Headings of a robot that now and then turns, and what a laser that lags sees of them.
struct Turning {
  std::vector<StampedScan> scans;
  std::vector<double> seen;  // heading of the laser at each scan
};

Turning turning(double delay, Random& random) {
  Turning t;
  std::vector<double> heading;
  double now = 0;
  for (std::size_t i = 0; i < 600; ++i) {
    if (i % 20 >= 12) now += i % 40 < 20 ? 0.2 : -0.15;
    heading.push_back(now);
    StampedScan scan;
    scan.T_odom_laser = SE2(0.1 * static_cast<double>(i), 0, now + 0.005 * random.normal());
    t.scans.push_back(scan);
  }
  for (std::size_t i = 0; i < heading.size(); ++i) {
    const double at = std::max(0.0, static_cast<double>(i) - delay);
    const auto k = static_cast<std::size_t>(at);
    const double share = at - static_cast<double>(k);
    t.seen.push_back((1 - share) * heading[k] + share * heading[std::min(k + 1, heading.size() - 1)]);
  }
  return t;
}

}  // namespace

TEST_SUITE("grid_slam/scan_delay") {
  TEST_CASE("scan_delay: along an arc the delayed pose is the arc's, and the motion what lies between") {
    const Vector<3> velocity(0.1, 0, 0.07);
    const std::vector<StampedScan> scans = arc(12, velocity);
    const auto on_arc = [&](double at) { return SE2(3, -2, 0.4) * SE2::exp(Vector<3>(at * velocity)); };
    for (const double delay : {0.0, 0.25, 1.0, 2.6}) {
      CAPTURE(delay);
      expect_same(delayed_odometry(scans, 7, delay), on_arc(7 - delay));
      expect_same(delayed_motion(scans, 4, 9, delay, true), SE2::exp(Vector<3>(5 * velocity)));
      expect_same(delayed_motion(scans, 4, 9, delay, false),
                  SE2::exp(Vector<3>(-5 * velocity(0), 0, 5 * velocity(2))));
    }
    expect_same(delayed_odometry(scans, 1, 3), on_arc(0));
    expect_same(delayed_motion(scans, 0, 2, 1.5, true), SE2::exp(Vector<3>(0.5 * velocity)));
  }

  TEST_CASE("scan_delay: learnt from turns, whatever it is, and not from one turn in ten that is no such") {
    Random random(cairn_test::seed());
    for (const double delay : {0.0, 0.5, 1.4, 2.75}) {
      CAPTURE(delay);
      const Turning t = turning(delay, random);
      ScanDelay learnt;
      CHECK(learnt.spread() > 0.5);
      for (std::size_t from = 3; from + 3 < t.scans.size(); from += 3) {
        const bool wrong = from % 10 == 0;
        const double turn = t.seen[from + 3] - t.seen[from] + (wrong ? 0.5 : 0.004 * random.normal());
        learnt.learn(t.scans, from, from + 3, turn, 0.03);
      }
      CHECK(std::abs(learnt.mean() - delay) < 0.15);
      CHECK(learnt.spread() < 0.15);
    }
  }

  TEST_CASE("scan_delay: a mapper finds how late its scans are, and its path is as good as in time") {
    Drive drive = simulated_drive({.seed = 3});
    constexpr std::size_t late = 2, count = 400;
    CarmenLog log;
    std::vector<SE2> truth;
    for (std::size_t i = late; i < count; ++i) {
      StampedScan scan = drive.log.scans[i];
      scan.scan = drive.log.scans[i - late].scan;
      log.scans.push_back(scan);
      truth.push_back(drive.truth[i - late]);
    }
    Mapper mapper({.particles = 8, .threads = 2});
    for (const StampedScan& scan : log.scans) mapper.add(scan);
    CHECK(std::abs(mapper.delay().mean() - late) < 0.4);
    double worst_turn = 0;
    const auto path = mapper.trajectory(true);
    for (std::size_t i = 0; i < path.size(); ++i) {
      const SE2 seen = path.front().pose.inverse() * path[i].pose, is = truth.front().inverse() * truth[i];
      worst_turn = std::max(worst_turn, std::abs(local(is, seen)(2)));
    }
    CHECK(worst_turn < 0.03);
  }
}

}  // namespace scan_delay_test
