// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What the concept Index and the table of docs/index.md promise, asked of every index in the same way and
// held against loops in long double that know nothing of the library.
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/batch_search.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/descriptor_file.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/index.hpp>
#include <cairn/index/kd_forest.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/multi_tree_file.hpp>
#include <cairn/index/nearest_first.hpp>
#include <cairn/index/tree_file.hpp>

#include "support/random.hpp"

namespace capabilities_test {
namespace {

using Point = std::array<float, 3>;
using Points = std::vector<Point>;
using Known = std::map<cairn::PointId, Point>;

using Brute = cairn::BruteForce<float, 3>;
using Tree = cairn::KdTree<float, 3>;
using TreeOfAnyDimension = cairn::KdTree<float>;
using Growing = cairn::MultiKdTree<float, 3>;
using Forest = cairn::KdForest<3>;
using Cells = cairn::DescriptorIndex<Points>;

// ---- who has what, as docs/index.md says

template <class I>
concept HasBoxes = requires(const I& index, const Point& corner) { cairn::inside(index, corner, corner); };
template <class I>
concept HasOrder = std::constructible_from<cairn::NearestFirst<I>, const I&, const Point&>;
template <class I>
concept HasFiles = requires(const I& index, std::ostream& out, std::istream& in) {
  cairn::save_tree(out, index);
  { cairn::load_tree<I>(in, "name") } -> std::same_as<I>;
};
/// The file is beside the caller's points.
template <class I>
concept HasFilesBesidePoints =
    requires(const I& index, std::ostream& out, std::istream& in, const Points& points) {
      cairn::save_tree(out, index);
      { cairn::load_tree<I>(in, "name", points) } -> std::same_as<I>;
    };
template <class I>
concept Grows = requires(I& index, const Points& points) {
  { index.insert(points) } -> std::same_as<cairn::PointId>;
  { index.erase(cairn::PointId{}) } -> std::same_as<bool>;
};
/// With the caller's set.
template <class I>
concept GrowsBesidePoints = requires(I& index) {
  index.insert(cairn::PointId{}, std::size_t{});
  { index.erase(cairn::PointId{}) } -> std::same_as<bool>;
};
template <class I>
concept HasBatches =
    requires(const I& index, const Points& queries) { cairn::nearest_batch(index, queries, 1); };

template <class I>
constexpr std::array<bool, 6> row{cairn::Index<I>,
                                  HasBatches<I>,
                                  HasBoxes<I>,
                                  HasOrder<I>,
                                  HasFiles<I> || HasFilesBesidePoints<I>,
                                  Grows<I> || GrowsBesidePoints<I>};
//                                         Index  batch boxes order files grows
static_assert(row<Brute> == std::array{true, true, true, true, false, false});
static_assert(row<Tree> == std::array{true, true, true, true, true, false});
static_assert(row<TreeOfAnyDimension> == std::array{true, true, true, true, true, false});
static_assert(row<Growing> == std::array{true, true, true, true, true, true});
static_assert(row<Forest> == std::array{true, true, false, false, false, false});
static_assert(row<Cells> == std::array{true, true, false, false, true, true});
static_assert(HasFilesBesidePoints<Cells> && GrowsBesidePoints<Cells>);

// What a tree is made of is nobody's business.
template <class I>
concept ShowsItsParts =
    requires(const I& index) { index.layout(); } || requires(const I& index) { index.blocks(); } ||
    requires(const I& index) { index.boxes(); } || requires(const I& index) { index.split(0U, 0U); } ||
    requires(const I& index) { index.trees(); };
static_assert(!ShowsItsParts<Tree> && !ShowsItsParts<Growing> && !ShowsItsParts<Forest>);

// ---- the loops

long double distance(const Point& a, const Point& b) {
  long double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const long double difference = static_cast<long double>(a[axis]) - static_cast<long double>(b[axis]);
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

std::vector<long double> sorted_distances(const Known& known, const Point& query) {
  std::vector<long double> all;
  for (const auto& [id, point] : known) all.push_back(distance(point, query));
  std::sort(all.begin(), all.end());
  return all;
}

constexpr long double rounding = 1e-5L;

/// A point found must be one, as far away as is said.
void check_hit(const Known& known, const Point& query, const cairn::Neighbor<float>& hit) {
  const auto point = known.find(hit.id);
  REQUIRE(point != known.end());
  REQUIRE(std::abs(distance(point->second, query) - static_cast<long double>(hit.distance)) < rounding);
}

/// The first so many of all, nearest first, none twice.
void check_nearest(const Known& known, const Point& query, std::span<const cairn::Neighbor<float>> hits,
                   std::size_t count) {
  const auto expected = sorted_distances(known, query);
  REQUIRE(hits.size() == std::min(count, known.size()));
  std::set<cairn::PointId> ids;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    check_hit(known, query, hits[i]);
    REQUIRE(std::abs(expected[i] - static_cast<long double>(hits[i].distance)) < rounding);
    REQUIRE(ids.insert(hits[i].id).second);
    if (i > 0) REQUIRE(hits[i - 1].distance <= hits[i].distance);
  }
}

// ---- the battery, a capability each

template <class I>
void check_nearest_and_k(const I& index, const Known& known, const Point& query) {
  const auto one = index.nearest(query);
  REQUIRE(one.has_value() == !known.empty());
  if (one) check_nearest(known, query, std::span(&*one, 1), 1);
  for (const std::size_t k : {std::size_t{0}, std::size_t{1}, std::size_t{7}, known.size() + 3}) {
    check_nearest(known, query, index.nearest(query, k), k);
    std::vector<cairn::Neighbor<float>> found(k, {17, -1});
    const std::size_t count = index.nearest(query, std::span(found));
    REQUIRE(count == std::min(k, known.size()));
    check_nearest(known, query, std::span(found).first(count), k);
    for (std::size_t i = count; i < k; ++i) REQUIRE(found[i] == cairn::Neighbor<float>{17, -1});
  }
}

template <class I>
void check_within(const I& index, const Known& known, const Point& query) {
  const auto expected = sorted_distances(known, query);
  for (std::size_t i = 0; i + 1 < expected.size(); i += 1 + expected.size() / 5) {
    if (expected[i + 1] - expected[i] < 1e-3L) continue;  // no radius between them that all agree about
    const auto radius = static_cast<float>((expected[i] + expected[i + 1]) / 2);
    check_nearest(known, query, index.within(query, radius), i + 1);
  }
  REQUIRE(index.within(query, 0).size() ==
          static_cast<std::size_t>(std::count(expected.begin(), expected.end(), 0.0L)));
  REQUIRE(index.within(query, 1000).size() == known.size());
}

template <class I>
void check_budget(const I& index, const Known& known, const Point& query) {
  typename I::Scratch scratch;
  constexpr bool always_exact = std::same_as<I, Brute>;
  bool was_exact = false;
  for (const std::size_t leaves : {0U, 1U, 2U, 5U, 1000000U}) {
    const cairn::Budget budget{.leaves = leaves};
    std::array<cairn::Neighbor<float>, 4> found, again;
    cairn::KNearest<float> collector(found.data(), 4), same(again.data(), 4);
    cairn::Work work, counted;
    const bool exact = index.search(query, collector, {.budget = budget, .work = &work}, scratch);
    REQUIRE(index.search(query, same, {.budget = budget, .work = &counted}) == exact);
    REQUIRE(work == counted);
    collector.restore(index.metric());
    same.restore(index.metric());
    REQUIRE(collector.size() == same.size());
    for (std::size_t i = 0; i < collector.size(); ++i) {
      REQUIRE(found[i] == again[i]);
      check_hit(known, query, found[i]);
    }
    if (!always_exact) REQUIRE(work.leaves <= leaves);
    if (!always_exact && leaves == 0) REQUIRE(collector.size() == 0);
    if (exact) check_nearest(known, query, std::span(found).first(collector.size()), 4);
    REQUIRE((exact || !was_exact));  // more work does not make an exact answer doubtful
    was_exact = exact;

    const auto one = index.nearest(query, budget);
    cairn::Nearest<float> nearest;
    index.search(query, nearest, {.budget = budget}, scratch);
    REQUIRE(one.has_value() == (nearest.id() != cairn::no_point));
    if (one) REQUIRE(one->id == nearest.id());
    const auto four = index.nearest(query, 4, budget);
    REQUIRE(four ==
            std::vector(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(collector.size())));
  }
  REQUIRE(was_exact);
}

/// A collector of one's own, whose limit shuts out what is farther than 2.
struct Seen {
  std::map<cairn::PointId, float> reduced;
  [[nodiscard]] float limit() const noexcept { return 4; }
  void offer(cairn::PointId id, float squared) {
    if (squared < 4) REQUIRE(reduced.emplace(id, squared).second);  // shown once
  }
};

template <class I>
void check_collector(const I& index, const Known& known, const Point& query) {
  Seen seen;
  REQUIRE(index.search(query, seen));
  for (const auto& [id, point] : known) {
    const long double far = distance(point, query);
    if (far < 2 - rounding) REQUIRE(seen.reduced.contains(id));
    if (far > 2 + rounding) REQUIRE_FALSE(seen.reduced.contains(id));
    if (seen.reduced.contains(id))
      REQUIRE(std::abs(far * far - static_cast<long double>(seen.reduced[id])) < 4 * rounding);
  }
}

template <class I>
void check_for_each(const I& index, const Known& known) {
  Known met;
  index.for_each([&](cairn::PointId id, std::span<const float> numbers) {
    REQUIRE(numbers.size() == 3);
    REQUIRE(met.emplace(id, Point{numbers[0], numbers[1], numbers[2]}).second);
  });
  REQUIRE(met == known);
}

template <class I>
void check_batches(const I& index, const Known& known, const Points& queries) {
  cairn::Work work_of_one;
  const auto expected = cairn::nearest_batch(index, queries, 3, {.work = &work_of_one});
  REQUIRE(expected.size() == 3 * queries.size());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const auto own = std::span(expected).subspan(3 * i, 3);
    check_nearest(known, queries[i], own.first(std::min<std::size_t>(3, known.size())), 3);
    for (std::size_t j = known.size(); j < 3; ++j) REQUIRE(own[j] == cairn::Neighbor<float>{});
  }
  for (const unsigned threads : {0U, 2U, 5U}) {
    cairn::Work work;
    REQUIRE(cairn::nearest_batch(index, queries, 3, {.work = &work, .threads = threads}) == expected);
    REQUIRE(work == work_of_one);
    std::vector<cairn::NearestTwo<float>> two(queries.size());
    REQUIRE(cairn::search_batch(index, queries, two, {.threads = threads}));
    for (std::size_t i = 0; i < queries.size(); ++i) REQUIRE(two[i].first() == expected[3 * i].distance);
    REQUIRE(cairn::nearest_batch(index, queries, 2, {.budget = {.leaves = 2}, .threads = threads}) ==
            cairn::nearest_batch(index, queries, 2, {.budget = {.leaves = 2}}));
  }
}

template <class I>
void check_refusals(const I& index, Points queries) {
  if (index.empty()) return;
  const std::vector<float> short_query{1, 2};
  queries[4][1] = std::numeric_limits<float>::quiet_NaN();
  typename I::Scratch scratch;
  Seen seen;
  CHECK_THROWS_AS(static_cast<void>(index.nearest(queries[4])), cairn::Error);
  CHECK_THROWS_AS(static_cast<void>(index.nearest(short_query, 2)), cairn::Error);
  CHECK_THROWS_AS(static_cast<void>(index.within(queries[4], 1)), cairn::Error);
  CHECK_THROWS_AS(static_cast<void>(index.within(queries[0], std::numeric_limits<float>::quiet_NaN())),
                  cairn::Error);
  CHECK_THROWS_AS(static_cast<void>(index.within(queries[0], -1)), cairn::Error);
  CHECK_THROWS_AS(index.search(short_query, seen, {.budget = {.leaves = 1}}, scratch), cairn::Error);
  std::vector<Seen> collectors(queries.size());
  std::string message;
  try {
    cairn::search_batch(index, queries, collectors, {.threads = 2});
  } catch (const cairn::Error& error) {
    message = error.what();
  }
  CHECK(message.find("query 4, coordinate 1") != std::string::npos);
  for (const Seen& collector : collectors) CHECK(collector.reduced.empty());
}

template <class I>
void check_boxes(const I& index, const Known& known, const Point& query) {
  for (const float half : {0.0F, 0.5F, 1.0F, 2.25F}) {  // lattice points lie on the sides
    Point low = query, high = query;
    for (std::size_t a = 0; a < 3; ++a) low[a] -= half, high[a] += half;
    std::set<cairn::PointId> expected;
    for (const auto& [id, p] : known) {
      bool in = true;
      for (std::size_t a = 0; a < 3; ++a) in = in && low[a] <= p[a] && p[a] <= high[a];
      if (in) expected.insert(id);
    }
    const auto ids = cairn::inside(index, low, high);
    REQUIRE(ids.size() == expected.size());
    REQUIRE(std::set(ids.begin(), ids.end()) == expected);
  }
}

template <class I>
void check_order(const I& index, const Known& known, const Point& query) {
  std::vector<cairn::Neighbor<float>> all;
  cairn::NearestFirst order(index, query);
  while (const auto hit = order.next()) all.push_back(*hit);
  REQUIRE_FALSE(order.next());
  check_nearest(known, query, all, known.size());
}

/// All of it.
template <cairn::Index I>
void check_all(const I& index, const Known& known, const Points& queries) {
  REQUIRE(index.size() == known.size());
  REQUIRE(index.empty() == known.empty());
  if (!known.empty()) REQUIRE(index.dimension() == 3);
  check_for_each(index, known);
  for (const Point& query : queries) {
    check_nearest_and_k(index, known, query);
    check_within(index, known, query);
    check_budget(index, known, query);
    check_collector(index, known, query);
    if constexpr (HasBoxes<I>) check_boxes(index, known, query);
    if constexpr (HasOrder<I>) check_order(index, known, query);
  }
  check_batches(index, known, queries);
  check_refusals(index, queries);
}

template <class I>
void check_file(const I& index, const Known& known, const Points& queries) {
  std::stringstream file;
  cairn::save_tree(file, index);
  check_all(cairn::load_tree<I>(file, "a tree"), known, queries);
}

Points some_points(std::size_t count, bool lattice, cairn::Random& random) {
  Points points(count);
  for (Point& point : points)
    for (float& number : point)
      number = lattice ? static_cast<float>(random.below(6)) / 2 : static_cast<float>(5 * random.uniform());
  return points;
}

Known numbered(const Points& points) {
  Known known;
  for (std::size_t i = 0; i < points.size(); ++i) known[static_cast<cairn::PointId>(i)] = points[i];
  return known;
}

/// Asks `check` for sets of all sizes that matter: none, fewer than a leaf, a leaf, many.
template <class Check>
void for_sets(Check&& check) {
  const std::uint64_t seed = cairn_test::seed(77);
  CAPTURE(seed);
  cairn::Random random(seed);
  for (const bool lattice : {false, true})
    for (const std::size_t count : {0U, 1U, 2U, 16U, 17U, 400U}) {
      CAPTURE(lattice);
      CAPTURE(count);
      const Points points = some_points(count, lattice, random);
      Points queries = some_points(5, lattice, random);
      queries.push_back({-40, 7, 2});
      if (count > 0) queries.push_back(points[count / 2]);
      check(points, queries);
    }
}

}  // namespace

