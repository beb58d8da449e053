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
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/parallel.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/nearest_first.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"
#include "support/violation.hpp"

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

/// The invariant of one tree a level, on what is stored (erased points count until they are dropped): every
/// tree is of another level.
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
  const bool one_a_level =
      shape.rule == cairn::MergeRule::one_a_level && shape.merging == cairn::Merging::at_once;
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
    if (one_a_level) check_invariant(index);
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

/// Everything that an index tells of its points, by every search it has, against the points that there are:
/// how many answers are not what a loop says, erased ones foremost.
template <class Scalar, std::size_t Dim>
std::size_t wrong_doors(const cairn::MultiKdTree<Scalar, Dim>& index,
                        const std::map<cairn::PointId, std::vector<Scalar>>& points,
                        const std::vector<Scalar>& query) {
  using Multi = cairn::MultiKdTree<Scalar, Dim>;
  using Real = typename Multi::Real;
  std::vector<std::pair<long double, cairn::PointId>> sorted;
  for (const auto& [id, point] : points) {
    long double sum = 0;
    for (std::size_t a = 0; a < query.size(); ++a) {
      const long double difference = static_cast<long double>(point[a]) - static_cast<long double>(query[a]);
      sum += difference * difference;
    }
    sorted.emplace_back(std::sqrt(sum), id);
  }
  std::sort(sorted.begin(), sorted.end());
  const auto is = [&](std::size_t rank, cairn::PointId id, Real distance) {
    if (rank >= sorted.size() || points.count(id) == 0) return false;
    return std::abs(static_cast<long double>(distance) - sorted[rank].first) <= 2e-6L * sorted[rank].first;
  };
  std::size_t wrong = 0;
  const auto hits = index.nearest(query, points.size() + 2);
  wrong += hits.size() != points.size();
  for (std::size_t i = 0; i < hits.size(); ++i) wrong += !is(i, hits[i].id, hits[i].distance);
  const auto nearest = index.nearest(query);
  wrong += nearest.has_value() != !points.empty() || (nearest && !is(0, nearest->id, nearest->distance));
  const auto infinity = std::numeric_limits<Real>::infinity();
  wrong += index.within(query, infinity).size() != points.size();

  cairn::NearestTwo<Real> exactly;
  index.search(query, exactly);
  cairn::BestBinFirst<Multi> search;
  for (const std::size_t leaves : {std::size_t{0}, std::size_t{3}, std::numeric_limits<std::size_t>::max()}) {
    cairn::NearestTwo<Real> two;
    cairn::Work work;
    const bool exact = search.search(index, query, two, {.leaves = leaves}, &work);
    wrong += work.leaves > leaves || work.distances != 16 * work.leaves;
    wrong += two.id() != cairn::no_point && points.count(two.id()) == 0;
    wrong += two.second_id() != cairn::no_point && points.count(two.second_id()) == 0;
    wrong += leaves > 1000000 && !exact;
    wrong += exact && !points.empty() && !is(0, two.id(), two.first());
    wrong += exact && points.size() > 1 && !is(1, two.second_id(), two.second());
  }
  cairn::NearestFirst order(index, query);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto hit = order.next();
    wrong += !hit || !is(i, hit->id, hit->distance);
  }
  wrong += order.next().has_value();

  const std::vector<float> low(query.size(), -1.0F), high(query.size(), 100.0F);
  std::vector<cairn::PointId> all, expected;
  for (const auto& [id, point] : points) expected.push_back(id);
  index.for_each([&](cairn::PointId id, std::span<const Scalar> row) {
    all.push_back(id);
    wrong += points.count(id) == 0 || !std::equal(row.begin(), row.end(), points.at(id).begin());
  });
  std::sort(all.begin(), all.end());
  wrong += all != expected;
  all = inside(index, low, high);
  std::sort(all.begin(), all.end());
  wrong += all != expected;
  std::size_t in_box = 0;
  for (const auto& [id, point] : points) {
    bool in = true;
    for (std::size_t a = 0; a < query.size(); ++a) in = in && query[a] <= point[a];
    in_box += in;
  }
  wrong += inside(index, query, high).size() != in_box;
  return wrong;
}

