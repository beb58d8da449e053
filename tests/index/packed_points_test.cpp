// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/brute_force.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/packed_points.hpp>

#include "index/generators.hpp"
#include "support/folder.hpp"
#include "support/processors.hpp"
#include "support/random.hpp"

namespace packed_points_test {
namespace {

using cairn::Rows;
using cairn::TwoNearest;

/// Distances from differences, in the order of the set, as nearest_two() promises.
std::vector<TwoNearest> by_definition(const std::vector<float>& points, const std::vector<float>& queries,
                                      std::size_t dim) {
  std::vector<TwoNearest> found;
  const cairn::BruteForce<float> brute(Rows<float>(points, dim));
  for (std::size_t i = 0; i < queries.size() / dim; ++i) {
    const auto hits = brute.nearest(Rows<float>(queries, dim)[i], 2);
    TwoNearest two;
    if (!hits.empty()) {
      two.id = hits[0].id;
      two.first = hits[0].distance;
    }
    if (hits.size() > 1) {
      two.second_id = hits[1].id;
      two.second = hits[1].distance;
    }
    found.push_back(two);
  }
  return found;
}

std::size_t differing(const std::vector<TwoNearest>& found, const std::vector<TwoNearest>& expected) {
  REQUIRE(found.size() == expected.size());
  const auto same = [](float a, float b) { return a == b || std::abs(a - b) <= 1e-5F * b; };
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    wrong += !same(found[i].first, expected[i].first) || !same(found[i].second, expected[i].second) ||
             (found[i].id == cairn::no_point) != (expected[i].id == cairn::no_point) ||
             (found[i].id != cairn::no_point && found[i].id == found[i].second_id);
  return wrong;
}

}  // namespace

TEST_SUITE("packed_points") {
  TEST_CASE("packed_points: the two nearest are those of brute force, whatever the points and sizes") {
    cairn::Random random(cairn_test::seed(51));
    for (const std::string& shape : cairn_test::shapes())
      for (const std::size_t dim : {1U, 3U, 64U, 131U})
        for (const std::size_t count : {0U, 1U, 2U, 16U, 17U, 300U}) {
          const auto points = cairn_test::make_points<float>(shape, count, dim, random);
          for (const std::size_t asked : {1U, 13U, 200U}) {
            if (dim * count * asked > 1000000) continue;
            CAPTURE(shape);
            CAPTURE(dim);
            CAPTURE(count);
            auto queries = cairn_test::make_points<float>(shape, asked, dim, random);
            if (count > 0) std::copy_n(points.begin(), dim, queries.begin());
            const cairn::PackedPoints packed{Rows<float>(points, dim)};
            REQUIRE(packed.size() == count);
            const auto found = nearest_two(packed, Rows<float>(queries, dim));
            REQUIRE(differing(found, by_definition(points, queries, dim)) == 0);
          }
        }
  }

  TEST_CASE(
      "packed_points: distances whose squares are below the least normal number are those of brute force") {
    cairn::Random random(cairn_test::seed(57));
    for (int round = 0; round < 60; ++round) {
      constexpr std::size_t dim = 40;
      std::vector<float> points, queries;
      for (std::size_t i = 0; i < 60 * dim; ++i)
        points.push_back(static_cast<float>(1e-22 * random.normal()));
      for (std::size_t i = 0; i < 30 * dim; ++i)
        queries.push_back(static_cast<float>(1e-22 * random.normal()));
      const cairn::PackedPoints packed{Rows<float>(points, dim)};
      CHECK(differing(cairn::nearest_two(packed, Rows<float>(queries, dim)),
                      by_definition(points, queries, dim)) == 0);
    }
  }

  TEST_CASE("packed_points: panels, tiles, threads and vector widths change nothing") {
    cairn::Random random(cairn_test::seed(52));
    const auto points = cairn_test::make_points<float>("uniform", 3000, 64, random);
    const auto queries = cairn_test::make_points<float>("uniform", 500, 64, random);
    const cairn::PackedPoints packed{Rows<float>(points, 64)};
    const auto found = nearest_two(packed, Rows<float>(queries, 64));
    CHECK(differing(found, by_definition(points, queries, 64)) == 0);
    CHECK(nearest_two(packed, Rows<float>(queries, 64), 3) == found);
    CHECK(nearest_two(packed, Rows<float>(queries, 64), 100) == found);
    cairn_test::for_each_processor(
        [&] { CHECK(differing(nearest_two(packed, Rows<float>(queries, 64)), found) == 0); });
  }

  TEST_CASE("packed_points: distances are those of a kd-tree to the last bit") {
    cairn::Random random(cairn_test::seed(53));
    const auto points = cairn_test::make_points<float>("clusters", 700, 24, random);
    const auto queries = cairn_test::make_points<float>("clusters", 100, 24, random);
    const cairn::KdTree<float> tree(Rows<float>(points, 24));
    const auto found = nearest_two(cairn::PackedPoints(Rows<float>(points, 24)), Rows<float>(queries, 24));
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto hits = tree.nearest(Rows<float>(queries, 24)[i], 2);
      wrong += found[i].first != hits[0].distance || found[i].second != hits[1].distance;
    }
    CHECK(wrong == 0);
  }

