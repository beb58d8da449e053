// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/detail/cell_queue.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/principal_axes.hpp>
#include <cairn/index/ratio_test.hpp>

#include "index/generators.hpp"
#include "support/bvecs.hpp"
#include "support/data.hpp"
#include "support/random.hpp"

namespace best_bin_first_test {
namespace {

using Tree = cairn::KdTree<float>;

std::vector<float> random_query(std::size_t dim, cairn::Random& random) {
  std::vector<float> query(dim);
  for (float& number : query) number = static_cast<float>(random.uniform(-0.2, 1.5));
  return query;
}

void turn(const cairn::PrincipalAxes& axes, std::vector<float>& rows) {
  std::vector<float> turned(rows.size());
  for (std::size_t i = 0; i < rows.size(); i += axes.dimension()) axes.turn(&rows[i], &turned[i]);
  rows.swap(turned);
}

struct Bound {
  float bound;
  int number;
  bool operator==(const Bound&) const = default;
};

}  // namespace

TEST_SUITE("best_bin_first") {
  TEST_CASE("cell_queue: gives what a sorted list of everything would, and the nearest of what it left out") {
    cairn::Random random(cairn_test::seed(11));
    for (int round = 0; round < 2000; ++round) {
      const std::size_t leaves = round % 25 == 0 ? 1000 : static_cast<std::size_t>(random.uniform(0, 12));
      CAPTURE(leaves);
      cairn::detail::CellQueue<Bound> queue;
      queue.open(leaves);
      std::vector<Bound> all;  // nearest first, equal ones as they came
      int number = 0;
      const auto add = [&](float bound) {
        const Bound cell{bound, number++};
        all.insert(std::upper_bound(all.begin(), all.end(), cell,
                                    [](const Bound& a, const Bound& b) { return a.bound < b.bound; }),
                   cell);
        if (queue.takes(bound)) queue.push(cell);
      };
      for (int i = 0; i < 5; ++i) add(0);
      for (std::size_t taken = 0; taken < std::min<std::size_t>(leaves, 40) && !all.empty(); ++taken) {
        REQUIRE(!queue.done());
        const Bound cell = queue.pop();
        if (leaves < 256)
          REQUIRE(cell == all.front());
        else
          REQUIRE(cell.bound == all.front().bound);
        all.erase(all.begin());
        for (int i = 0; i < 4; ++i) add(cell.bound + std::floor(static_cast<float>(random.uniform(0, 6))));
      }
      REQUIRE(queue.done() == (leaves < 40));
      REQUIRE(queue.left_out() == all.front().bound);
    }
  }

  TEST_CASE("best_bin_first: without a budget it is exact, in one tree and in several at once") {
    const std::uint64_t seed = cairn_test::seed(21);
    CAPTURE(seed);
    cairn::Random random(seed);
    cairn::BestBinFirst<Tree> search;
    for (const std::string& shape : cairn_test::shapes())
      for (const std::size_t dim : {std::size_t{2}, std::size_t{20}}) {
        CAPTURE(shape);
        const auto numbers = cairn_test::make_points<float>(shape, 1000, dim, random);
        const cairn::BruteForce<float> brute(cairn::Rows<float>(numbers, dim));
        const auto part = [&](std::size_t from, std::size_t to) {
          return Tree(cairn::Rows<float>(std::span(numbers).subspan(from * dim, (to - from) * dim), dim));
        };
        const Tree a = part(0, 600);
        const Tree b = part(600, 999);
        const Tree c = part(999, 1000);
        const Tree* const trees[] = {&a, nullptr, &b, &c};
        for (int round = 0; round < 20; ++round) {
          const auto query = random_query(dim, random);
          const auto expected = brute.nearest(query, 2);
          cairn::NearestTwo<float> two;
          CHECK(search.search(trees, query.data(), two));
          CHECK(two.first() == doctest::Approx(expected[0].distance).epsilon(1e-4));
          CHECK(two.second() == doctest::Approx(expected[1].distance).epsilon(1e-4));
        }
      }
  }

  TEST_CASE("best_bin_first: keeps to its budget of leaves and says whether the answer is exact") {
    cairn::Random random(cairn_test::seed(5));
    const auto numbers = cairn_test::make_points<float>("uniform", 20000, 16, random);
    const Tree tree(cairn::Rows<float>(numbers, 16));
    cairn::BestBinFirst<Tree> search;
    for (const std::size_t budget :
         {std::size_t{0}, std::size_t{1}, std::size_t{7}, std::size_t{257}, tree.leaves()}) {
      const auto query = random_query(16, random);
      cairn::Nearest<float> nearest;
      cairn::Work work;
      const bool exact = search.search(tree, query, nearest, {.leaves = budget}, &work);
      CHECK(work.leaves <= budget);
      CHECK(exact == (budget == tree.leaves()));
      CHECK((nearest.id() == cairn::no_point) == (budget == 0));
      CHECK(work.distances == 16 * work.leaves);
    }
  }

  TEST_CASE("best_bin_first: the share of nearest points found grows with the budget") {
    cairn::Random random(cairn_test::seed(7));
    const auto numbers = cairn_test::make_points<float>("uniform", 20000, 12, random);
    const Tree tree(cairn::Rows<float>(numbers, 12));
    cairn::BestBinFirst<Tree> search;
    std::vector<int> right;
    for (const std::size_t budget : {std::size_t{1}, std::size_t{10}, std::size_t{100}, std::size_t{1250}}) {
      cairn::Random queries(3);
      int count = 0;
      for (int i = 0; i < 100; ++i) {
        const auto query = random_query(12, queries);
        cairn::Nearest<float> nearest;
        search.search(tree, query, nearest, {.leaves = budget});
        count += nearest.reduced() == tree.nearest(query)->distance * tree.nearest(query)->distance ||
                 std::abs(std::sqrt(nearest.reduced()) - tree.nearest(query)->distance) < 1e-5F;
      }
      right.push_back(count);
    }
    CHECK(right[0] < right[1]);
    CHECK(right[1] < right[2]);
    CHECK(right[3] == 100);
  }

  TEST_CASE("best_bin_first: 128 leaves keep 98 of 100 ratio-test matches of real SIFT descriptors") {
    const auto folder = cairn_test::real_data("sift_99k");
    if (!folder) return;
    auto base = cairn_test::read_bvecs(*folder / "base.bvecs");
    auto queries = cairn_test::read_bvecs(*folder / "query.bvecs");
    const cairn::PrincipalAxes axes(cairn::Rows<float>(base, 128));
    turn(axes, base);
    turn(axes, queries);
    const cairn::KdTree<float, 128> tree(cairn::Rows<float>(base, 128));
    cairn::BestBinFirst<cairn::KdTree<float, 128>> search;
    const cairn::RatioTest test{.ratio = 1.25F};
    int true_matches = 0;
    int kept = 0;
    for (std::size_t i = 0; i < 400; ++i) {
      const std::span query(queries.data() + 128 * i, 128);
      cairn::RatioTestMatch<float> exact(test, cairn::L2{});
      cairn::RatioTestMatch<float> budgeted(test, cairn::L2{});
      search.search(tree, query, exact);
      search.search(tree, query, budgeted, {.leaves = 128});
      true_matches += exact.accepted();
      kept += exact.accepted() && budgeted.accepted() && budgeted.id() == exact.id();
    }
    CHECK(true_matches > 100);
    CHECK(kept >= true_matches * 98 / 100);
  }
}

}  // namespace best_bin_first_test
