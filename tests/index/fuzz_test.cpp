// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Random programs of all operations on small sets, against a plain list.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/nearest_first.hpp>

#include "index/generators.hpp"
#include "support/random.hpp"

namespace fuzz_test {
namespace {

template <class Real>
using Row = std::vector<Real>;

/// Points under their ids, and every answer by looking at all of them.
template <class Real>
struct List {
  std::map<cairn::PointId, Row<Real>> points;

  [[nodiscard]] std::vector<double> distances(const Row<Real>& query) const {
    std::vector<double> all;
    for (const auto& [id, point] : points) {
      double sum = 0;
      for (std::size_t a = 0; a < query.size(); ++a) {
        const double difference = double{query[a]} - double{point[a]};
        sum += difference * difference;
      }
      all.push_back(std::sqrt(sum));
    }
    std::sort(all.begin(), all.end());
    return all;
  }
};

template <class Real>
bool same(Real found, double expected) {
  const double tolerance = sizeof(Real) == 4 ? 1e-5 : 1e-12;
  return std::abs(double{found} - expected) <= tolerance * expected;
}

/// The first of all distances, as many as were found.
template <class Hits>
bool same_all(const Hits& hits, const std::vector<double>& expected, std::size_t count) {
  if (hits.size() != std::min(count, expected.size())) return false;
  for (std::size_t i = 0; i < hits.size(); ++i)
    if (!same(hits[i].distance, expected[i])) return false;
  return true;
}

/// A radius between two different distances, so that rounding does not decide who is within.
double radius_between(const std::vector<double>& distances, cairn::Random& random) {
  if (distances.empty()) return 1;
  std::size_t i = random.below(distances.size());
  while (i + 1 < distances.size() && distances[i + 1] <= 1.0001 * distances[i]) ++i;
  const double low = distances[i];
  if (i + 1 == distances.size()) return 1.01 * low + 1;
  const double next = distances[i + 1];
  return std::sqrt(low * next + 1e-30) + (low == 0 ? next / 2 : 0);
}

template <class Real>
Row<Real> make_query(const std::string& shape, std::size_t dim, const List<Real>& list,
                     cairn::Random& random) {
  auto query = cairn_test::make_points<Real>(shape, 1, dim, random);
  if (!list.points.empty() && random.below(3) == 0) {
    auto at = list.points.begin();
    std::advance(at, static_cast<std::ptrdiff_t>(random.below(list.points.size())));
    query = at->second;
  }
  return query;
}

template <class Real>
std::size_t inside_by_looking(const List<Real>& list, const Row<Real>& low, const Row<Real>& high) {
  std::size_t count = 0;
  for (const auto& [id, point] : list.points) {
    bool in = true;
    for (std::size_t a = 0; a < low.size(); ++a) in = in && low[a] <= point[a] && point[a] <= high[a];
    count += in;
  }
  return count;
}

/// One tree, all its searches; returns how many answers were wrong.
template <class Real, std::size_t Dim>
std::size_t search_tree(const std::string& shape, std::size_t count, std::size_t dim, cairn::Random& random) {
  using Tree = cairn::KdTree<Real, Dim>;
  const auto numbers = cairn_test::make_points<Real>(shape, count, dim, random);
  List<Real> list;
  for (std::size_t i = 0; i < count; ++i)
    list.points[static_cast<cairn::PointId>(i)] = Row<Real>(&numbers[i * dim], &numbers[i * dim] + dim);
  const Tree tree(cairn::Rows<Real>(numbers, dim));
  cairn::BestBinFirst<Tree> best_bin_first;
  std::size_t wrong = 0;
  for (int round = 0; round < 6; ++round) {
    const auto query = make_query(shape, dim, list, random);
    const auto expected = list.distances(query);
    const std::size_t k = random.below(count + 3);
    wrong += !same_all(tree.nearest(query, k), expected, k);
    const double radius = radius_between(expected, random);
    const auto within = static_cast<std::size_t>(std::upper_bound(expected.begin(), expected.end(), radius) -
                                                 expected.begin());
    wrong += !same_all(tree.within(query, static_cast<Real>(radius)), expected, within) ||
             tree.within(query, static_cast<Real>(radius)).size() != within;

    cairn::NearestTwo<Real> two;
    wrong += !best_bin_first.search(tree, query, two);
    wrong += count > 0 && !same(two.first(), expected[0]);
    wrong += count > 1 && !same(two.second(), expected[1]);

    cairn::NearestFirst order(tree, query);
    std::vector<cairn::Neighbor<Real>> ordered;
    while (ordered.size() < k) {
      const auto hit = order.next();
      if (!hit) break;
      ordered.push_back(*hit);
    }
    wrong += !same_all(ordered, expected, k);

    const auto corner = make_query(shape, dim, list, random);
    wrong += cairn::inside(tree, query, corner).size() != inside_by_looking(list, query, corner);
  }
  return wrong;
}

/// A growing and shrinking forest.
template <class Real, std::size_t Dim>
std::size_t run_forest(const std::string& shape, std::size_t dim, cairn::Random& random) {
  const cairn::MultiTreeShape sizes{.first_size = 1 + random.below(40),
                                    .growth = 2 + random.below(3),
                                    .merging = static_cast<cairn::Merging>(random.below(2))};
  cairn::MultiKdTree<Real, Dim> forest(sizes);
  List<Real> list;
  std::size_t wrong = 0;
  cairn::PointId next = 0;
  for (int step = 0; step < 40; ++step) {
    if (random.below(3) != 0) {
      const std::size_t count = random.below(20);
      const auto numbers = cairn_test::make_points<Real>(shape, count, dim, random);
      wrong += forest.insert(cairn::Rows<Real>(numbers, dim)) != next;
      for (std::size_t i = 0; i < count; ++i)
        list.points[next++] = Row<Real>(&numbers[i * dim], &numbers[i * dim] + dim);
    } else {
      for (int i = 0; i < 12 && next > 0; ++i) {
        const auto id = static_cast<cairn::PointId>(random.below(next + 2));
        wrong += forest.erase(id) != (list.points.erase(id) == 1);
      }
    }
    wrong += forest.size() != list.points.size();
    const auto query = make_query(shape, dim, list, random);
    const auto expected = list.distances(query);
    const std::size_t k = random.below(12);
    const auto hits = forest.nearest(query, k);
    wrong += !same_all(hits, expected, k);
    for (const auto& hit : hits) wrong += !list.points.contains(hit.id) || !forest.contains(hit.id);
    const double radius = radius_between(expected, random);
    wrong += forest.within(query, static_cast<Real>(radius)).size() !=
             static_cast<std::size_t>(std::upper_bound(expected.begin(), expected.end(), radius) -
                                      expected.begin());
  }
  return wrong;
}

}  // namespace

TEST_SUITE("fuzz") {
  TEST_CASE("fuzz: all searches of a tree, 0 to 300 points of every shape") {
    const std::uint64_t seed = cairn_test::seed(101);
    for (std::uint64_t program = 0; program < 60; ++program)
      for (const std::string& shape : cairn_test::shapes()) {
        cairn::Random random(seed, program);
        const std::size_t count = random.below(301);
        CAPTURE(seed);
        CAPTURE(program);
        CAPTURE(shape);
        CAPTURE(count);
        const std::size_t boxes = search_tree<double, 2>(shape, count, 2, random);
        const std::size_t splits = search_tree<float, cairn::dynamic_dim>(shape, count, 9, random);
        REQUIRE(boxes == 0);
        REQUIRE(splits == 0);
      }
  }

  TEST_CASE("fuzz: insertions, erasures and searches of a forest, every shape") {
    const std::uint64_t seed = cairn_test::seed(102);
    for (std::uint64_t program = 0; program < 30; ++program)
      for (const std::string& shape : cairn_test::shapes()) {
        cairn::Random random(seed, program);
        CAPTURE(seed);
        CAPTURE(program);
        CAPTURE(shape);
        REQUIRE(run_forest<double, 2>(shape, 2, random) == 0);
      }
  }
}

}  // namespace fuzz_test
