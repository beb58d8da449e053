// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <new>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/multi_kd_tree.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace multi_kd_tree_test {
namespace {

using Point = std::array<float, 3>;
using Index = cairn::MultiKdTree<float, 3>;

std::vector<Point> random_points(std::size_t count, cairn::Random& random) {
  std::vector<Point> points(count);
  for (Point& point : points)
    for (float& number : point) number = static_cast<float>(random.below(50));
  return points;
}

/// The invariant of the thesis, on what is stored (erased points count until they are dropped): every tree is
/// of another level.
void check_invariant(const Index& index) {
  std::size_t below = 0;
  for (const std::size_t size : index.tree_sizes()) {
    const std::size_t level = index.shape().level_of(size);
    REQUIRE(size > 0);
    REQUIRE(level + 1 > below);
    below = level + 1;
  }
}

/// Distances of all points from a query, sorted.
std::vector<float> distances(const std::map<cairn::PointId, Point>& points, const Point& query) {
  std::vector<float> all;
  for (const auto& [id, point] : points) {
    float sum = 0;
    for (std::size_t a = 0; a < 3; ++a) sum += (point[a] - query[a]) * (point[a] - query[a]);
    all.push_back(std::sqrt(sum));
  }
  std::sort(all.begin(), all.end());
  return all;
}

void check_answers(const Index& index, const std::map<cairn::PointId, Point>& points, cairn::Random& random) {
  const Point query = random_points(1, random)[0];
  const auto expected = distances(points, query);
  const auto hits = index.nearest(query, 9);
  REQUIRE(hits.size() == std::min<std::size_t>(9, points.size()));
  for (std::size_t k = 0; k < hits.size(); ++k) {
    REQUIRE(hits[k].distance == doctest::Approx(expected[k]));
    REQUIRE(points.count(hits[k].id) == 1);
  }
  const auto near = std::upper_bound(expected.begin(), expected.end(), 10.0F) - expected.begin();
  REQUIRE(index.within(query, 10.0F).size() == static_cast<std::size_t>(near));
}

constexpr std::array every_merging{cairn::Merging::at_once, cairn::Merging::spread,
                                   cairn::Merging::background};

/// A random program of insertions and erasures, checked against a list at every step.
void run_program(const cairn::MultiTreeShape& shape) {
  const std::uint64_t seed = cairn_test::seed(31);
  CAPTURE(seed);
  CAPTURE(shape.growth);
  CAPTURE(static_cast<int>(shape.rule));
  CAPTURE(static_cast<int>(shape.merging));
  const bool thesis = shape.rule == cairn::MergeRule::one_a_level && shape.merging == cairn::Merging::at_once;
  cairn::Random random(seed, shape.growth);
  Index index(shape);
  std::map<cairn::PointId, Point> reference;
  for (int step = 0; step < 120; ++step) {
    const std::size_t count = random.below(10) == 0 ? random.below(400) : random.below(15);
    const auto points = random_points(count, random);
    const cairn::PointId first = index.insert(points);
    for (std::size_t i = 0; i < count; ++i) reference[first + static_cast<cairn::PointId>(i)] = points[i];
    const std::size_t erasures = random.below(20) == 0 ? reference.size() / 2 : random.below(5);
    for (std::size_t i = 0; i < erasures && !reference.empty(); ++i) {
      auto victim = reference.lower_bound(static_cast<cairn::PointId>(random.below(first + count)));
      if (victim == reference.end()) victim = reference.begin();
      REQUIRE(index.erase(victim->first));
      REQUIRE_FALSE(index.contains(victim->first));
      REQUIRE_FALSE(index.erase(victim->first));
      reference.erase(victim);
    }
    REQUIRE(index.size() == reference.size());
    if (thesis) check_invariant(index);
    check_answers(index, reference, random);
  }
  index.finish_merges();
  REQUIRE(index.merges_under_way() == 0);
  check_answers(index, reference, random);
  index.rebuild();
  check_invariant(index);
  check_answers(index, reference, random);
}

/// Ids of the nearest points and the sizes of all trees: what must not depend on the timing of threads.
std::vector<std::size_t> portrait(const Index& index, const Point& query) {
  std::vector<std::size_t> numbers = index.tree_sizes();
  for (const auto& hit : index.nearest(query, 20)) numbers.push_back(hit.id);
  return numbers;
}

/// Euclidean, until a copy is one too many.
struct Faulty : cairn::L2 {
  Faulty() = default;
  Faulty(const Faulty& other) : cairn::L2(other) {
    if (copies_left.fetch_sub(1) == 0) throw std::bad_alloc();
  }
  Faulty(Faulty&&) = default;
  Faulty& operator=(const Faulty&) = default;
  static inline std::atomic<long> copies_left = -1;
};

}  // namespace

