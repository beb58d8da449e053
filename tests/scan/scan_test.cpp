// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/scan/scan.hpp>

#include "support/folder.hpp"

namespace scan_test {
namespace {

using namespace cairn;

}  // namespace

TEST_SUITE("scan/scan") {
  TEST_CASE("scan: every range is a hit, no return or nothing") {
    LaserScan scan{.first_angle = 0, .angle_step = 0.1, .nearest = 0.1, .farthest = 10};
    scan.range = {0.0F,
                  0.05F,
                  1.0F,
                  9.99F,
                  10.0F,
                  80.0F,
                  std::numeric_limits<float>::infinity(),
                  -1.0F,
                  std::numeric_limits<float>::quiet_NaN()};
    const BeamKind expected[] = {BeamKind::invalid,   BeamKind::invalid,   BeamKind::hit,
                                 BeamKind::hit,       BeamKind::no_return, BeamKind::no_return,
                                 BeamKind::no_return, BeamKind::invalid,   BeamKind::invalid};
    for (std::size_t i = 0; i < scan.size(); ++i) CHECK(scan.kind(i) == expected[i]);
    const auto points = scan_points(scan);
    REQUIRE(points.size() == 2);
    CHECK(points[0].x == doctest::Approx(std::cos(0.2)));
    CHECK(points[1].y == doctest::Approx(9.99 * std::sin(0.3)));
  }

  TEST_CASE("scan: thinned points keep their distance, in order, and the first stays") {
    std::vector<ScanPoint> points;
    for (int i = 0; i < 100; ++i) points.push_back({0.03 * i, 1});
    const auto few = thinned(points, 0.1);
    CHECK(few.front().x == 0);
    for (std::size_t i = 1; i < few.size(); ++i) CHECK(few[i].x - few[i - 1].x == doctest::Approx(0.12));
    CHECK(thinned(points, 0).size() == points.size());
    CHECK(thinned({}, 1).empty());
  }

  TEST_CASE("scan: angles that are no numbers are refused in words") {
    LaserScan scan{.first_angle = std::nan(""), .angle_step = 0.1};
    scan.range = {1.0F};
    CHECK(cairn_test::message_of([&] { static_cast<void>(scan_points(scan)); }).find("finite") !=
          std::string::npos);
  }
}

}  // namespace scan_test
