// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What every search calls exact, against a loop in long double that knows nothing of the library: no metric,
// no collector, no copy of points. The sets are such that cells are entered late: split many times along few
// axes, lattices whose points lie exactly at a radius, clusters far from the origin.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/kd_forest.hpp>
#include <cairn/index/landmark_store.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/nearest_first.hpp>
#include <cairn/index/packed_points.hpp>

#include "support/random.hpp"

namespace exactness_test {
namespace {

/// Numbers of points one after the other.
template <class Real>
struct Cloud {
  std::size_t dim;
  std::vector<Real> numbers;

  [[nodiscard]] std::size_t size() const { return numbers.size() / dim; }
  [[nodiscard]] cairn::Rows<Real> rows() const { return {numbers, dim}; }
  [[nodiscard]] const Real* at(std::size_t i) const { return &numbers[i * dim]; }
  [[nodiscard]] std::vector<Real> copy(std::size_t i) const { return {at(i), at(i) + dim}; }
};

enum class Norm { euclidean, taxi, largest };

template <class Real>
long double distance(const Real* a, const Real* b, std::size_t dim, Norm norm = Norm::euclidean) {
  long double sum = 0;
  for (std::size_t axis = 0; axis < dim; ++axis) {
    const long double difference =
        std::abs(static_cast<long double>(a[axis]) - static_cast<long double>(b[axis]));
    if (norm == Norm::euclidean) sum += difference * difference;
    if (norm == Norm::taxi) sum += difference;
    if (norm == Norm::largest) sum = std::max(sum, difference);
  }
  return norm == Norm::euclidean ? std::sqrt(sum) : sum;
}

/// Distances of all points, in their order.
template <class Real>
std::vector<long double> distances(const Cloud<Real>& cloud, const Real* query, Norm norm = Norm::euclidean) {
  std::vector<long double> all(cloud.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = distance(cloud.at(i), query, cloud.dim, norm);
  return all;
}

/// Whether the answers are the nearest, in order: each has the distance of its id and of its rank.
template <class Hits>
std::size_t wrong_hits(const Hits& hits, const std::vector<long double>& all, long double tolerance) {
  std::vector<long double> sorted = all;
  std::sort(sorted.begin(), sorted.end());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const long double allowed = tolerance * sorted[i];
    wrong += std::abs(all[hits[i].id] - sorted[i]) > allowed;
    wrong += std::abs(static_cast<long double>(hits[i].distance) - sorted[i]) > allowed;
  }
  return wrong;
}

/// Points of which only `varying` coordinates differ much, so that trees split again and again along them.
template <class Real>
Cloud<Real> few_varying(std::size_t count, std::size_t dim, std::size_t varying, cairn::Random& random) {
  Cloud<Real> cloud{dim, std::vector<Real>(count * dim)};
  for (std::size_t i = 0; i < cloud.numbers.size(); ++i)
    cloud.numbers[i] = static_cast<Real>(random.uniform() * (i % dim < varying ? 1 : 1e-3));
  return cloud;
}

template <class Real>
std::vector<Real> query_near(const Cloud<Real>& cloud, cairn::Random& random) {
  std::vector<Real> query = cloud.copy(random.below(cloud.size()));
  for (Real& number : query) number += static_cast<Real>(random.uniform(-0.3, 0.3));
  return query;
}

/// The k nearest by a tree's search, by best-bin-first without a budget, and the first k of all in order. A
/// large k has a wide bound, which reaches into cells on the far side of several splits of one axis.
template <class Real>
std::size_t wrong_searches(const Cloud<Real>& cloud, std::size_t k, int rounds, cairn::Random& random) {
  using Tree = cairn::KdTree<Real>;
  const Tree tree(cloud.rows());
  cairn::BestBinFirst<Tree> best_bin_first;
  const long double tolerance = sizeof(Real) == 4 ? 2e-6L : 1e-14L;
  std::size_t wrong = 0;
  std::vector<cairn::Neighbor<Real>> found(k);
  for (int round = 0; round < rounds; ++round) {
    const std::vector<Real> query = query_near(cloud, random);
    const auto all = distances(cloud, query.data());
    wrong += wrong_hits(tree.nearest(query, k), all, tolerance);
    cairn::KNearest<Real> nearest(found.data(), found.size());
    wrong += !best_bin_first.search(tree, query, nearest);
    nearest.restore(cairn::L2{});
    wrong += wrong_hits(found, all, tolerance);
    cairn::NearestFirst order(tree, query);
    for (auto& hit : found) hit = *order.next();
    wrong += wrong_hits(found, all, tolerance);
  }
  return wrong;
}

/// How many points lie within, bounds included; coordinates and radius are whole, so nothing is rounded.
template <class Real>
std::size_t count_within(const Cloud<Real>& cloud, const Real* query, long double radius, Norm norm) {
  const auto all = distances(cloud, query, norm);
  return static_cast<std::size_t>(
      std::count_if(all.begin(), all.end(), [&](long double d) { return d <= radius; }));
}

/// Points of a lattice, queries on it and whole radii: within() must have the points at the radius itself.
template <class Real, class M>
std::size_t wrong_radii(std::size_t dim, Norm norm, cairn::Random& random) {
  Cloud<Real> cloud{dim, std::vector<Real>(1200 * dim)};
  for (std::size_t i = 0; i < cloud.numbers.size(); ++i)
    cloud.numbers[i] = static_cast<Real>(random.below(i % dim < 3 ? 9 : 2));
  const cairn::KdTree<Real, cairn::dynamic_dim, M> tree(cloud.rows());
  const cairn::BruteForce<Real, cairn::dynamic_dim, M> brute(cloud.rows());
  cairn::MultiKdTree<Real, cairn::dynamic_dim, M> forest(cairn::MultiTreeShape{.first_size = 100});
  forest.insert(cloud.rows());
  std::size_t wrong = 0;
  for (int round = 0; round < 60; ++round) {
    std::vector<Real> query(dim);
    for (Real& number : query) number = static_cast<Real>(random.below(9));
    const auto radius = static_cast<Real>(random.below(8));
    const std::size_t expected = count_within(cloud, query.data(), static_cast<long double>(radius), norm);
    wrong += tree.within(query, radius).size() != expected;
    wrong += brute.within(query, radius).size() != expected;
    wrong += forest.within(query, radius).size() != expected;
  }
  return wrong;
}

/// Two heaps of points a million apart, a unit wide each: what a float says of a coordinate there is 1/16.
Cloud<float> two_heaps(std::size_t count, std::size_t dim, cairn::Random& random) {
  Cloud<float> cloud{dim, std::vector<float>(count * dim)};
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t a = 0; a < dim; ++a)
      cloud.numbers[i * dim + a] =
          static_cast<float>((i % 2 == 0 && a == 0 ? 1e6 : 0) + (i % 2 == 0 ? 4 : 1) * random.normal());
  return cloud;
}

/// Descriptors a million from the origin in every coordinate.
Cloud<float> far_away(std::size_t count, std::size_t dim, cairn::Random& random) {
  Cloud<float> cloud{dim, std::vector<float>(count * dim)};
  for (float& number : cloud.numbers) number = static_cast<float>(1e6 + 3 * random.normal());
  return cloud;
}

std::size_t wrong_forest_answers(const Cloud<float>& cloud, int rounds, cairn::Random& random) {
  using Forest = cairn::KdForest<>;
  const Forest forest(cloud.rows(), {.trees = 3, .turned_axes = 8});
  cairn::BestBinFirst<Forest> search;
  std::size_t wrong = 0;
  for (int round = 0; round < rounds; ++round) {
    std::vector<float> query = cloud.copy(random.below(cloud.size()));
    for (float& number : query) number += static_cast<float>(random.normal());
    std::array<cairn::Neighbor<float>, 4> found;
    cairn::KNearest<float> nearest(found.data(), found.size());
    wrong += !search.search(forest, query, nearest);
    nearest.restore(cairn::L2{});
    wrong += wrong_hits(found, distances(cloud, query.data()), 3e-6L);
  }
  return wrong;
}

}  // namespace

