// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/multi_kd_tree.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace {

using Point = std::array<float, 3>;
using Index = cairn::MultiKdTree<float, 3>;

std::vector<Point> random_points(std::size_t count, cairn::Random& random) {
  std::vector<Point> points(count);
  for (Point& point : points)
    for (float& number : point) number = static_cast<float>(random.below(50));
  return points;
}

/// The invariant of the thesis, on what is stored (erased points count until they are dropped).
void check_invariant(const Index& index) {
  for (std::size_t i = 0; i < index.trees().size(); ++i) {
    const std::size_t size = index.trees()[i].size();
    REQUIRE(size <= index.capacity(i));
    if (i > 0) REQUIRE((size == 0 || size > index.capacity(i - 1)));
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

}  // namespace

TEST_SUITE("multi_kd_tree") {
  TEST_CASE(
      "multi_kd_tree: random insertions and erasures go as a plain list says, and the invariant holds") {
    for (const std::size_t growth : {std::size_t{2}, std::size_t{3}, std::size_t{8}}) {
      const std::uint64_t seed = cairn_test::seed(31);
      CAPTURE(seed);
      CAPTURE(growth);
      cairn::Random random(seed, growth);
      Index index({.first_size = 20, .growth = growth});
      std::map<cairn::PointId, Point> reference;
      for (int step = 0; step < 200; ++step) {
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
        check_invariant(index);
        check_answers(index, reference, random);
      }
      index.rebuild();
      check_invariant(index);
      check_answers(index, reference, random);
    }
  }

  TEST_CASE("multi_kd_tree: there are no more trees than the thesis's bound, and one for the strict rule") {
    cairn::Random random(1);
    Index index({.first_size = 100, .growth = 4});
    for (int step = 0; step < 600; ++step) index.insert(random_points(10, random));
    const double bound = std::log(6000.0 / 100) / std::log(4.0) + 2;
    CHECK(static_cast<double>(index.trees().size()) <= bound);
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
    const auto trees = static_cast<double>(index.trees().size());
    CHECK(static_cast<double>(index.points_moved()) < 2000 * 100 + 2000 * batch * 2 * trees);
    CHECK(index.points_moved() * 30 < rebuilt);
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
