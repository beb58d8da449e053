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
#include <cairn/index/quantised_tree.hpp>

#include "index/generators.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"

namespace {

using Points = cairn::Rows<float>;
using Tree = cairn::QuantisedTree<Points>;

}  // namespace

TEST_SUITE("quantised_tree") {
  TEST_CASE("quantised_tree: without a budget it answers like brute force, whatever the points") {
    cairn::Random random(cairn_test::seed(81));
    Tree::Search search;
    for (const std::string& shape : cairn_test::shapes())
      for (const std::size_t dim : {1U, 3U, 40U})
        for (const std::size_t count : {1U, 30U, 600U}) {
          CAPTURE(shape);
          CAPTURE(dim);
          CAPTURE(count);
          const auto numbers = cairn_test::make_points<float>(shape, count, dim, random);
          const Points points(numbers, dim);
          const Tree tree(points);
          const cairn::BruteForce<float> brute(points);
          REQUIRE(tree.size() == count);
          for (int round = 0; round < 8; ++round) {
            auto query = cairn_test::make_points<float>(round % 2 == 0 ? shape : "uniform", 1, dim, random);
            if (round == 7) query[0] = 1e12F;  // far from everything
            const auto expected = brute.nearest(query, 5);
            std::vector<cairn::Neighbor<float>> found(expected.size());
            cairn::KNearest<float> collector(found.data(), found.size());
            REQUIRE(search.search(tree, query, collector));
            collector.restore(cairn::L2{});
            REQUIRE(collector.size() == expected.size());
            for (std::size_t i = 0; i < found.size(); ++i)
              REQUIRE(found[i].distance == doctest::Approx(expected[i].distance).epsilon(1e-5));
          }
        }
  }

  TEST_CASE("quantised_tree: distances are exact under a budget too, and few are measured") {
    cairn::Random random(cairn_test::seed(82));
    const auto numbers = cairn_test::make_points<float>("uniform", 5000, 32, random);
    const Points points(numbers, 32);
    const Tree tree(points);
    CHECK(tree.bytes() < 5000 * (32 + 6));
    Tree::Search search;
    std::size_t measured = 0;
    cairn::Work work;
    for (int i = 0; i < 100; ++i) {
      const auto query = cairn_test::make_points<float>("uniform", 1, 32, random);
      cairn::NearestTwo<float> two;
      search.search(tree, query, two, {.leaves = 20}, &work, &measured);
      float reduced = 0;
      for (std::size_t a = 0; a < 32; ++a)
        reduced += (query[a] - points[two.id()][a]) * (query[a] - points[two.id()][a]);
      CHECK(two.first() == doctest::Approx(reduced).epsilon(1e-6));
    }
    CHECK(work.leaves == 2000);
    CHECK(measured < work.distances / 10);
  }

  TEST_CASE("quantised_tree: nothing in it, and bad input") {
    using cairn_test::message_of;
    const std::vector<std::array<float, 2>> none;
    using Small = cairn::QuantisedTree<std::vector<std::array<float, 2>>, 2>;
    Small::Search search;
    cairn::NearestTwo<float> two;
    CHECK(search.search(Small(none), std::array{1.0F, 2.0F}, two));
    std::vector<std::array<float, 2>> points(20, {1, 2});
    const Small tree(points);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    CHECK(message_of([&] { search.search(tree, std::array{1.0F, nan}, two); }).find("coordinate 1 is nan") !=
          std::string::npos);
    points[3][1] = nan;
    CHECK(message_of([&] { Small bad(points); }).find("QuantisedTree: point 3, coordinate 1") !=
          std::string::npos);
  }
}