/// Insertions and erasures with merges at every stage; what was erased must stay away.
template <class Scalar, std::size_t Dim>
std::size_t wrong_after_erasures(const cairn::MultiTreeShape& shape, std::size_t dim, cairn::Random& random) {
  cairn::MultiKdTree<Scalar, Dim> index(shape);
  std::map<cairn::PointId, std::vector<Scalar>> points;
  std::size_t wrong = 0;
  for (int step = 0; step < 30; ++step) {
    std::vector<Scalar> rows(dim * random.below(60));
    for (Scalar& number : rows) number = static_cast<Scalar>(random.below(100));
    const cairn::PointId first = index.insert(cairn::Rows<Scalar>(rows, dim));
    for (std::size_t i = 0; i < rows.size() / dim; ++i)
      points[first + static_cast<cairn::PointId>(i)] =
          std::vector<Scalar>(&rows[i * dim], &rows[i * dim] + dim);
    for (std::size_t i = random.below(50); i > 0 && !points.empty(); --i) {
      auto victim = points.begin();
      std::advance(victim, static_cast<std::ptrdiff_t>(random.below(points.size())));
      wrong += !index.erase(victim->first);
      points.erase(victim);
    }
    if (step == 20) index.finish_merges();
    if (step == 25) index.rebuild();
    std::vector<Scalar> query(dim);
    for (Scalar& number : query) number = static_cast<Scalar>(random.below(100));
    wrong += wrong_doors(index, points, query);
  }
  return wrong;
}

