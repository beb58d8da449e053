// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/axis_metrics.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/metric.hpp>

#include "support/random.hpp"

namespace metric_test {
namespace {

/// Whether the reduced distances within a radius end exactly where the restored ones exceed it.
template <class Real, class M>
std::size_t wrong_ends(cairn::Random& random) {
  const M metric{};
  std::size_t wrong = 0;
  for (int round = 0; round < 3000; ++round) {
    auto radius = static_cast<Real>(random.uniform());
    if (round % 2 == 0) radius *= static_cast<Real>(std::pow(10.0, random.uniform(-17, 17)));
    if (M::homogeneous || radius < Real(2.9)) {
      const Real end = cairn::detail::largest_reduced(metric, radius);
      wrong += !(metric.restore(end) <= radius);
      wrong += !(metric.restore(std::nextafter(end, std::numeric_limits<Real>::infinity())) > radius);
    }
  }
  return wrong;
}

struct Euclid : cairn::L2 {
  static constexpr bool homogeneous = true;
};
struct Taxi : cairn::L1 {
  static constexpr bool homogeneous = true;
};

}  // namespace

TEST_SUITE("metric") {
  TEST_CASE("metric: what is within a radius ends with the last reduced distance whose true one is") {
    const std::uint64_t seed = cairn_test::seed(204);
    CAPTURE(seed);
    cairn::Random random(seed);
    CHECK(wrong_ends<float, Euclid>(random) == 0);
    CHECK(wrong_ends<double, Euclid>(random) == 0);
    CHECK(wrong_ends<float, Taxi>(random) == 0);
    CHECK(wrong_ends<float, cairn::Angular>(random) == 0);
    CHECK(wrong_ends<double, cairn::Angular>(random) == 0);
    const float infinity = std::numeric_limits<float>::infinity();
    CHECK(cairn::detail::largest_reduced(cairn::L2{}, infinity) == infinity);
    CHECK(cairn::detail::largest_reduced(cairn::L2{}, 1e30F) == std::numeric_limits<float>::max());
    CHECK(cairn::detail::largest_reduced(cairn::L2{}, 0.0F) == 0.0F);
    CHECK(cairn::detail::largest_reduced(cairn::L2{}, -0.0F) == 0.0F);
    CHECK(cairn::detail::largest_reduced(cairn::Angular{}, 4.0F) == infinity);  // all directions
  }

  TEST_CASE("metric: distances of one pair, by what each metric is named after") {
    const std::vector<std::array<double, 3>> points{{1, -2, 0.5}};
    const std::array query{3.0, 1.0, -5.5};  // apart by 2, 3 and 6
    const auto distance = [&]<class M>(const M& metric) {
      return cairn::KdTree<double, 3, M>(points, metric).nearest(query)->distance;
    };
    CHECK(distance(cairn::L2{}) == doctest::Approx(7).epsilon(1e-15));
    CHECK(distance(cairn::L1{}) == 11);
    CHECK(distance(cairn::LInfinity{}) == 6);
    CHECK(distance(cairn::WeightedL2<3>{{0.5, 2.0, 0.0}}) == doctest::Approx(std::sqrt(37.0)).epsilon(1e-15));
  }

  TEST_CASE("metric: a point is within the distance that is reported for it, in every kind of search") {
    const std::uint64_t seed = cairn_test::seed(205);
    CAPTURE(seed);
    cairn::Random random(seed);
    std::vector<std::array<float, 3>> points(500);
    for (auto& point : points)
      for (float& number : point) number = 0.1F * static_cast<float>(random.below(40));
    const cairn::KdTree<float, 3> tree(points);
    const cairn::BruteForce<float, 3> brute(points);
    std::size_t missed = 0;
    for (int round = 0; round < 300; ++round) {
      std::array<float, 3> query{};
      for (float& number : query) number = static_cast<float>(random.uniform(0, 4));
      for (const auto& hit : tree.nearest(query, 5)) {
        const auto found = tree.within(query, hit.distance);
        missed += found.empty() || found.back().distance != hit.distance;
        missed += tree.within(query, std::nextafter(hit.distance, 0.0F)).size() >= found.size();
      }
      for (const auto& hit : brute.nearest(query, 5)) {
        const auto found = brute.within(query, hit.distance);
        missed += found.empty() || found.back().distance != hit.distance;
      }
    }
    CHECK(missed == 0);
  }

  TEST_CASE("metric: a bound that was summed split by split does not hide points at a corner of their cell") {
    const std::uint64_t seed = cairn_test::seed(208);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const std::size_t dim : {2U, 3U, 9U}) {
      CAPTURE(dim);
      std::vector<float> numbers(2000 * dim);
      for (float& number : numbers) number = 0.1F * static_cast<float>(random.below(9));
      const cairn::KdTree<float> tree(cairn::Rows<float>(numbers, dim));
      cairn::BestBinFirst<cairn::KdTree<float>> search;
      std::size_t missed = 0;
      for (int round = 0; round < 200; ++round) {
        std::vector<float> query(dim);
        for (float& number : query)
          number = 0.1F * static_cast<float>(random.below(9)) + static_cast<float>(random.uniform(0, 0.1));
        std::vector<cairn::Neighbor<float>> near(60), within;
        cairn::KNearest<float> nearest(near.data(), near.size());
        search.search(tree, query, nearest);
        const float reduced = near[static_cast<std::size_t>(round) % near.size()].distance;
        cairn::Within<float> all(within, reduced);
        search.search(tree, query, all);
        for (const auto& hit : near)
          missed +=
              hit.distance <= reduced && std::none_of(within.begin(), within.end(),
                                                      [&](const auto& found) { return found.id == hit.id; });
      }
      CHECK(missed == 0);
    }
  }

  TEST_CASE("metric: distances keep their digits down to the documented 1e-19, and 1e-154 in double") {
    const auto relative_error = []<class Real>(Real distance) {
      const std::vector<std::array<Real, 2>> points{{0, 0}, {Real(0.6) * distance, Real(0.8) * distance}};
      const cairn::KdTree<Real, 2> tree(points);
      const auto hits = tree.nearest(points[0], 2);
      return std::abs(hits[1].distance / distance - 1);
    };
    CHECK(relative_error(1e-18F) < 1e-6F);
    CHECK(relative_error(2e-19F) < 1e-6F);
    CHECK(relative_error(1e-153) < 1e-15);
    CHECK(relative_error(1e-24F) == 1);  // and below 3e-23 they are 0
    CHECK(relative_error(1e-162) == 1);
  }
}

}  // namespace metric_test
