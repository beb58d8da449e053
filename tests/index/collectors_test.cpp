// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/axis_metrics.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/kd_tree.hpp>

namespace collectors_test {
namespace {

const std::vector<std::array<float, 2>> points{{0, 0}, {3, 4}, {6, 8}};

/// Euclidean, with something of its own.
struct Mine : cairn::L2 {};

using cairn::detail::suits_metric;
static_assert(suits_metric<cairn::NearestTwo<float>, cairn::L2>);
static_assert(suits_metric<cairn::NearestTwo<float>, Mine>);
static_assert(!suits_metric<cairn::NearestTwo<float>, cairn::L1>);
static_assert(!suits_metric<cairn::NearestTwo<float>, cairn::Angular>);
static_assert(suits_metric<cairn::NearestTwo<float, cairn::Angular>, cairn::Angular>);
static_assert(suits_metric<cairn::Nearest<float>, cairn::L1>);  // shows reduced distances only

}  // namespace

TEST_SUITE("collectors") {
  TEST_CASE("collectors: the two nearest are told with true distances, whatever the metric") {
    const std::array query{0.0F, 0.0F};
    cairn::NearestTwo<float> euclidean;
    cairn::KdTree<float, 2>(points).search(query, euclidean);
    CHECK(euclidean.first() == 0);
    CHECK(euclidean.second() == 5);
    CHECK(euclidean.second_reduced() == 25);
    cairn::NearestTwo<float, cairn::L1> taxi;
    cairn::KdTree<float, 2, cairn::L1>(points).search(std::array{1.0F, 1.0F}, taxi);
    CHECK(taxi.first() == 2);
    CHECK(taxi.second() == 5);
    using Scaled = cairn::WeightedL2<2>;
    const Scaled metric{{2.0F, 0.0F}};
    cairn::NearestTwo<float, Scaled> scaled(metric);
    cairn::KdTree<float, 2, Scaled>(points, metric).search(std::array{1.0F, 99.0F}, scaled);
    CHECK(scaled.first() == 2);
    CHECK(scaled.second() == 4);
  }

  TEST_CASE("collectors: of points equally far those of lower number come first") {
    std::vector<std::array<float, 2>> ring;
    for (int i = 0; i < 200; ++i) ring.push_back({i % 4 < 2 ? 3.0F : -3.0F, i % 2 == 0 ? 4.0F : -4.0F});
    for (int i = 0; i < 3; ++i) ring.push_back({1, 0});
    const auto found = cairn::KdTree<float, 2>(ring).within(std::array{0.0F, 0.0F}, 6.0F);
    REQUIRE(found.size() == ring.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      CHECK(found[i].id == (i < 3 ? 200 + i : i - 3));
      CHECK(found[i].distance == (i < 3 ? 1 : 5));
    }
  }

  TEST_CASE("collectors: a point that is not there is infinitely far, by angles too") {
    const float infinity = std::numeric_limits<float>::infinity();
    cairn::NearestTwo<float, cairn::Angular> none;
    CHECK(none.first() == infinity);
    CHECK(none.second() == infinity);
    const std::vector<std::array<float, 2>> one{{1, 0}};
    cairn::KdTree<float, 2, cairn::Angular>(one).search(std::array{0.0F, 1.0F}, none);
    CHECK(none.first() == doctest::Approx(M_PI / 2));
    CHECK(none.second() == infinity);
  }
}

}  // namespace collectors_test
