// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/random.hpp>
#include <cairn/scan/independence.hpp>

#include "floor_plan.hpp"
#include "occupancy_map.hpp"
#include "support/random.hpp"

namespace spread_test {
namespace {

using namespace cairn;
using namespace grid_slam;

constexpr double sigma = 0.03, share = 0.5;  // of end points [m]; what a beam's error keeps of the last one's

/// Errors of a scan's end points, alike to either axis, and so across every wall.
std::vector<Vector<2>> drawn_errors(Random& random, std::size_t count) {
  std::vector<Vector<2>> errors;
  Vector<2> at(random.normal(), random.normal());
  for (std::size_t i = 0; i < count; ++i) {
    errors.emplace_back(sigma * at);
    at = share * at + std::sqrt(1 - share * share) * Vector<2>(random.normal(), random.normal());
  }
  return errors;
}

}  // namespace

TEST_SUITE("grid_slam/spread") {
  TEST_CASE(
      "spread: with the independence that the errors show, poses lie in the proposal's Gaussian as often "
      "as it says; with all beams taken for independent they do not") {
    const std::uint64_t seed = cairn_test::seed(11);
    CAPTURE(seed);
    Random random(seed);
    const Drive drive = simulated_drive({.seed = 3, .range_sigma = 0});
    std::vector<std::vector<double>> residuals;
    for (int i = 0; i < 100; ++i) {
      auto& scan = residuals.emplace_back();
      for (const Vector<2>& e : drawn_errors(random, 181)) scan.push_back(e(0));
    }
    const double planted = (1 - share) / (1 + share);
    const auto estimated = independence_of(residuals);
    REQUIRE(estimated);
    CHECK(*estimated == doctest::Approx(planted).epsilon(0.3).scale(0));

    OccupancyMap map{OccupancyGrid({.geometry = {}, .field_radius = 6}), {}};
    for (std::size_t i = 0; i < 240; i += 2) map.insert(drive.truth[i], scan_points(drive.log.scans[i].scan));
    const Matrix<3> noise = Vector<3>(0.05 * 0.05, 0.05 * 0.05, 0.03 * 0.03).asDiagonal();
    const auto nees = [&](double independence) {
      map.model = {.sigma = sigma, .outliers = 0.01, .independence = independence};
      Random draws(seed, 1);
      double sum = 0;
      std::size_t count = 0;
      for (std::size_t i = 21; i < 220; i += 1) {
        std::vector<ScanPoint> points = scan_points(drive.log.scans[i].scan);
        const auto errors = drawn_errors(draws, points.size());
        for (std::size_t k = 0; k < points.size(); ++k) {
          points[k].x += errors[k](0);
          points[k].y += errors[k](1);
        }
        const SE2 guess = sample(Gaussian<SE2>{drive.truth[i], noise}, draws);
        const auto found = FromMatch{}.found(map, {guess, noise}, points);
        REQUIRE(found);
        const Cholesky<3> root(found->covariance);
        REQUIRE(root.good());
        sum += root.whiten(local(found->mean, drive.truth[i])).squaredNorm();
        ++count;
      }
      return sum / static_cast<double>(count);
    };
    // 199 poses: the mean of as many chi-squares of three degrees of freedom has a deviation of 0.17; four of
    // them, for any seed.
    const double calibrated = nees(*estimated), all = nees(1);
    CAPTURE(calibrated);
    CAPTURE(all);
    CHECK(calibrated > 3 - 4 * 0.174);
    CHECK(calibrated < 3 + 4 * 0.174);
    CHECK(all > 5);
  }
}

}  // namespace spread_test
