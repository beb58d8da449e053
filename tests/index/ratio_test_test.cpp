// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/ratio_test.hpp>

#include "index/generators.hpp"
#include "support/random.hpp"

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

  TEST_CASE("ratio_test: the early verdict saves leaves, in one tree and in several") {
    using Tree = cairn::KdTree<float>;
    cairn::Random random(cairn_test::seed(62));
    const auto numbers = cairn_test::make_points<float>("uniform", 4000, 10, random);
    const Tree left(cairn::Rows<float>(std::span<const float>(numbers).first(25000), 10));
    const Tree right(cairn::Rows<float>(std::span<const float>(numbers).subspan(25000), 10));
    const Tree* const trees[] = {&left, &right};
    cairn::BestBinFirst<Tree> search;
    cairn::Work whole_work;
    cairn::Work early_work;
    int accepted = 0;
    for (int i = 0; i < 200; ++i) {
      auto query = cairn_test::make_points<float>("uniform", 1, 10, random);
      if (i % 2 == 0)
        for (std::size_t a = 0; a < 10; ++a)
          query[a] = numbers[static_cast<std::size_t>(i) * 100 + a] + 0.01F * query[a];
      cairn::RatioTestMatch<float> whole({.ratio = 1.25F}, cairn::L2{});
      cairn::RatioTestVerdict<float> early({.ratio = 1.25F}, cairn::L2{});
      CHECK(search.search(trees, query.data(), whole, {}, &whole_work));
      CHECK(search.search(trees, query.data(), early, {}, &early_work));
      CHECK(early.accepted() == whole.accepted());
      CHECK(early.first() == whole.first());
      accepted += whole.accepted();
    }
    CHECK(accepted >= 100);
    MESSAGE("leaves: ", whole_work.leaves, " for both distances, ", early_work.leaves, " for the verdict");
    CHECK(2 * early_work.leaves < whole_work.leaves);
  }
}

}  // namespace ratio_test_test
