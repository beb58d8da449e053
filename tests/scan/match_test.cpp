// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <string_view>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/scan/match.hpp>

#include "support/random.hpp"
#include "support/violation.hpp"

namespace match_test {
namespace {

using namespace cairn;

/// End points in a rectangle of half sides a and b, or in a corridor along x where b is all there is.
std::vector<ScanPoint> seen(const SE2& pose, double a, double b, Random& random, double sigma) {
  std::vector<ScanPoint> points;
  for (int i = 0; i < 180; ++i) {
    const double angle = 0.035 * i, c = std::cos(pose.angle() + angle), s = std::sin(pose.angle() + angle);
    const double rx = a > 0 ? ((c > 0 ? a : -a) - pose.x()) / c : 1e9;
    const double ry = ((s > 0 ? b : -b) - pose.y()) / s;
    const double r = std::min(rx, ry) + sigma * random.normal();
    if (r < 8) points.push_back({r * std::cos(angle), r * std::sin(angle)});
  }
  return points;
}

OccupancyGrid mapped(double a, double b, Random& random) {
  OccupancyGrid grid({.geometry = {}, .field_radius = 6});
  for (int i = 0; i < 40; ++i) {
    const SE2 pose(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), random.uniform(-3, 3));
    grid.insert(pose, seen(pose, a, b, random, 0.01));
  }
  return grid;
}

}  // namespace

TEST_SUITE("scan/match") {
  TEST_CASE("match: finds the pose in a room to millimetres, from decimetres and degrees away") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    const OccupancyGrid grid = mapped(2.5, 1.8, random);
    for (int trial = 0; trial < 50; ++trial) {
      const SE2 truth(random.uniform(-1, 1), random.uniform(-0.8, 0.8), random.uniform(-3, 3));
      const auto points = seen(truth, 2.5, 1.8, random, 0.01);
      SE2 start = retract(truth, Vector<3>(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1),
                                           random.uniform(-0.05, 0.05)));
      MatchOptions wide;
      wide.model.sigma = 0.12;
      start = match(grid, points, start, start, Matrix<3>::Zero(), wide).pose;
      const MatchResult found = match(grid, points, start, start, Matrix<3>::Zero());
      REQUIRE(found.status == MatchStatus::converged);
      REQUIRE(found.inliers > 0.9);
      const Vector<3> error = local(truth, found.pose);
      REQUIRE(error.head<2>().norm() < 0.01);
      REQUIRE(std::abs(error(2)) < 0.005);
    }
  }

  TEST_CASE("match: a corridor says nothing along itself, and the prior decides there") {
    Random random(3);
    const OccupancyGrid grid = mapped(-1, 1.2, random);
    const auto points = seen(SE2(), -1, 1.2, random, 0.01);
    const ScanLikelihood at = evaluate(grid, points, SE2(), {});
    CHECK(at.curvature(0, 0) < 0.02 * at.curvature(1, 1));
    const SE2 prior(0.07, 0.03, 0.01);
    const Matrix<3> information = Vector<3>(400, 400, 400).asDiagonal();
    const MatchResult found = match(grid, points, prior, prior, information);
    CHECK(std::abs(found.pose.x() - 0.07) < 0.03);
    CHECK(std::abs(found.pose.y()) < 0.01);
  }

  TEST_CASE("match: the gradient is the slope of the likelihood, and both functions agree on it") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    const OccupancyGrid grid = mapped(2.5, 1.8, random);
    const auto points = seen(SE2(0.3, 0.1, 0.4), 2.5, 1.8, random, 0.01);
    const EndPointModel model{};
    int near = 0;
    for (int trial = 0; trial < 60; ++trial) {
      const SE2 pose(0.3 + random.uniform(-0.03, 0.03), 0.1 + random.uniform(-0.03, 0.03),
                     0.4 + random.uniform(-0.01, 0.01));
      const ScanLikelihood at = evaluate(grid, points, pose, model);
      REQUIRE(at.log_likelihood == doctest::Approx(log_likelihood(grid, points, pose, model)).epsilon(1e-6));
      // Points that cross into another cell step to another obstacle, the more of them the larger the step
      // is: most trials agree, not all.
      const double h = 2e-6;
      for (int k = 0; k < 3; ++k) {
        Vector<3> d = Vector<3>::Zero();
        d(k) = h;
        const double slope = (log_likelihood(grid, points, retract(pose, d), model) -
                              log_likelihood(grid, points, retract(pose, Vector<3>(-d)), model)) /
                             (2 * h);
        near += std::abs(slope - at.gradient(k)) < 1e-3 * (1 + at.gradient.norm());
      }
    }
    CHECK(near > 160);  // of 180
  }

  TEST_CASE("match: never worse than its start, and finite far from any map") {
    Random random(5);
    const OccupancyGrid grid = mapped(2.5, 1.8, random);
    const auto points = seen(SE2(), 2.5, 1.8, random, 0.01);
    for (int trial = 0; trial < 200; ++trial) {
      const SE2 start(random.uniform(-6, 6), random.uniform(-6, 6), random.uniform(-3, 3));
      const MatchResult found = match(grid, points, start, start, Matrix<3>::Zero());
      REQUIRE(found.log_likelihood >= log_likelihood(grid, points, start, {}) - 1e-5);
      REQUIRE(std::isfinite(found.pose.x() + found.pose.y() + found.pose.angle()));
      REQUIRE(all_finite(found.information));
    }
    const MatchResult empty = match(OccupancyGrid(), points, SE2(), SE2(), Matrix<3>::Zero());
    CHECK(empty.status == MatchStatus::few_inliers);
    CHECK(std::string_view(explain(empty.status)).starts_with("few inliers"));
    CHECK(match(grid, {}, SE2(), SE2(), Matrix<3>::Zero()).status == MatchStatus::few_inliers);
    CHECK(std::isfinite(log_likelihood(grid, points, SE2(1e15, 0, 0), {})));
  }

  TEST_CASE("match: with the smallest sigma that a model may have all numbers are finite") {
    OccupancyGrid grid;
    grid.insert(SE2(), {{1, 1}, {1.05, 1}, {1.1, 1}, {1.15, 1}});
    const EndPointModel sharp{.sigma = 1e-6};
    REQUIRE(sharp.valid());
    const std::vector<ScanPoint> points{{1, 1}, {1.07, 1.01}, {3, 3}, {1e3, -1e3}};
    const ScanLikelihood at = evaluate(grid, points, SE2(), sharp);
    CHECK(std::isfinite(at.log_likelihood));
    CHECK(all_finite(at.gradient));
    CHECK(all_finite(at.curvature));
  }

  TEST_CASE("match: a model out of its ranges breaks its promise") {
    const OccupancyGrid grid;
    MatchOptions options;
    for (const double sigma : {0.0, 1e-25, -1.0}) {  // the second's square is no float
      options.model.sigma = sigma;
      CHECK_FALSE(cairn_test::violation_of([&] {
                    static_cast<void>(match(grid, {}, SE2(), SE2(), Matrix<3>::Zero(), options));
                  }).empty());
    }
  }
}

}  // namespace match_test
