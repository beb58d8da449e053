// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/shared_array.hpp>
#include <cairn/index/shared_kd_tree.hpp>

#include "support/random.hpp"

namespace shared_trees_test {
namespace {

using Tree = cairn::SharedKdTree<2>;
using Point = Tree::Point;

/// Counts how many of it are alive.
struct Lives {
  static inline int alive = 0;
  int value = 0;
  Lives() { ++alive; }
  explicit Lives(int v) : value(v) { ++alive; }
  Lives(const Lives& o) : value(o.value) { ++alive; }
  Lives& operator=(const Lives&) = default;
  ~Lives() { --alive; }
};

std::set<std::uint32_t> in_box(const Tree& tree, const Point& low, const Point& high) {
  std::set<std::uint32_t> ids;
  tree.for_each_in_box(low, high, [&](std::uint32_t id, const Point&) { CHECK(ids.insert(id).second); });
  return ids;
}
std::set<std::uint32_t> in_box(const std::map<std::uint32_t, Point>& points, const Point& low,
                               const Point& high) {
  std::set<std::uint32_t> ids;
  for (const auto& [id, p] : points)
    if (low[0] <= p[0] && p[0] <= high[0] && low[1] <= p[1] && p[1] <= high[1]) ids.insert(id);
  return ids;
}

/// Points of one of four kinds: spread, on a line, on a coarse lattice (many equal numbers), all equal.
Point point_of(int kind, cairn::Random& random) {
  switch (kind) {
    case 0:
      return {random.uniform(-50, 50), random.uniform(-50, 50)};
    case 1:
      return {random.uniform(-50, 50), 2};
    case 2:
      return {static_cast<double>(random.below(6)), static_cast<double>(random.below(6))};
    default:
      return {1, 1};
  }
}

}  // namespace

TEST_SUITE("index/shared_trees") {
  TEST_CASE("shared_array: many copies, written in any order, are what plain copies are; nothing leaks") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const int before = Lives::alive;
    {
      std::vector<cairn::SharedArray<Lives>> shared(6);
      std::vector<std::map<std::size_t, int>> plain(6);
      for (int step = 0; step < 4000; ++step) {
        const std::size_t from = random.below(6), to = random.below(6);
        if (random.uniform() < 0.1) {
          shared[to] = shared[from];
          plain[to] = plain[from];
        } else {
          const std::size_t i = random.below(random.uniform() < 0.01 ? 70000 : 700);
          shared[to].write(i) = Lives(step);
          plain[to][i] = step;
        }
      }
      for (std::size_t k = 0; k < 6; ++k) {
        REQUIRE(shared[k].size() == (plain[k].empty() ? 0 : plain[k].rbegin()->first + 1));
        for (std::size_t i = 0; i < shared[k].size() + 5; ++i) {
          const auto at = plain[k].find(i);
          REQUIRE(shared[k][i].value == (at == plain[k].end() ? 0 : at->second));
        }
      }
    }
    CHECK(Lives::alive == before);
  }

  TEST_CASE("shared_array: a write after a copy copies one node a level, the next to the same leaf none") {
    for (const std::size_t n : {100U, 1000U, 10000U, 50000U}) {
      cairn::SharedArray<int> all;
      for (std::size_t i = 0; i < n; ++i) all.write(i) = 1;
      cairn::SharedArray<int> copy = all;
      copy.write(n / 2) = 2;
      const auto levels = static_cast<std::size_t>(std::ceil(std::log2(double(n)) / 4));
      CHECK(copy.node_copies() - all.node_copies() == levels);
      copy.write(n / 2 ^ 1U) = 2;
      CHECK(copy.node_copies() - all.node_copies() == levels);
      CHECK(all[n / 2] == 1);
    }
  }

  TEST_CASE("shared_kd_tree: after any insertions, erasures and copies a box holds what it should") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int kind = 0; kind < 4; ++kind) {
      CAPTURE(kind);
      std::vector<Tree> trees(4);
      std::vector<std::map<std::uint32_t, Point>> plain(4);
      for (std::uint32_t step = 0; step < 3000; ++step) {
        const std::size_t from = random.below(4), to = random.below(4);
        const double what = random.uniform();
        if (what < 0.03) {
          trees[to] = trees[from];
          plain[to] = plain[from];
        } else if (what < 0.3 && !plain[to].empty()) {
          auto victim = plain[to].lower_bound(static_cast<std::uint32_t>(random.below(step)));
          if (victim == plain[to].end()) victim = plain[to].begin();
          REQUIRE(trees[to].erase(victim->second, victim->first));
          REQUIRE_FALSE(trees[to].erase(victim->second, victim->first));
          plain[to].erase(victim);
        } else {
          const Point p = point_of(kind, random);
          trees[to].insert(p, step);
          plain[to][step] = p;
        }
        if (step % 50 != 0) continue;
        for (std::size_t k = 0; k < 4; ++k) {
          REQUIRE(trees[k].size() == plain[k].size());
          Point low{random.uniform(-60, 10), random.uniform(-60, 10)};
          if (!plain[k].empty() && step % 100 == 0) {  // a corner on a point, which may be a median
            auto corner = plain[k].lower_bound(static_cast<std::uint32_t>(random.below(step + 1)));
            low = corner == plain[k].end() ? plain[k].begin()->second : corner->second;
          }
          const Point high{low[0] + random.uniform(0, 60), low[1] + random.uniform(0, 60)};
          REQUIRE(in_box(trees[k], low, high) == in_box(plain[k], low, high));
          REQUIRE(in_box(trees[k], {-60, -60}, {60, 60}).size() == plain[k].size());
        }
      }
    }
  }

  TEST_CASE("shared_kd_tree: ways and copies grow like the logarithm, also where points arrive sorted") {
    for (const bool sorted : {false, true})
      for (const std::uint32_t n : {100U, 1000U, 10000U, 50000U}) {
        CAPTURE(sorted);
        CAPTURE(n);
        cairn::Random random(7);
        Tree tree;
        for (std::uint32_t i = 0; i < n; ++i)
          tree.insert(sorted ? Point{double(i), 0} : point_of(0, random), i);
        const double least = std::log2(double(n) / 16);
        CHECK(double(tree.depth()) < 2 * least + 5);
        std::size_t most = 0;
        for (int run = 0; run < 200; ++run) {
          Tree copy = tree;
          copy.insert(sorted ? Point{random.uniform(0, n), 0} : point_of(0, random), n);
          most = std::max(most, copy.node_copies() - tree.node_copies());
        }
        CHECK(double(most) <= double(tree.depth()) + 1);
        CHECK(tree.size() == n);
      }
  }

  TEST_CASE("shared_kd_tree: a point that is no number is refused") {
    Tree tree;
    CHECK_THROWS_AS(tree.insert({0, std::nan("")}, 1), cairn::Error);
    CHECK(tree.size() == 0);
    CHECK_FALSE(tree.erase({0, 0}, 1));
  }
}

}  // namespace shared_trees_test
