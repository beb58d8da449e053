// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/box_query.hpp>

#include "index/generators.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"

TEST_SUITE("box_query") {
  TEST_CASE("box_query: finds what a look at every point finds, bounds included") {
    const std::uint64_t seed = cairn_test::seed(41);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const std::string& shape : cairn_test::shapes()) {
      CAPTURE(shape);
      const auto numbers = cairn_test::make_points<float>(shape, 800, 3, random);
      const cairn::Rows<float> points(numbers, 3);
      const cairn::KdTree<float, 3> tree(points);
      for (int round = 0; round < 30; ++round) {
        std::array<float, 3> low{};
        std::array<float, 3> high{};
        const auto corner = points[random.below(800)];  // bounds on a point: it must be found
        for (std::size_t a = 0; a < 3; ++a) {
          low[a] = corner[a];
          high[a] = low[a] + static_cast<float>(random.uniform(-0.05, 0.7));
        }
        std::vector<cairn::PointId> expected;
        for (std::size_t i = 0; i < 800; ++i) {
          bool within = true;
          for (std::size_t a = 0; a < 3; ++a)
            within = within && low[a] <= points[i][a] && points[i][a] <= high[a];
          if (within) expected.push_back(static_cast<cairn::PointId>(i));
        }
        auto found = cairn::inside(tree, low, high);
        std::sort(found.begin(), found.end());
        CHECK(found == expected);
      }
    }
  }

  TEST_CASE("box_query: nothing in nothing, and bad corners are refused") {
    const std::array<float, 2> zero{};
    CHECK(cairn::inside(cairn::KdTree<float, 2>(), zero, zero).empty());
    const cairn::KdTree<float, 2> tree(std::vector<std::array<float, 2>>{{0, 0}});
    CHECK(cairn::inside(tree, zero, zero).size() == 1);
    const std::array bad{0.0F, std::numeric_limits<float>::infinity()};
    CHECK(cairn_test::message_of([&] {
            static_cast<void>(cairn::inside(tree, zero, bad));
          }).find("corner 1, coordinate 1 is inf") != std::string::npos);
  }
}
