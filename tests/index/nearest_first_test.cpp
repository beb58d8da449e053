// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/brute_force.hpp>
#include <cairn/index/nearest_first.hpp>

#include "index/generators.hpp"
#include "support/random.hpp"

TEST_SUITE("nearest_first") {
  TEST_CASE("nearest_first: gives every point once, in the order of brute force") {
    const std::uint64_t seed = cairn_test::seed(51);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const std::string& shape : cairn_test::shapes())
      for (const std::size_t dim : {std::size_t{1}, std::size_t{3}, std::size_t{11}}) {
        CAPTURE(shape);
        const auto numbers = cairn_test::make_points<double>(shape, 500, dim, random);
        const cairn::Rows<double> points(numbers, dim);
        const cairn::KdTree<double> tree(points);
        const auto query = cairn_test::make_points<double>("uniform", 1, dim, random);
        const auto expected = cairn::BruteForce<double>(points).nearest(query, 500);
        cairn::NearestFirst order(tree, query);
        std::vector<bool> seen(500, false);
        for (const auto& hit : expected) {
          const auto next = order.next();
          REQUIRE(next.has_value());
          REQUIRE(next->distance == doctest::Approx(hit.distance).epsilon(1e-9));
          REQUIRE_FALSE(seen[next->id]);
          seen[next->id] = true;
        }
        CHECK_FALSE(order.next().has_value());
        CHECK_FALSE(order.next().has_value());
      }
  }

  TEST_CASE("nearest_first: an empty tree gives nothing") {
    const cairn::KdTree<float, 3> tree;
    cairn::NearestFirst order(tree, std::vector<float>{0, 0, 0});
    CHECK_FALSE(order.next().has_value());
  }
}