TEST_SUITE("capabilities") {
  TEST_CASE("capabilities: BruteForce does what an index promises") {
    for_sets([](const Points& points, const Points& queries) {
      check_all(Brute(points), numbered(points), queries);
    });
  }

  TEST_CASE("capabilities: KdTree does, and from a file") {
    for_sets([](const Points& points, const Points& queries) {
      check_all(Tree(points), numbered(points), queries);
      check_all(TreeOfAnyDimension(points), numbered(points), queries);
      check_file(Tree(points), numbered(points), queries);
    });
  }

  TEST_CASE("capabilities: KdForest does") {
    for_sets([](const Points& points, const Points& queries) {
      check_all(Forest(points, {.trees = 3}), numbered(points), queries);
    });
  }

  TEST_CASE("capabilities: DescriptorIndex does") {
    for_sets([](const Points& points, const Points& queries) {
      check_all(Cells(points, {.points_in_cell = 24}), numbered(points), queries);
    });
  }

  TEST_CASE("capabilities: DescriptorIndex does while its set grows and points go, and from a file") {
    for_sets([](const Points& points, const Points& queries) {
      Points set;
      Cells index(set, {.points_in_cell = 8});
      Known known;
      for (std::size_t begin = 0; begin < points.size(); begin += 50) {
        const std::size_t end = std::min(points.size(), begin + 50);
        set.assign(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(end));
        index.insert(static_cast<cairn::PointId>(begin), end - begin);
        for (std::size_t i = begin; i < end; ++i) known[static_cast<cairn::PointId>(i)] = points[i];
      }
      check_all(index, known, queries);
      for (std::size_t i = 0; i < points.size(); i += 3) {
        REQUIRE(index.erase(static_cast<cairn::PointId>(i)));
        known.erase(static_cast<cairn::PointId>(i));
      }
      check_all(index, known, queries);
      std::stringstream file;
      cairn::save_tree(file, index);
      check_all(cairn::load_tree<Cells>(file, "cells", set), known, queries);
    });
  }

  TEST_CASE("capabilities: MultiKdTree does, with points erased and merges under way, and from a file") {
    for (const auto merging : {cairn::Merging::at_once, cairn::Merging::spread}) {
      CAPTURE(static_cast<int>(merging));
      for_sets([&](const Points& points, const Points& queries) {
        Growing index({.first_size = 20, .merging = merging});
        Known known;
        for (std::size_t begin = 0; begin < points.size(); begin += 50) {
          const std::span part =
              std::span(points).subspan(begin, std::min<std::size_t>(50, points.size() - begin));
          const cairn::PointId first = index.insert(part);
          for (std::size_t i = 0; i < part.size(); ++i)
            known[first + static_cast<cairn::PointId>(i)] = part[i];
        }
        check_all(index, known, queries);
        for (std::size_t i = 0; i < points.size(); i += 3) {
          REQUIRE(index.erase(static_cast<cairn::PointId>(i)));
          known.erase(static_cast<cairn::PointId>(i));
        }
        check_all(index, known, queries);
        check_file(index, known, queries);
      });
    }
  }

  TEST_CASE("capabilities: a MultiKdTree from a file gives no number twice and grows on") {
    Growing index;
    index.insert(Points{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}});
    index.insert(Points{{3, 0, 0}}, std::vector<cairn::PointId>{7});
    index.erase(1);
    index.erase(7);
    std::stringstream file;
    cairn::save_tree(file, index);
    auto loaded = cairn::load_tree<Growing>(file, "a tree", {.first_size = 10, .growth = 3});
    CHECK(loaded.shape().growth == 3);
    CHECK(loaded.contains(0));
    CHECK_FALSE(loaded.contains(1));
    CHECK_FALSE(loaded.contains(7));
    CHECK_FALSE(loaded.erase(1));
    CHECK(loaded.insert(Points{{9, 9, 9}}) == 8);
    loaded.insert(Points{{5, 5, 5}}, std::vector<cairn::PointId>{4});  // between them, never given
    CHECK(loaded.size() == 4);
    CHECK(loaded.nearest(Point{5, 5, 5})->id == 4);
  }

  TEST_CASE("capabilities: a MultiKdTree whose points are all erased comes back empty, its numbers used up") {
    Growing index;
    index.insert(Points{{0, 0, 0}, {1, 0, 0}});
    index.erase(0);
    index.erase(1);
    std::stringstream file;
    cairn::save_tree(file, index);
    auto loaded = cairn::load_tree<Growing>(file, "a tree");
    CHECK(loaded.empty());
    CHECK_FALSE(loaded.nearest(Point{}));
    CHECK(loaded.insert(Points{{2, 0, 0}}) == 2);
  }

  TEST_CASE("capabilities: a damaged file of a MultiKdTree is refused wherever it is cut or changed") {
    Growing index;
    index.insert(Points{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}});
    index.erase(1);
    std::stringstream file;
    cairn::save_tree(file, index);
    const std::string whole = file.str();
    const auto load = [](const std::string& bytes) {
      std::istringstream in(bytes);
      return cairn::load_tree<Growing>(in, "a tree").size();
    };
    CHECK(load(whole) == 2);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      CAPTURE(size);
      CHECK_THROWS_AS(load(whole.substr(0, size)), cairn::Error);
      for (const char flip : {'\x01', '\x80'}) {
        std::string changed = whole;
        changed[size] = static_cast<char>(changed[size] ^ flip);
        CHECK_THROWS_AS(load(changed), cairn::Error);
      }
    }
  }
}

}  // namespace capabilities_test