TEST_SUITE("multi_kd_tree") {
  TEST_CASE(
      "multi_kd_tree: random insertions and erasures go as a plain list says, whoever merges by whichever "
      "rule") {
    for (const auto rule : {cairn::MergeRule::one_a_level, cairn::MergeRule::counter})
      for (const auto merging : every_merging)
        for (const std::size_t growth : {std::size_t{2}, std::size_t{3}, std::size_t{8}})
          run_program({.first_size = 20, .growth = growth, .rule = rule, .merging = merging});
  }

  TEST_CASE("multi_kd_tree: there are no more trees than the thesis's bound, and one for the strict rule") {
    cairn::Random random(1);
    Index index({.first_size = 100, .growth = 4});
    for (int step = 0; step < 600; ++step) index.insert(random_points(10, random));
    const double bound = std::log(6000.0 / 100) / std::log(4.0) + 2;
    CHECK(static_cast<double>(index.tree_count()) <= bound);
  }

  TEST_CASE("multi_kd_tree: points moved stay within the amortised bound, far below rebuilding") {
    cairn::Random random(2);
    constexpr std::size_t batch = 10;
    Index index({.first_size = 100, .growth = 2});
    std::uint64_t rebuilt = 0;
    for (std::size_t step = 1; step <= 2000; ++step) {
      index.insert(random_points(batch, random));
      rebuilt += step * batch;
    }
    // Tree 1 is rebuilt at every step; a point is moved into each further tree at most q times.
    const auto trees = static_cast<double>(index.tree_count());
    CHECK(static_cast<double>(index.points_moved()) < 2000 * 100 + 2000 * batch * 2 * trees);
    CHECK(index.points_moved() * 30 < rebuilt);
  }

  TEST_CASE("multi_kd_tree: a binary counter has a tree for every one of its digits") {
    cairn::Random random(3);
    Index index(cairn::MultiTreeShape{.first_size = 10, .growth = 2, .rule = cairn::MergeRule::counter});
    for (std::size_t count = 1; count <= 700; ++count) {
      index.insert(random_points(1, random));
      const std::size_t buffered = count % 11;  // the eleventh point makes the buffer a tree
      REQUIRE(index.tree_count() ==
              static_cast<std::size_t>(std::popcount(count / 11)) + (buffered > 0 ? 1U : 0U));
    }
    CHECK(index.points_moved() < 700 * (11 + 7));  // the buffer anew for every point, and once a digit
  }

  TEST_CASE("multi_kd_tree: a counter to the base q has at most q - 1 trees of a level") {
    cairn::Random random(4);
    Index index(cairn::MultiTreeShape{.first_size = 10, .growth = 5, .rule = cairn::MergeRule::counter});
    for (int step = 0; step < 800; ++step) {
      index.insert(random_points(1 + random.below(12), random));
      std::map<std::size_t, std::size_t> of_level;
      for (const std::size_t size : index.tree_sizes()) ++of_level[index.shape().level_of(size)];
      for (const auto& [level, trees] : of_level) REQUIRE(trees <= (level == 0 ? 1 : 4));
    }
  }

  TEST_CASE("multi_kd_tree: in the background and a little at a time give the same trees and answers") {
    const std::uint64_t seed = cairn_test::seed(32);
    CAPTURE(seed);
    for (const auto rule : {cairn::MergeRule::one_a_level, cairn::MergeRule::counter}) {
      cairn::Random random(seed);
      // Merges of more than 65536 numbers go to a thread.
      Index spread(cairn::MultiTreeShape{2000, 4, rule, cairn::Merging::spread});
      Index background(cairn::MultiTreeShape{2000, 4, rule, cairn::Merging::background});
      std::size_t most = 0;
      for (int step = 0; step < 200; ++step) {
        const auto points = random_points(500, random);
        const auto first = spread.insert(points);
        REQUIRE(background.insert(points) == first);
        for (int i = 0; i < 60; ++i) {
          const auto victim = static_cast<cairn::PointId>(random.below(first + 500));
          REQUIRE(spread.erase(victim) == background.erase(victim));
        }
        most = std::max(most, spread.merges_under_way());
        REQUIRE(background.merges_under_way() == spread.merges_under_way());
        const Point query = random_points(1, random)[0];
        REQUIRE(portrait(background, query) == portrait(spread, query));
      }
      CHECK(most >= 2);
    }
  }

  TEST_CASE("multi_kd_tree: readers go on during a merge, and on a copy during insertions") {
    cairn::Random random(cairn_test::seed(33));
    Index index(
        cairn::MultiTreeShape{.first_size = 2000, .growth = 4, .merging = cairn::Merging::background});
    const auto points = random_points(60000, random);
    const auto queries = random_points(20, random);
    const auto ask = [&](const Index& asked) {
      std::vector<float> found;
      for (const Point& query : queries) found.push_back(asked.nearest(query, 5).back().distance);
      return found;
    };
    std::size_t reads_during_a_merge = 0;
    for (std::size_t begin = 0; begin < points.size(); begin += 2000) {
      index.insert(std::span(points).subspan(begin, 2000));
      const auto expected = ask(index);
      const Index copy = index;
      std::size_t wrong = 0;
      {
        reads_during_a_merge += index.merges_under_way();
        const std::jthread beside([&] { wrong += ask(index) != expected; });
        ask(index);
      }
      {
        const std::jthread reader([&] { wrong += ask(copy) != expected; });
        for (cairn::PointId id = 0; id < 50; ++id) index.erase(static_cast<cairn::PointId>(begin) + 3 * id);
        index.insert(random_points(10, random));
      }
      REQUIRE(wrong == 0);
    }
    CHECK(reads_during_a_merge > 5);
  }

  TEST_CASE("multi_kd_tree: whatever fails in an insertion or a merge, the points stay as they were") {
    for (const auto merging : every_merging) {
      for (long copies = 0; copies < 40; ++copies) {
        cairn::Random random(cairn_test::seed(34));
        Faulty::copies_left = -1;
        cairn::MultiKdTree<float, 3, Faulty> index(
            cairn::MultiTreeShape{.first_size = 4000, .growth = 2, .merging = merging});
        Faulty::copies_left = copies;
        std::vector<Point> stored;
        std::size_t failed = 0;
        for (int step = 0; step < 16; ++step) {
          const auto points = random_points(2500, random);
          try {
            index.insert(points);
            stored.insert(stored.end(), points.begin(), points.end());
          } catch (const std::bad_alloc&) {
            ++failed;
          }
          REQUIRE(index.size() == stored.size());
        }
        REQUIRE(failed <= 1);
        if (failed == 0) break;
        REQUIRE(copies < 39);  // the last round must be one without a failure
        index.finish_merges();
        std::size_t held = 0;
        for (const std::size_t size : index.tree_sizes()) held += size;
        REQUIRE(held == stored.size());
      }
    }
    Faulty::copies_left = -1;
  }

  TEST_CASE("multi_kd_tree: an insertion with a bad point changes nothing") {
    Index index({.first_size = 2, .growth = 2});
    std::vector<Point> points{{1, 1, 1}, {2, 2, 2}, {3, 3, 3}};
    index.insert(points);
    points[1][0] = std::numeric_limits<float>::quiet_NaN();
    const std::string message = cairn_test::message_of([&] { index.insert(points); });
    CHECK(message.find("point 1, coordinate 0 is nan") != std::string::npos);
    CHECK(index.size() == 3);
    points[1][0] = 7;
    CHECK(index.insert(points) == 3);
    CHECK(index.size() == 6);
  }

  TEST_CASE("multi_kd_tree: empty, with unknown ids, and emptied again") {
    Index index;
    CHECK_FALSE(index.nearest(Point{0, 0, 0}).has_value());
    CHECK(index.nearest(Point{0, 0, 0}, 3).empty());
    CHECK_FALSE(index.erase(5));
    index.insert(std::vector<Point>{});
    const auto first = index.insert(std::vector<Point>{{1, 2, 3}});
    CHECK(index.erase(first));
    CHECK(index.empty());
    CHECK_FALSE(index.nearest(Point{0, 0, 0}).has_value());
    CHECK(index.insert(std::vector<Point>{{1, 2, 3}}) == first + 1);
  }
}

}  // namespace multi_kd_tree_test
