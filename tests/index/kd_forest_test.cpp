// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/brute_force.hpp>
#include <cairn/index/kd_forest.hpp>

#include "index/generators.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"

namespace kd_forest_test {
namespace {

using cairn::Rows;
using Forest = cairn::KdForest<>;

/// Wants whatever is looked at.
struct Everything {
  std::set<cairn::PointId> ids;
  [[nodiscard]] float limit() const { return std::numeric_limits<float>::infinity(); }
  void offer(cairn::PointId id, float) { ids.insert(id); }
};

}  // namespace

TEST_SUITE("kd_forest") {
  TEST_CASE("kd_forest: without a budget the answers are those of brute force, each point once") {
    cairn::Random random(cairn_test::seed(71));
    cairn::BestBinFirst<Forest> search;
    for (const std::string shape : {"uniform", "clusters", "line", "lattice", "equal"})
      for (const std::size_t dim : {2U, 17U})
        for (const std::size_t count : {1U, 40U, 500U}) {
          CAPTURE(shape);
          CAPTURE(count);
          const auto numbers = cairn_test::make_points<float>(shape, count, dim, random);
          const Forest forest(Rows<float>(numbers, dim), {.trees = 3, .turned_axes = 8});
          REQUIRE(forest.size() == count);
          REQUIRE(cairn::detail::KdForestAccess::trees(forest).size() == 3);
          const cairn::BruteForce<float> brute(Rows<float>(numbers, dim));
          for (int round = 0; round < 8; ++round) {
            const auto query = cairn_test::make_points<float>(shape, 1, dim, random);
            const auto expected = brute.nearest(query, 10);
            std::vector<cairn::Neighbor<float>> found(expected.size());
            cairn::KNearest<float> collector(found.data(), found.size());
            REQUIRE(search.search(forest, query, collector));
            collector.restore(cairn::L2{});
            REQUIRE(collector.size() == expected.size());
            std::set<cairn::PointId> ids;
            for (std::size_t i = 0; i < found.size(); ++i) {
              ids.insert(found[i].id);
              REQUIRE(std::abs(found[i].distance - expected[i].distance) <
                      1e-4F * (1 + expected[i].distance));
            }
            REQUIRE(ids.size() == found.size());
          }
        }
  }

  TEST_CASE("kd_forest: the budget is for all trees together, and the trees differ") {
    cairn::Random random(cairn_test::seed(72));
    const auto numbers = cairn_test::make_points<float>("uniform", 3000, 20, random);
    const Forest forest(Rows<float>(numbers, 20), {.trees = 4, .turned_axes = 20});
    const Forest again(Rows<float>(numbers, 20), {.trees = 4, .turned_axes = 20});
    cairn::BestBinFirst<Forest> search;
    std::size_t right = 0;
    std::size_t right_alone = 0;
    const Forest alone(Rows<float>(numbers, 20), {.trees = 1});
    for (std::size_t i = 0; i < 100; ++i) {
      const auto query = Rows<float>(numbers, 20)[30 * i];
      cairn::NearestTwo<float> two;
      cairn::NearestTwo<float> same;
      cairn::NearestTwo<float> one;
      cairn::Work work;
      search.search(forest, query, two, {.leaves = 12}, &work);
      CHECK(work.leaves <= 12);
      search.search(again, query, same, {.leaves = 12});
      CHECK(two.id() == same.id());
      CHECK(two.second_id() == same.second_id());
      CHECK(two.id() != two.second_id());
      search.search(alone, query, one, {.leaves = 12});
      right += two.id() == 30 * i;
      right_alone += one.id() == 30 * i;
    }
    CHECK(right == 100);  // the query's own leaf is the first in every tree
    CHECK(right_alone == 100);
    const auto* first =
        cairn::detail::TreeAccess::blocks(cairn::detail::KdForestAccess::trees(forest)[1]).ids(0);
    const auto* second =
        cairn::detail::TreeAccess::blocks(cairn::detail::KdForestAccess::trees(forest)[2]).ids(0);
    CHECK(!std::equal(first, first + 16, second));
  }

  TEST_CASE("kd_forest: with a leaf a tree, what is looked at is each tree's own leaf of the query") {
    cairn::Random random(cairn_test::seed(73));
    const auto numbers = cairn_test::make_points<float>("uniform", 3000, 20, random);
    const Forest forest(Rows<float>(numbers, 20), {.trees = 4, .turned_axes = 20});
    cairn::BestBinFirst<Forest> search;
    int same = 0;
    for (cairn::PointId id = 0; id < 3000; id += 30) {
      std::set<cairn::PointId> expected;
      for (const auto& tree : cairn::detail::KdForestAccess::trees(forest))
        for (std::size_t leaf = 0; leaf < cairn::detail::TreeAccess::blocks(tree).leaves(); ++leaf) {
          const std::set<cairn::PointId> ids(cairn::detail::TreeAccess::blocks(tree).ids(leaf),
                                             cairn::detail::TreeAccess::blocks(tree).ids(leaf) + 16);
          if (ids.count(id) != 0) expected.insert(ids.begin(), ids.end());
        }
      expected.erase(cairn::no_point);
      Everything all;
      search.search(forest, Rows<float>(numbers, 20)[id], all, {.leaves = 4});
      same += all.ids == expected ? 1 : 0;
    }
    CHECK(same > 90);  // a point that a leaf was split at stands on the other side of that split
  }

  TEST_CASE("kd_forest: nothing in it, and bad input") {
    using cairn_test::message_of;
    cairn::BestBinFirst<Forest> search;
    cairn::NearestTwo<float> two;
    const std::vector<std::array<float, 2>> none;
    CHECK(search.search(Forest(none), std::array{1.0F, 2.0F}, two));
    CHECK(two.id() == cairn::no_point);
    std::vector<std::array<float, 2>> points(20, {1, 2});
    const Forest forest(points, {.trees = 2});
    CHECK(message_of([&] {
            search.search(forest, std::array{1.0F}, two);
          }).find("1 coordinates, expected 2") != std::string::npos);
    points[3][1] = std::numeric_limits<float>::infinity();
    CHECK(message_of([&] { Forest bad(points); }).find("KdForest: point 3, coordinate 1") !=
          std::string::npos);
  }
}

}  // namespace kd_forest_test
