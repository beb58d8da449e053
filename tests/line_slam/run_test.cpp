// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Drives that are rendered, so that the lines and the path are known.
#include "run.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>

#include "batch.hpp"
#include "drive.hpp"
#include "support/line_nees.hpp"
#include "support/random.hpp"

namespace line_run_test {
namespace {

using namespace line_slam;

}  // namespace

TEST_SUITE("line_slam/run") {
  TEST_CASE("line_slam: NEES of 500 lines that are mapped with the true poses is in its band") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const cairn_test::LineNees nees = cairn_test::nees_of_lines(seed, 500);
    MESSAGE(nees.lines, " lines, NEES ", nees.mean());
    CHECK(cairn::chi_square_mean_band(4, static_cast<double>(nees.lines), 0.999).contains(nees.mean()));
  }

  TEST_CASE("line_slam: particles map a side of the campus nearly as well as the true poses do") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const Drive drive = simulated_drive({.seed = seed, .metres = 60});
    const Results r = run(drive, {.particles = 30, .seed = seed});
    MESSAGE("rms ", r.exact.rms, " ", r.slam.rms, " ", r.odometry.rms, ", path ", r.slam.path_rms, " ",
            r.odometry.path_rms);
    CHECK(r.slam.rms < 2 * r.exact.rms + 0.1);
    CHECK(r.slam.path_rms < 0.3);
    CHECK(r.slam.path_rms < 0.5 * r.odometry.path_rms);
    CHECK(r.slam.edges > r.exact.edges * 9 / 10);
    // A particle's map is judged by what it began with: the same line twice would be more lines than edges.
    CHECK(r.slam.lines.size() < r.exact.lines.size() * 12 / 10);
  }

  TEST_CASE("line_slam: the least squares along a path that drifted is nearer to the truth") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    Drive drive = simulated_drive({.seed = seed, .metres = 80});
    for (Frame& frame : drive.frames) {
      Map::Observation named;
      for (const auto& sighting : frame.seen)
        if (sighting.z.edge != no_edge) named.push_back({sighting.z, sighting.z.edge});
      frame.seen = std::move(named);
    }
    LineSensor sensor;
    sensor.rig = std::make_shared<const Rig>(drive.rig);
    const Map empty(sensor, RunOptions{}.landmarks);
    cairn::Random random(seed);
    const auto off = [&](const std::vector<cairn::SE3>& path) {
      double sum = 0;
      for (std::size_t k = 0; k < path.size(); ++k)
        sum += (path[k].translation() - drive.truth[k].translation()).squaredNorm();
      return std::sqrt(sum / static_cast<double>(path.size()));
    };
    std::vector<cairn::SE3> drifted;  // by what a step leaves after its sightings, again and again
    cairn::SE3 error;
    const cairn::Gaussian<cairn::Vector<6>> step{
        cairn::Vector<6>::Zero(),
        cairn::Matrix<6>(cairn::Vector<6>(2e-4, 2e-5, 2e-4, 5e-7, 5e-6, 5e-7).asDiagonal())};
    for (const cairn::SE3& pose : drive.truth) {
      drifted.push_back(pose * error);
      error = cairn::retract(error, cairn::sample(step, random));
    }
    const std::vector<cairn::SE3> once = smoothed(drive, drifted, empty);
    MESSAGE("path ", off(drifted), " -> ", off(once));
    CHECK(off(once) < 0.3 * off(drifted) + 0.1);
    // and the truth is nearly where it stays: what it leaves by is what noise allows
    CHECK(off(smoothed(drive, drive.truth, empty)) < 0.15);
    CHECK(smoothed(drive, {}, empty).empty());
    std::vector<cairn::SE3> longer = drive.truth;
    longer.push_back(longer.back());
    CHECK_THROWS_AS(static_cast<void>(smoothed(drive, longer, empty)), cairn::Error);
  }
}

}  // namespace line_run_test
