// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What a search and an update cost, in counts that no clock disturbs: a change that makes the trees do more
// work turns these red. The bounds are what was counted and 3 % (the last bits of a distance differ between
// processors).
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_kd_tree.hpp>

#include "index/generators.hpp"

namespace work_counters_test {
namespace {

using Tree = cairn::KdTree<float, 3>;
using Forest = cairn::MultiKdTree<float, 3>;
constexpr std::size_t count = 60000;
constexpr std::size_t query_count = 1000;

struct Cost {
  double nodes;
  double leaves;
};

/// Mean work of finding the k nearest, beside the points.
template <class Index>
Cost cost_of(const Index& index, const char* shape, std::size_t k) {
  cairn::Random random(2);
  const auto queries = cairn_test::make_points<float>(shape, query_count, 3, random);
  cairn::Work work;
  std::array<cairn::Neighbor<float>, 10> found;
  for (std::size_t i = 0; i < query_count; ++i) {
    cairn::KNearest<float> nearest(found.data(), k);
    index.search(cairn::Rows<float>(queries, 3)[i], nearest, &work);
  }
  REQUIRE(work.distances == 16 * work.leaves);
  return {static_cast<double>(work.nodes) / query_count, static_cast<double>(work.leaves) / query_count};
}

void check(const Cost& cost, const Cost& counted) {
  INFO("nodes ", cost.nodes, ", leaves ", cost.leaves);
  CHECK(cost.nodes <= 1.03 * counted.nodes);
  CHECK(cost.leaves <= 1.03 * counted.leaves);
}

/// Mean work of finding the 50 nearest of points whose first four of twelve coordinates matter.
Cost cost_of_splits() {
  cairn::Random random(3);
  std::vector<float> rows(12 * count / 4), queries(12 * query_count);
  for (std::vector<float>* numbers : {&rows, &queries})
    for (std::size_t i = 0; i < numbers->size(); ++i)
      (*numbers)[i] = static_cast<float>(random.uniform() * (i % 12 < 4 ? 1 : 0.01));
  const cairn::KdTree<float, 12> tree(cairn::Rows<float>(rows, 12));
  cairn::Work work;
  std::array<cairn::Neighbor<float>, 50> found;
  for (std::size_t i = 0; i < query_count; ++i) {
    cairn::KNearest<float> nearest(found.data(), found.size());
    tree.search(cairn::Rows<float>(queries, 12)[i], nearest, &work);
  }
  return {static_cast<double>(work.nodes) / query_count, static_cast<double>(work.leaves) / query_count};
}

Tree tree_of(const char* shape) {
  cairn::Random random(1);
  const std::vector<float> numbers = cairn_test::make_points<float>(shape, count, 3, random);
  return Tree(cairn::Rows<float>(numbers, 3));
}

struct Row {
  cairn::MultiTreeShape shape;
  Cost counted;
  double moved;
};

Forest grown(const cairn::MultiTreeShape& shape) {
  cairn::Random random(1);
  const auto rows = cairn_test::make_points<float>("uniform", count, 3, random);
  Forest forest(shape);
  for (std::size_t begin = 0; begin < count; begin += 500)
    forest.insert(cairn::Rows<float>(std::span(rows).subspan(3 * begin, 1500), 3));
  return forest;
}

}  // namespace

TEST_SUITE("work_counters") {
  TEST_CASE("work_counters: a query of a static tree") {
    const Tree uniform = tree_of("uniform");
    check(cost_of(uniform, "uniform", 1), {3.69, 2.32});
    check(cost_of(uniform, "uniform", 10), {4.84, 6.35});
    const Tree clusters = tree_of("clusters");
    check(cost_of(clusters, "clusters", 10), {5.03, 6.79});
    CHECK(static_cast<double>(uniform.bytes()) / count < 12 + 6.3);
  }

  TEST_CASE("work_counters: a query of a tree searched split by split") {
    check(cost_of_splits(), {63.9, 33.6});
  }

  TEST_CASE("work_counters: a growing map, by both rules, with merges done and under way") {
    for (const auto& [shape, counted, moved] : {
             Row{{2000, 8, cairn::MergeRule::one_a_level, cairn::Merging::at_once}, {6.88, 3.65}, 6.63},
             Row{{2000, 8, cairn::MergeRule::one_a_level, cairn::Merging::spread}, {14.39, 7.15}, 6.46},
             Row{{2000, 2, cairn::MergeRule::counter, cairn::Merging::at_once}, {7.12, 3.77}, 4.84},
             Row{{2000, 4, cairn::MergeRule::counter, cairn::Merging::spread}, {15.44, 8.18}, 4.34},
         }) {
      const Forest forest = grown(shape);
      check(cost_of(forest, "uniform", 1), counted);
      const double each = static_cast<double>(forest.points_moved()) / count;
      INFO("points moved for each inserted ", each);
      CHECK(each <= 1.03 * moved);
      CHECK(static_cast<double>(forest.bytes()) / count < 12 + 9);
    }
  }
}

}  // namespace work_counters_test
