// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/axis_metrics.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/packed_points.hpp>
#include <cairn/index/ratio_test.hpp>

#include "index/generators.hpp"
#include "support/random.hpp"
#include "support/violation.hpp"

namespace ratio_test_test {
namespace {

/// What a search does with a list of distances in some order.
template <class Collector>
Collector shown(const std::vector<float>& reduced, const cairn::RatioTest& test) {
  Collector collector(test, cairn::L2{});
  float limit = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < reduced.size(); ++i) {
    REQUIRE(collector.limit() <= limit);  // never grows
    limit = collector.limit();
    if (reduced[i] < limit) collector.offer(static_cast<cairn::PointId>(i), reduced[i]);
  }
  return collector;
}

}  // namespace

TEST_SUITE("ratio_test") {
  TEST_CASE("ratio_test: the early verdict is that of the whole list, in any order") {
    cairn::Random random(cairn_test::seed(61));
    int accepted = 0;
    int refused = 0;
    for (int round = 0; round < 20000; ++round) {
      std::vector<float> reduced(random.below(7));
      for (float& number : reduced) number = static_cast<float>(random.below(12)) / 4;  // ties and zeros
      std::array<float, 4> ratios{1.0F, 1.25F, 1.5F, 2.0F};
      cairn::RatioTest test{.ratio = ratios[random.below(4)]};
      if (round % 3 == 0) test.max_distance = static_cast<float>(random.uniform(0.0, 2.0));
      const auto whole = shown<cairn::RatioTestMatch<float>>(reduced, test);
      const auto early = shown<cairn::RatioTestVerdict<float>>(reduced, test);
      REQUIRE(early.accepted() == whole.accepted());
      if (whole.accepted()) {
        REQUIRE(reduced[early.id()] == reduced[whole.id()]);
        REQUIRE(early.first() == whole.first());
      }
      accepted += whole.accepted();
      refused += !whole.accepted();
    }
    CHECK(accepted > 1000);
    CHECK(refused > 1000);
  }

  TEST_CASE("ratio_test: a second at exactly the ratio passes, written as second / first or first / second") {
    // Distances 4 and 5: 1.25 one way, 0.8 the other.
    for (const float ratio : {1.25F, 0.8F}) {
      CAPTURE(ratio);
      CHECK(shown<cairn::RatioTestMatch<float>>({16, 25}, {.ratio = ratio}).accepted());
      CHECK(shown<cairn::RatioTestVerdict<float>>({16, 25}, {.ratio = ratio}).accepted());
      CHECK(shown<cairn::RatioTestVerdict<float>>({25, 16}, {.ratio = ratio}).accepted());
      CHECK_FALSE(shown<cairn::RatioTestMatch<float>>({16, 24.9F}, {.ratio = ratio}).accepted());
      CHECK_FALSE(shown<cairn::RatioTestVerdict<float>>({24.9F, 16}, {.ratio = ratio}).accepted());
    }
    CHECK(cairn::RatioTest{.ratio = 0.8F}.least_ratio() == 1.25F);
    CHECK(cairn::RatioTest{.ratio = 2}.least_ratio() == 2);
  }

  TEST_CASE("ratio_test: below 1 and above, random lists are judged as by their true distances") {
    const std::uint64_t seed = cairn_test::seed(63);
    CAPTURE(seed);
    cairn::Random random(seed);
    int accepted = 0;
    for (int round = 0; round < 20000; ++round) {
      std::vector<double> distances(1 + random.below(5));
      std::vector<float> reduced;
      for (double& distance : distances) {
        distance = static_cast<double>(random.below(20));
        reduced.push_back(static_cast<float>(distance * distance));
      }
      std::sort(distances.begin(), distances.end());
      const double second = distances.size() > 1 ? distances[1] : std::numeric_limits<double>::infinity();
      // Ratios of the small whole numbers are not met but for 4/5 and 1/2, which are exact.
      const std::array<double, 4> lowe{0.8, 0.5, 0.7003, 0.9001};
      const double ratio = lowe[random.below(4)];
      const bool expected = distances[0] <= ratio * second && distances[0] < second;
      const auto written = static_cast<float>(round % 2 == 0 ? ratio : 1 / ratio);
      REQUIRE(shown<cairn::RatioTestMatch<float>>(reduced, {.ratio = written}).accepted() == expected);
      REQUIRE(shown<cairn::RatioTestVerdict<float>>(reduced, {.ratio = written}).accepted() == expected);
      accepted += expected;
    }
    CHECK(accepted > 1000);
  }

  TEST_CASE("ratio_test: true distances are told, and a largest one is met exactly") {
    const auto two = shown<cairn::RatioTestMatch<float>>({9, 49, 64}, {.ratio = 1.5F, .max_distance = 3});
    CHECK(two.accepted());
    CHECK(two.first() == 3);
    CHECK(std::isinf(two.second()));  // nothing within 1.5 * 3 was met
    CHECK(two.first_reduced() == 9);
    CHECK_FALSE(
        shown<cairn::RatioTestMatch<float>>({9, 49}, {.ratio = 1.5F, .max_distance = 2.999F}).accepted());
    const float root = std::sqrt(0.3F);  // its square is not 0.3F: what is compared is what is told
    CHECK(shown<cairn::RatioTestMatch<float>>({0.3F}, {.max_distance = root}).accepted());
    CHECK_FALSE(
        shown<cairn::RatioTestMatch<float>>({0.3F}, {.max_distance = std::nextafter(root, 0.0F)}).accepted());
  }

  TEST_CASE("ratio_test: ratios that are none are refused") {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const cairn::PackedPoints packed(std::vector<std::array<float, 1>>{{1}, {2}});
    const std::vector<std::array<float, 1>> queries{{1}};
    for (const float ratio : {0.0F, -0.8F, nan, std::numeric_limits<float>::infinity(), 1e-30F}) {
      const cairn::RatioTest test{.ratio = ratio};
      CHECK(cairn_test::violation_of([&] {
              static_cast<void>(match(packed, queries, test));
            }).find("the ratio of distances") != std::string::npos);
      CHECK(cairn_test::violation_of([&] {
              static_cast<void>(match(cairn::PackedPoints(), queries, test));
            }).find("the ratio of distances") != std::string::npos);
    }
    for (const float most : {-1.0F, nan})
      CHECK(cairn_test::violation_of([&] {
              static_cast<void>(match(packed, queries, {.max_distance = most}));
            }).find("max_distance must not be negative") != std::string::npos);
    CHECK(cairn::detail::is_homogeneous<cairn::WeightedL2<3>>);
    CHECK_FALSE(cairn::detail::is_homogeneous<cairn::Angular>);  // twice the angle is not twice the chord
    CHECK_FALSE(cairn::detail::is_homogeneous<cairn::Weighted<cairn::Angular, 3>>);
  }

  TEST_CASE("ratio_test: the early verdict saves leaves, in one tree and in several") {
    using Tree = cairn::KdTree<float>;
    cairn::Random random(cairn_test::seed(62));
    const auto numbers = cairn_test::make_points<float>("uniform", 4000, 10, random);
    const Tree left(cairn::Rows<float>(std::span<const float>(numbers).first(25000), 10));
    const Tree right(cairn::Rows<float>(std::span<const float>(numbers).subspan(25000), 10));
    const Tree* const trees[] = {&left, &right};
    cairn::BestBinFirst<Tree> search;
    std::size_t whole_leaves = 0;
    std::size_t early_leaves = 0;
    int accepted = 0;
    for (int i = 0; i < 200; ++i) {
      auto query = cairn_test::make_points<float>("uniform", 1, 10, random);
      if (i % 2 == 0)
        for (std::size_t a = 0; a < 10; ++a)
          query[a] = numbers[static_cast<std::size_t>(i) * 100 + a] + 0.01F * query[a];
      cairn::RatioTestMatch<float> whole({.ratio = 1.25F}, cairn::L2{});
      cairn::RatioTestVerdict<float> early({.ratio = 1.25F}, cairn::L2{});
      cairn::Work whole_work;
      cairn::Work early_work;
      CHECK(search.search(trees, query.data(), whole, {}, &whole_work));
      CHECK(search.search(trees, query.data(), early, {}, &early_work));
      CHECK(early_work.leaves <= whole_work.leaves);
      whole_leaves += whole_work.leaves;
      early_leaves += early_work.leaves;
      CHECK(early.accepted() == whole.accepted());
      CHECK(early.first() == whole.first());
      accepted += whole.accepted();
    }
    CHECK(accepted >= 100);
    MESSAGE("leaves: ", whole_leaves, " for both distances, ", early_leaves, " for the verdict");
    // 0.48 of them over twenty seeds, with a deviation of 0.02
    CHECK(3 * early_leaves < 2 * whole_leaves);
  }
}

}  // namespace ratio_test_test