  TEST_CASE("packed_points: matches are those of the ratio test, query by query") {
    cairn::Random random(cairn_test::seed(54));
    constexpr std::size_t count = 1200;
    const auto points = cairn_test::make_points<float>("lattice", 100, 3, random);
    auto queries = cairn_test::make_points<float>("uniform", count, 3, random);
    for (float& number : queries) number *= 3;  // about a third of the 64 places has one point, for a match
    const cairn::PackedPoints packed{Rows<float>(points, 3)};
    const cairn::KdTree<float, 3> tree{Rows<float>(points, 3)};
    for (const cairn::RatioTest test : {cairn::RatioTest{1.25F}, cairn::RatioTest{1.0F, 0.5F}}) {
      std::vector<cairn::Match> expected;
      for (std::size_t i = 0; i < count; ++i) {
        cairn::RatioTestMatch<float> verdict(test, cairn::L2{});
        tree.search(Rows<float>(queries, 3)[i], verdict);
        if (verdict.accepted()) expected.push_back({i, verdict.id(), verdict.first()});
      }
      const auto matches = match(packed, Rows<float>(queries, 3), test);
      REQUIRE(matches.size() == expected.size());
      CHECK(matches.size() > 20);
      for (std::size_t i = 0; i < matches.size(); ++i) {
        CHECK(matches[i].query == expected[i].query);
        CHECK(matches[i].distance == expected[i].distance);
      }
    }
  }

  TEST_CASE("packed_points: nothing to find and bad queries") {
    using cairn_test::message_of;
    const std::vector<std::array<float, 2>> none;
    const std::vector<std::array<float, 2>> one{{3, 4}};
    CHECK(nearest_two(cairn::PackedPoints(none), one) == std::vector<TwoNearest>(1));
    CHECK(nearest_two(cairn::PackedPoints(one), none).empty());
    CHECK(match(cairn::PackedPoints(one), none).empty());
    const std::vector<std::array<float, 2>> origin{{0, 0}};
    const auto found = nearest_two(cairn::PackedPoints(one), origin);
    CHECK(found[0].first == 5);
    CHECK(found[0].second_id == cairn::no_point);
    CHECK(match(cairn::PackedPoints(one), origin).size() == 1);  // nothing else is as near
    const std::vector<std::array<float, 3>> wide{{1, 2, 3}};
    CHECK(message_of([&] {
            static_cast<void>(nearest_two(cairn::PackedPoints(one), wide));
          }).find("3 coordinates, expected 2") != std::string::npos);
    const std::vector<std::array<float, 2>> bad{{0, std::numeric_limits<float>::quiet_NaN()}};
    CHECK(message_of([&] {
            static_cast<void>(nearest_two(cairn::PackedPoints(one), bad));
          }).find("nearest_two: query 0, coordinate 1 is nan") != std::string::npos);
  }
}

}  // namespace packed_points_test
