// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Drives that are rendered, so that the lines and the path are known.
#include "run.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/rao_blackwell.hpp>
#include <cairn/filter/unscented.hpp>

#include "batch.hpp"
#include "drive.hpp"
#include "line_sensor.hpp"
#include "support/line_nees.hpp"
#include "support/random.hpp"

namespace line_run_test {
namespace {

using namespace line_slam;

/// A segment of some metres in front of the rig, as all cameras see it with noise of half a pixel; seen again
/// with other noise.
struct SeenTwice {
  LineSighting first{}, again{};
};
std::optional<SeenTwice> some_line(const Rig& rig, cairn::Random& random) {
  const double depth = random.uniform(4, 12);
  const cairn::Vector<3> middle(random.uniform(-0.3, 0.3) * depth, random.uniform(-0.3, 0.3) * depth, depth);
  const cairn::Vector<3> along =
      cairn::Vector<3>(random.normal(), random.normal(), 0.3 * random.normal()).normalized() * 0.15 * depth;
  SeenTwice seen;
  std::array<cairn::LineView, cameras> views;
  for (std::size_t c = 0; c < cameras; ++c) {
    const auto at = [&](const cairn::Vector<3>& point) -> cairn::Vector<2> {
      const auto pixel = rig[c].camera().project(rig[c].T_rig_camera().inverse() * point);
      return cairn::Vector<2>(*pixel + 0.5 * cairn::Vector<2>(random.normal(), random.normal()));
    };
    seen.first.seen[c] = {at(middle - along), at(middle + along)};
    seen.again.seen[c] = {at(middle - along), at(middle + along)};
    views[c] = {&rig[c], seen.first.seen[c]};
  }
  seen.first.line = cairn::triangulate_line(views, {.sigma = 0.5});
  if (!seen.first.line.good()) return std::nullopt;
  return seen;
}

/// How far the unscented filter's update of a line is from the extended one's, where the line is known by a
/// share of the covariance that one sighting leaves: in standard deviations, and of the covariance's norm.
struct Apart {
  double mean = 0, covariance = 0;
};
Apart unscented_from_extended(double share, std::uint64_t seed) {
  const LineSensor sensor;
  cairn::Random random(seed);
  Apart apart;
  constexpr int runs = 100;
  for (int run = 0; run < runs;) {
    const auto seen = some_line(*sensor.rig, random);
    if (!seen) continue;
    const MappedLine line = sensor.initialise(cairn::SE3(), seen->first);
    if (!cairn::manifold_traits<MappedLine>::finite(line)) continue;
    const auto H = sensor.of(seen->first).part_jacobian(cairn::SE3(), line);
    const cairn::Matrix<4> prior = share * (H.transpose() * H / 0.25).inverse();
    cairn::Gaussian<MappedLine> extended{line, cairn::symmetrised(prior)}, unscented = extended;
    const auto model = sensor.of(seen->again);
    const cairn::detail::HeldSensor<EndsOfSighting> held{model, cairn::SE3()};
    REQUIRE(cairn::Extended{}.update(extended, held, model.measured()).accepted());
    REQUIRE(cairn::Unscented{}.update(unscented, held, model.measured()).accepted());
    const cairn::Vector<4> off = cairn::local(extended.mean, unscented.mean);
    apart.mean += std::sqrt(off.dot(prior.inverse() * off)) / runs;
    apart.covariance +=
        (extended.covariance - unscented.covariance).norm() / extended.covariance.norm() / runs;
    ++run;
  }
  return apart;
}

}  // namespace

TEST_SUITE("line_slam/run") {
  TEST_CASE(
      "line_slam: a line's unscented update is the extended one where it is known well, and nearly so else") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    const Apart well = unscented_from_extended(1e-3, seed), once = unscented_from_extended(1, seed);
    MESSAGE("apart ", well.mean, " ", well.covariance, ", known by one sighting ", once.mean, " ",
            once.covariance);
    CHECK(well.mean < 1e-5);
    CHECK(well.covariance < 1e-8);
    CHECK(once.mean < 0.03);
    CHECK(once.covariance < 1e-3);
    CHECK(once.covariance > well.covariance);  // the sensor does bend
  }

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
