// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "run.hpp"

#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/eval/consistency.hpp>

#include "drive.hpp"
#include "elevation_map.hpp"
#include "outputs.hpp"
#include "support/folder.hpp"

namespace gamma_run_test {
namespace {

using namespace gamma_slam;
using cairn::SE2;
using cairn::Vector;

/// A scan of ground that is flat but for its noise, from the vehicle.
TerrainScan flat_scan(cairn::Random& random, double height) {
  TerrainScan scan;
  for (int i = 0; i < 200; ++i)
    scan.points.push_back({random.uniform(1, 3), random.uniform(-1, 1), random.normal(height, 0.02)});
  return scan;
}

}  // namespace

TEST_SUITE("gamma_slam/run") {
  TEST_CASE("terrain: a ray ends on the surface, and the first time that it meets it") {
    const Terrain terrain(3);
    cairn::Random random(4);
    int hits = 0;
    for (int trial = 0; trial < 300; ++trial) {
      const double x = random.uniform(-15, 15), y = random.uniform(-15, 15);
      const Vector<3> from(x, y, terrain.height(x, y) + 1);
      const double heading = random.uniform(-3, 3);
      const Vector<3> ray =
          Vector<3>(std::cos(heading), std::sin(heading), random.uniform(-0.5, 0)).normalized();
      const auto end = terrain.hit(from, ray, 10);
      if (!end) continue;
      ++hits;
      const double length = (*end - from).norm();
      CHECK((*end)(2) == doctest::Approx(terrain.height((*end)(0), (*end)(1))).epsilon(1e-3));
      int below = 0;  // of many points before the end; a ray may graze a stone within its step
      for (double at = 0; at < length - 0.05; at += 0.002) {
        const Vector<3> p = from + at * ray;
        below += p(2) < terrain.height(p(0), p(1)) - 0.01;
      }
      CHECK(below == 0);
    }
    CHECK(hits > 200);
  }

  TEST_CASE("terrain: sigma of a square is that of heights drawn in it") {
    const Terrain terrain(3);
    cairn::Random random(5);
    for (int trial = 0; trial < 10; ++trial) {
      const double left = random.uniform(-10, 10), bottom = random.uniform(-10, 10);
      double sum = 0, squares = 0;
      constexpr int n = 20000;
      for (int i = 0; i < n; ++i) {
        const double x = left + random.uniform(0, 0.2), y = bottom + random.uniform(0, 0.2);
        const double h = terrain.height(x, y) + terrain.roughness(x, y) * random.normal();
        sum += h;
        squares += h * h;
      }
      const double sigma = std::sqrt(squares / n - sum / n * (sum / n));
      CHECK(terrain.sigma_in(left, bottom, 0.2) == doctest::Approx(sigma).epsilon(0.06).scale(0));
    }
  }

  TEST_CASE("drive: visual odometry errs by what all points of a look share, and else as it says") {
    const Drive drive =
        simulated_drive({.seed = 2, .laps = 1, .common_sigma = 0, .rig_sigma = 0, .level_sigma = 0});
    double squares = 0;
    for (std::size_t i = 1; i < drive.scans.size(); ++i) {
      const SE2 moved = drive.truth[i - 1].inverse() * drive.truth[i];
      const Vector<3> e = cairn::local(moved, drive.scans[i].moved);
      squares += e(2) * e(2) / drive.scans[i].moved_covariance(2, 2);
    }
    const auto runs = static_cast<double>(drive.scans.size() - 1);
    const auto band = cairn::chi_square_mean_band(1, runs, 0.999);
    CAPTURE(squares / runs);
    CHECK(squares / runs > 0.8 * band.low);  // pitch and roll make steps on the right a little different
    CHECK(squares / runs < 1.2 * band.high);
  }

  TEST_CASE_TEMPLATE("elevation_map: every point counts: ground seen before beats ground that nobody saw",
                     Cell, cairn::HeightCell, cairn::VarianceCell) {
    cairn::Random random(6);
    ElevationMap<Cell> map;
    for (int k = 0; k < 10; ++k) map.insert(SE2(0, 0, 0), flat_scan(random, 0));
    const TerrainScan now = flat_scan(random, 0);
    CHECK(map.log_likelihood(SE2(0, 0, 0), now) > map.log_likelihood(SE2(50, 0, 0), now));
    CHECK(map.log_likelihood(SE2(50, 0, 0), now) != 0);
    CHECK(map.cells().read({7, 0}).known());
    CHECK_FALSE(map.cells().read({-7, 0}).known());
  }

  TEST_CASE("elevation_map: how high the vehicle stands is found against the cells, as sure as they are") {
    cairn::Random random(7);
    ElevationMap<cairn::HeightCell> map;
    for (int k = 0; k < 10; ++k) map.insert(SE2(0, 0, 0), flat_scan(random, 0.1));
    CHECK(map.altitude() == 0);
    TerrainScan now = flat_scan(random, 0.1 - 0.06);  // it has climbed 6 cm, and odometry says none
    now.climbed_variance = 1;
    map.insert(SE2(0, 0, 0), now);
    CHECK(map.altitude() == doctest::Approx(0.06).epsilon(0.2).scale(0));
  }

  TEST_CASE("elevation_map: options out of range are refused in words") {
    const auto words = [](const ElevationOptions& options) {
      return cairn_test::message_of([&] { static_cast<void>(ElevationMap<cairn::HeightCell>(options)); });
    };
    CHECK(words({.geometry = {.cell_size = 0}}).find("cell size above zero") != std::string::npos);
    CHECK(words({.prior = {.sigma = 0}}).find("above zero") != std::string::npos);
    CHECK(words({.independence = 0}).find("independence") != std::string::npos);
    CHECK(words({.heights_share = 2}).find("share") != std::string::npos);
    const Drive drive = simulated_drive({.laps = 0});
    CHECK(cairn_test::message_of([&] { static_cast<void>(run(drive, {.particles = 0})); }).find("particle") !=
          std::string::npos);
  }

  TEST_CASE(
      "gamma_slam: two laps: a third of visual odometry's error at most, and intervals of sigma that hold") {
    const Drive drive = simulated_drive({.seed = 4});
    const Results r = run(drive, {.particles = 40, .seed = 4});
    CAPTURE(r.odometry_error());
    CAPTURE(r.filter_error());
    CHECK(r.odometry_error() > 0.5);
    CHECK(r.filter_error() < r.odometry_error() / 3);
    REQUIRE(r.coverage);
    CHECK(r.coverage->cells > 3000);
    CHECK(r.coverage->share() > 0.80);
    CHECK(r.coverage->share() < 0.97);
    CHECK(r.path.size() == drive.scans.size());
  }

  TEST_CASE(
      "gamma_slam: the truth is in the newest pose's spread, on the way and where ground is met again") {
    constexpr int drives = 2;
    double on_the_way = 0, met_again = 0, narrowed = 0;  // means of NEES; what is left of the variance
    for (std::uint64_t seed = 3; seed < 3 + drives; ++seed) {
      Drive drive = simulated_drive({.seed = seed, .laps = 1});
      const auto newest_after = [&](std::size_t scans) {
        drive.scans.resize(scans);
        return run(drive, {.particles = 30, .seed = seed, .threads = 2}).newest;
      };
      const auto after = newest_after(201), before = newest_after(125);
      met_again += cairn::nees(after, drive.truth[200]) / drives;
      on_the_way += cairn::nees(before, drive.truth[124]) / drives;
      narrowed += after.covariance(1, 1) / before.covariance(1, 1) / drives;
    }
    CAPTURE(on_the_way);
    CAPTURE(met_again);
    // The particles alone had hundreds where ground is met again: they had one ancestor.
    const double most = cairn::chi_square_quantile(0.995, 3 * drives) / drives;
    CHECK(on_the_way < most);
    CHECK(on_the_way > 0.2);
    CHECK(met_again < most);
    CHECK(met_again > 0.2);
    CHECK(narrowed < 0.25);  // what is met again takes back what the lap has gathered
  }

  TEST_CASE("gamma_slam: the report counts time from the start, whenever that was") {
    Drive drive = simulated_drive({.seed = 1, .laps = 1});
    drive.scans.resize(20);
    const auto page = [&](double start) {
      for (std::size_t i = 0; i < drive.scans.size(); ++i)
        drive.scans[i].time = start + static_cast<double>(i);
      return report(run(drive, {.particles = 2}));
    };
    CHECK(page(0) == page(1316995044));
  }

  TEST_CASE("gamma_slam: the same numbers for 1, 2 and 7 threads, for either kind of cell") {
    Drive drive = simulated_drive({.seed = 1, .laps = 1});
    drive.scans.resize(60);
    for (const Cells cells : {Cells::heights, Cells::variance}) {
      std::vector<Results> all;
      for (const unsigned threads : {1U, 2U, 7U})
        all.push_back(run(drive, {.cells = cells, .particles = 12, .seed = 3, .threads = threads}));
      for (const Results& r : all) {
        CHECK(r.filter_error() == all[0].filter_error());
        CHECK(r.effective_size == all[0].effective_size);
        bool same = true;
        for (int y = 0; y < r.filter_map.image.height(); ++y)
          for (int x = 0; x < r.filter_map.image.width(); ++x)
            same = same && r.filter_map.image(x, y) == all[0].filter_map.image(x, y);
        CHECK(same);
      }
    }
  }
}

}  // namespace gamma_run_test
