// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "guided_matching.hpp"

#include <array>
#include <vector>

#include <doctest/doctest.h>

#include "descriptor_distance.hpp"
#include "support/rigs.hpp"

namespace guided_matching_test {
namespace {

using cairn::Vector;
using stereo_slam::ExpectedLandmark;
using stereo_slam::FreePoint;

const std::array<float, 20> bright{1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0},
    nearly{0.98F, 0.2F, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0},
    other{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};

FreePoint point(std::uint32_t number, const Vector<3>& place, std::span<const float> look, double off = 0,
                std::int8_t sign = 1) {
  const Vector<4> pixels = cairn_test::rectified_rig().project(place).value();
  return {number, {pixels(0) + off, pixels(1)}, {pixels(2) + off, pixels(3)}, {look, sign}};
}

}  // namespace

TEST_SUITE("guided_matching") {
  TEST_CASE("guided_matching: near, alike and of one sign, one to one, most alike first") {
    const cairn::StereoRig rig = cairn_test::rectified_rig();
    const Vector<3> a(0.2, 0.1, 4), b(-0.5, 0.2, 5), behind(0, 0, -3);
    const std::vector<ExpectedLandmark> landmarks{
        {7, a, {bright, 1}}, {8, a, {nearly, 1}}, {9, b, {bright, 1}}, {10, behind, {bright, 1}}};
    const auto matches =
        stereo_slam::match_guided(rig, cairn::SE3(),
                                  {point(0, a, nearly, 3), point(1, a, bright, -2), point(2, b, other),
                                   point(3, b, bright, 9), point(4, b, bright, 0, -1)},
                                  landmarks, {.radius = 8, .max_distance = 0.45});
    REQUIRE(matches.size() == 2);
    CHECK(matches[0].point == 0);
    CHECK(matches[0].landmark == 8);
    CHECK(matches[1].point == 1);
    CHECK(matches[1].landmark == 7);
  }

  TEST_CASE("guided_matching: the order of what is given does not matter, nothing gives nothing") {
    const cairn::StereoRig rig = cairn_test::rectified_rig();
    const Vector<3> a(0.2, 0.1, 4);
    const std::vector<ExpectedLandmark> one{{7, a, {bright, 1}}, {8, a, {bright, 1}}},
        two{{8, a, {bright, 1}}, {7, a, {bright, 1}}};
    const std::vector<FreePoint> points{point(0, a, bright), point(1, a, bright, 2)};
    const auto first = stereo_slam::match_guided(rig, cairn::SE3(), points, one, {});
    const auto second = stereo_slam::match_guided(rig, cairn::SE3(), {points[1], points[0]}, two, {});
    REQUIRE(first.size() == 2);
    REQUIRE(second.size() == 2);
    for (std::size_t i = 0; i < 2; ++i) {
      CHECK(first[i].point == second[i].point);
      CHECK(first[i].landmark == second[i].landmark);
    }
    CHECK(stereo_slam::match_guided(rig, cairn::SE3(), {}, one, {}).empty());
    CHECK(stereo_slam::match_guided(rig, cairn::SE3(), points, {}, {}).empty());
  }

  TEST_CASE("descriptor_distance: the sum of squares at every length") {
    std::vector<float> a, b;
    float expected = 0;
    for (int i = 0; i < 70; ++i) {
      CHECK(stereo_slam::squared_distance(a, b) == doctest::Approx(expected));
      a.push_back(static_cast<float>(i));
      b.push_back(static_cast<float>(2 * i % 7));
      expected += (a.back() - b.back()) * (a.back() - b.back());
    }
  }
}

}  // namespace guided_matching_test