TEST_SUITE("exactness") {
  TEST_CASE("exactness: cells that were split along one axis again and again are no farther than they are") {
    const std::uint64_t seed = cairn_test::seed(211);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const std::size_t k : {2U, 600U}) {
      CAPTURE(k);
      CHECK(wrong_searches(few_varying<float>(3000, 2, 2, random), k, 50, random) == 0);
      CHECK(wrong_searches(few_varying<double>(3000, 9, 3, random), k, 50, random) == 0);
      CHECK(wrong_searches(few_varying<float>(3000, 12, 1, random), k, 30, random) == 0);
      CHECK(wrong_searches(few_varying<float>(3000, 20, 3, random), k, 30, random) == 0);
    }
  }

  TEST_CASE("exactness: points at the radius are within it, in every metric, tree and forest") {
    const std::uint64_t seed = cairn_test::seed(212);
    CAPTURE(seed);
    cairn::Random random(seed);
    CHECK(wrong_radii<float, cairn::L2>(3, Norm::euclidean, random) == 0);
    CHECK(wrong_radii<double, cairn::L2>(2, Norm::euclidean, random) == 0);
    CHECK(wrong_radii<float, cairn::L2>(11, Norm::euclidean, random) == 0);
    CHECK(wrong_radii<float, cairn::L1>(3, Norm::taxi, random) == 0);
    CHECK(wrong_radii<double, cairn::L1>(10, Norm::taxi, random) == 0);
    CHECK(wrong_radii<float, cairn::LInfinity>(3, Norm::largest, random) == 0);
    CHECK(wrong_radii<float, cairn::LInfinity>(9, Norm::largest, random) == 0);
  }

  TEST_CASE("exactness: cells around means reach as far as their points") {
    const std::uint64_t seed = cairn_test::seed(213);
    CAPTURE(seed);
    cairn::Random random(seed);
    using Index = cairn::DescriptorIndex<cairn::Rows<float>>;
    Index::Search search;
    for (const std::size_t dim : {2U, 3U, 8U}) {
      Cloud<float> cloud{dim, std::vector<float>(4000 * dim)};
      for (float& number : cloud.numbers) number = static_cast<float>(random.uniform());
      const auto rows = cloud.rows();
      const Index index(rows, {.points_in_cell = 10});
      REQUIRE(index.cells() > 200);
      std::size_t wrong = 0;
      for (int round = 0; round < 300; ++round) {
        std::vector<float> query(dim);
        for (float& number : query) number = static_cast<float>(random.uniform(-0.1, 1.1));
        std::array<cairn::Neighbor<float>, 60> found;
        cairn::KNearest<float> nearest(found.data(), round % 2 == 0 ? 2 : found.size());
        wrong += !search.search(index, query, nearest);
        nearest.restore(cairn::L2{});
        wrong += wrong_hits(std::span(found).first(nearest.size()), distances(cloud, query.data()), 2e-6L);
      }
      CHECK(wrong == 0);
    }
  }

  TEST_CASE("exactness: a forest of turned trees is exact far from the origin, and of heaps far apart") {
    const std::uint64_t seed = cairn_test::seed(214);
    CAPTURE(seed);
    cairn::Random random(seed);
    CHECK(wrong_forest_answers(far_away(1500, 12, random), 200, random) == 0);
    CHECK(wrong_forest_answers(far_away(800, 64, random), 60, random) == 0);
    CHECK(wrong_forest_answers(two_heaps(1500, 12, random), 200, random) == 0);
    CHECK(wrong_forest_answers(few_varying<float>(1500, 6, 2, random), 200, random) == 0);
  }

  TEST_CASE("exactness: a landmark store far from the origin matches as near it") {
    const std::uint64_t seed = cairn_test::seed(215);
    CAPTURE(seed);
    cairn::Random random(seed);
    const Cloud<float> cloud = far_away(600, 8, random);
    cairn::MultiTreeStore<8> store;
    for (std::size_t i = 0; i < cloud.size(); ++i) store.add(cloud.rows()[i]);
    store.advance();
    std::size_t wrong = 0;
    for (int round = 0; round < 200; ++round) {
      std::vector<float> query = cloud.copy(static_cast<std::size_t>(round));
      for (float& number : query) number += static_cast<float>(random.normal());
      const auto all = distances(cloud, query.data());
      const auto match = store.match(query, 0, {.ratio = 1});
      const auto nearest = std::min_element(all.begin(), all.end());
      // Coordinates are turned to the axes of all: their rounding is that of numbers of size ten.
      wrong += !match || std::abs(static_cast<long double>(match->distance) - *nearest) > 3e-5L;
    }
    CHECK(wrong == 0);
  }

  TEST_CASE("exactness: matches in bulk are those of a loop, by the ratio written either way") {
    const std::uint64_t seed = cairn_test::seed(216);
    CAPTURE(seed);
    cairn::Random random(seed);
    const Cloud<float> cloud = few_varying<float>(300, 4, 4, random);
    Cloud<float> queries{4, {}};
    for (std::size_t i = 0; i < 4 * 400; ++i)
      queries.numbers.push_back(cloud.numbers[i % cloud.numbers.size()] +
                                static_cast<float>(random.uniform(-0.15, 0.15)));
    std::size_t matched = 0;
    for (std::size_t i = 0; i < queries.size(); ++i) {
      auto all = distances(cloud, queries.at(i));
      std::sort(all.begin(), all.end());
      matched += all[0] <= 0.8L * all[1];
    }
    const cairn::PackedPoints packed(cloud.rows());
    CHECK(matched > 50);
    CHECK(matched < 350);
    CHECK(match(packed, queries.rows(), {.ratio = 0.8F}).size() == matched);
    CHECK(match(packed, queries.rows(), {.ratio = 1.25F}) == match(packed, queries.rows(), {.ratio = 0.8F}));
  }
}

}  // namespace exactness_test