std::size_t points_in_trees(const Index& index) {
  const auto sizes = index.tree_sizes();
  return std::accumulate(sizes.begin(), sizes.end(), std::size_t{0});
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

  TEST_CASE("multi_kd_tree: there are no more trees than log_q(n / n1) + 2, and one for the strict rule") {
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
    std::size_t most = 0;
    for (int step = 0; step < 800; ++step) {
      index.insert(random_points(1 + random.below(12), random));
      std::map<std::size_t, std::size_t> of_level;
      for (const std::size_t size : index.tree_sizes()) ++of_level[index.shape().level_of(size)];
      for (const auto& [level, trees] : of_level) {
        REQUIRE(trees <= (level == 0 ? 1 : 4));
        most = std::max(most, trees);
      }
    }
    CHECK(most == 4);  // the fifth makes one of the next level, no earlier
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
        const cairn::JoiningThread beside([&] { wrong += ask(index) != expected; });
        ask(index);
      }
      {
        const cairn::JoiningThread reader([&] { wrong += ask(copy) != expected; });
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

  TEST_CASE(
      "multi_kd_tree: what is erased is found by no search, whoever merges, in few and in many dimensions") {
    const std::uint64_t seed = cairn_test::seed(35);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const auto rule : {cairn::MergeRule::one_a_level, cairn::MergeRule::counter})
      for (const auto merging : every_merging) {
        const cairn::MultiTreeShape shape{.first_size = 25, .growth = 2, .rule = rule, .merging = merging};
        CAPTURE(static_cast<int>(merging));
        CHECK(wrong_after_erasures<float, 3>(shape, 3, random) == 0);
        CHECK(wrong_after_erasures<double, cairn::dynamic_dim>(shape, 11, random) == 0);
        CHECK(wrong_after_erasures<std::uint8_t, 2>(shape, 2, random) == 0);
      }
  }

  TEST_CASE("multi_kd_tree: a budget is spent on leaves, and more of it finds more of what is not erased") {
    const std::uint64_t seed = cairn_test::seed(36);
    CAPTURE(seed);
    cairn::Random random(seed);
    constexpr std::size_t dim = 12;
    std::vector<float> rows(8000 * dim);
    for (float& number : rows) number = static_cast<float>(random.uniform());
    cairn::MultiKdTree<float, dim> index({.first_size = 500, .growth = 3});
    for (std::size_t begin = 0; begin < 8000; begin += 400)
      index.insert(cairn::Rows<float>(std::span(rows).subspan(begin * dim, 400 * dim), dim));
    std::vector<bool> erased(8000, false);
    for (cairn::PointId id = 0; id < 8000; id += 3) erased[id] = index.erase(id);
    cairn::BestBinFirst<cairn::MultiKdTree<float, dim>> search;
    std::vector<int> right;
    for (const std::size_t budget :
         {std::size_t{2}, std::size_t{20}, std::size_t{200}, std::size_t{100000}}) {
      int count = 0;
      for (std::size_t i = 0; i < 60; ++i) {  // on points, a third of them erased, and between them
        std::array<float, dim> query{};
        for (std::size_t a = 0; a < dim; ++a)
          query[a] = i % 2 == 0 ? rows[i * 100 * dim + a]
                                : 0.6F * rows[i * dim + a] + 0.4F * rows[(i + 4000) * dim + a];
        std::size_t nearest = 8000;
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t p = 0; p < 8000; ++p) {
          if (erased[p]) continue;
          double sum = 0;
          for (std::size_t a = 0; a < dim; ++a)
            sum += std::pow(double{query[a]} - double{rows[p * dim + a]}, 2);
          if (sum < least) nearest = p;
          least = std::min(least, sum);
        }
        cairn::Nearest<float> found;
        cairn::Work work;
        const bool exact = search.search(index, query, found, {.leaves = budget}, &work);
        REQUIRE(work.leaves <= budget);
        REQUIRE((found.id() == cairn::no_point || !erased[found.id()]));
        REQUIRE((!exact || found.id() == nearest));
        REQUIRE((exact || budget < 100000));
        count += found.id() == nearest;
      }
      right.push_back(count);
    }
    MESSAGE(right[0], ", ", right[1], " and ", right[2], " of 60 found by 2, 20 and 200 leaves");
    CHECK(right[0] < right[1]);
    CHECK(right[1] < right[2]);
    CHECK(right[3] == 60);
  }

  TEST_CASE("multi_kd_tree: a rebuilding or a merge drops what is erased, it does not bring it back") {
    cairn::Random random(cairn_test::seed(37));
    for (const auto merging : every_merging) {
      CAPTURE(static_cast<int>(merging));
      Index index({.first_size = 40, .growth = 2, .merging = merging});
      index.insert(random_points(400, random));
      for (cairn::PointId id = 0; id < 100; ++id) index.erase(id);
      CHECK(index.size() == 300);
      CHECK(points_in_trees(index) == 400);
      index.insert(random_points(500, random));  // pours the other tree into its own, now or in time
      index.finish_merges();
      CHECK(index.tree_sizes() == std::vector<std::size_t>{800});
      for (cairn::PointId id = 100; id < 140; ++id) index.erase(id);
      index.rebuild();
      CHECK(index.tree_sizes() == std::vector<std::size_t>{760});
      for (cairn::PointId id = 140; id < 600; ++id) index.erase(id);
      index.finish_merges();  // more were dead than alive
      CHECK(points_in_trees(index) < 760);
      CHECK(points_in_trees(index) >= index.size());
      CHECK(index.size() == 300);
    }
  }

  TEST_CASE("multi_kd_tree: ids that cannot be are refused by a handler that throws, and nothing is lost") {
    using cairn_test::violation_of;
    cairn::Random random(cairn_test::seed(38));
    for (const auto merging : every_merging) {
      Index index({.first_size = 10, .growth = 2, .merging = merging});
      std::map<cairn::PointId, Point> reference;
      const auto insert = [&](const std::vector<cairn::PointId>& ids) {
        const auto points = random_points(ids.size(), random);
        const std::string words = violation_of([&] { index.insert(points, ids); });
        if (words.empty())
          for (std::size_t i = 0; i < ids.size(); ++i) reference[ids[i]] = points[i];
        return words;
      };
      CHECK(insert({5, 9, 3}).empty());
      CHECK(index.erase(9));
      reference.erase(9);
      const std::string once = "an id can be given only once";
      for (const auto& bad : std::vector<std::vector<cairn::PointId>>{
               {20, 21, 5}, {22, 9}, {30, 31, 30}, {3}, {40, 41, 42, 40}, {1000, 3}, {4, 4}, {7, 5}})
        CHECK(insert(bad).find(once) != std::string::npos);
      CHECK(insert({50, cairn::no_point}).find("no_point is not an id") != std::string::npos);
      CHECK(violation_of([&] {
              index.insert(random_points(2, random), std::vector<cairn::PointId>{60});
            }).find("one id a point") != std::string::npos);
      CHECK(index.size() == 2);
      for (const cairn::PointId id : {20U, 21U, 22U, 30U, 40U, 50U, 60U, 1000U})
        CHECK_FALSE(index.contains(id));
      check_answers(index, reference, random);
      // The numbers are free, the next insertion goes on after the largest that was taken.
      CHECK(insert({20, 21, 22, 30, 4, 7}).empty());
      const auto more = random_points(3, random);
      CHECK(index.insert(more) == 31);
      for (cairn::PointId i = 0; i < 3; ++i) reference[31 + i] = more[i];
      CHECK(index.size() == 11);
      check_answers(index, reference, random);
    }
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
