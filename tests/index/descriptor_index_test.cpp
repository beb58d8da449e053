// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/brute_force.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/ratio_test.hpp>

#include "index/generators.hpp"
#include "support/bvecs.hpp"
#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/random.hpp"

namespace descriptor_index_test {
namespace {

using Points = cairn::Rows<float>;
using Index = cairn::DescriptorIndex<Points>;

}  // namespace

TEST_SUITE("descriptor_index") {
  TEST_CASE("without a budget it answers like brute force, whatever the points") {
    cairn::Random random(cairn_test::seed(81));
    Index::Search search;
    for (const std::string& shape : cairn_test::shapes())
      for (const std::size_t dim : {1U, 3U, 40U})
        for (const std::size_t count : {1U, 30U, 600U}) {
          CAPTURE(shape);
          CAPTURE(dim);
          CAPTURE(count);
          const auto numbers = cairn_test::make_points<float>(shape, count, dim, random);
          const Points points(numbers, dim);
          const Index index(points);
          const cairn::BruteForce<float> brute(points);
          REQUIRE(index.size() == count);
          for (int round = 0; round < 8; ++round) {
            auto query = cairn_test::make_points<float>(round % 2 == 0 ? shape : "uniform", 1, dim, random);
            if (round == 7) query[0] = 1e12F;  // far from everything
            const auto expected = brute.nearest(query, 5);
            std::vector<cairn::Neighbor<float>> found(expected.size());
            cairn::KNearest<float> collector(found.data(), found.size());
            REQUIRE(search.search(index, query, collector));
            collector.restore(cairn::L2{});
            REQUIRE(collector.size() == expected.size());
            for (std::size_t i = 0; i < found.size(); ++i)
              REQUIRE(found[i].distance == doctest::Approx(expected[i].distance).epsilon(1e-5));
          }
        }
  }

  TEST_CASE("distances are exact under a budget too, and few are measured") {
    cairn::Random random(cairn_test::seed(82));
    const auto numbers = cairn_test::make_points<float>("uniform", 5000, 32, random);
    const Points points(numbers, 32);
    const Index index(points);
    CHECK(index.bytes() < 5000 * (32 + 8) * 3 / 2);  // a cell's last block is seldom full
    Index::Search search;
    std::size_t measured = 0;
    cairn::Work work;
    for (int i = 0; i < 100; ++i) {
      const auto query = cairn_test::make_points<float>("uniform", 1, 32, random);
      cairn::NearestTwo<float> two;
      search.search(index, query, two, {.leaves = 20}, &work, &measured);
      float reduced = 0;
      for (std::size_t a = 0; a < 32; ++a)
        reduced += (query[a] - points[two.id()][a]) * (query[a] - points[two.id()][a]);
      CHECK(two.first_reduced() == doctest::Approx(reduced).epsilon(1e-6));
    }
    CHECK(work.leaves == 2000);
    CHECK(measured < work.distances / 10);
  }

  TEST_CASE("bytes are their own distances: nobody is measured again, and the answers are those of floats") {
    cairn::Random random(cairn_test::seed(83));
    for (const float step : {1.0F, 0.25F}) {
      std::vector<float> numbers(3000 * 24), query(24);
      for (float& number : numbers) number = step * (static_cast<float>(random.below(200)) - 40.0F);
      const Points points(numbers, 24);
      const Index index(points);
      const cairn::BruteForce<float> brute(points);
      REQUIRE(index.bytes_are_exact());
      Index::Search search;
      std::size_t measured = 0;
      for (int i = 0; i < 50; ++i) {
        for (float& number : query) number = step * (static_cast<float>(random.below(200)) - 40.0F);
        cairn::NearestTwo<float> two;
        REQUIRE(search.search(index, query, two, {}, nullptr, &measured));
        const auto expected = brute.nearest(query, 2);
        CHECK(two.first() == expected[0].distance);
        CHECK(two.second() == expected[1].distance);
      }
      CHECK(measured == 0);
      query[3] += step / 3;  // no byte's value
      cairn::NearestTwo<float> two;
      REQUIRE(search.search(index, query, two, {}, nullptr, &measured));
      CHECK(two.first() == doctest::Approx(brute.nearest(query, 1)[0].distance).epsilon(1e-6));
      CHECK(measured > 0);
    }
  }

  TEST_CASE("the budget holds, and more of it finds more") {
    cairn::Random random(cairn_test::seed(84));
    const auto numbers = cairn_test::make_points<float>("uniform", 20000, 16, random);
    const Points points(numbers, 16);
    const Index index(points);
    const cairn::BruteForce<float> brute(points);
    Index::Search search;
    std::vector<int> right;
    for (const std::size_t budget : {std::size_t{0}, std::size_t{4}, std::size_t{40}, std::size_t{400}}) {
      cairn::Random queries(3);
      int count = 0;
      for (int i = 0; i < 100; ++i) {
        const auto query = cairn_test::make_points<float>("uniform", 1, 16, queries);
        cairn::Nearest<float> nearest;
        cairn::Work work;
        const bool all = search.search(index, query, nearest, {.leaves = budget}, &work);
        CHECK(work.leaves <= budget);
        CHECK(work.distances == 16 * work.leaves);
        CHECK((nearest.id() == cairn::no_point) == (budget == 0));
        const bool found = nearest.id() == brute.nearest(query)->id;
        CHECK((found || !all));
        count += found;
      }
      right.push_back(count);
    }
    CHECK(right[1] < right[2]);
    CHECK(right[2] < right[3]);
    CHECK(right[3] > 90);
  }

  TEST_CASE("moving cells to their means halves the work; the threads of the build change nothing") {
    cairn::Random random(cairn_test::seed(85));
    std::vector<float> numbers(20000 * 32);  // few of the 32 directions matter, as in descriptors
    for (std::size_t i = 0; i < 20000; ++i) {
      float hidden[6];
      for (float& number : hidden) number = static_cast<float>(random.normal());
      for (std::size_t a = 0; a < 32; ++a)
        numbers[i * 32 + a] =
            hidden[a % 6] * hidden[(a * a + 1) % 6] + 0.1F * static_cast<float>(random.normal());
    }
    const Points points(numbers, 32);
    const Index index(points), threaded(points, {.threads = 3}), still(points, {.rounds = 0});
    CHECK(index.cells() == threaded.cells());
    const cairn::BruteForce<float> brute(points);
    Index::Search search;
    int right = 0, right_of_still = 0;
    for (std::size_t i = 0; i < 200; ++i) {
      std::vector<float> query(numbers.begin() + static_cast<std::ptrdiff_t>(i * 96 * 32),
                               numbers.begin() + static_cast<std::ptrdiff_t>(i * 96 * 32 + 32));
      for (float& number : query) number += 0.1F * static_cast<float>(random.normal());
      const auto id_in = [&](const Index& in) {
        cairn::Nearest<float> nearest;
        search.search(in, query, nearest, {.leaves = 6});
        return nearest.id();
      };
      const auto expected = brute.nearest(query)->id;
      CHECK(id_in(index) == id_in(threaded));
      right += id_in(index) == expected;
      right_of_still += id_in(still) == expected;
    }
    MESSAGE(right << " of 200 with means, " << right_of_still << " with a kd-tree's halves");
    CHECK(200 - right < (200 - right_of_still) / 2);
  }

  TEST_CASE("128 blocks keep 98 of 100 ratio-test matches of real SIFT descriptors") {
    const auto folder = cairn_test::real_data("sift_99k");
    if (!folder) return;
    const auto base = cairn_test::read_bvecs(*folder / "base.bvecs");
    const auto queries = cairn_test::read_bvecs(*folder / "query.bvecs");
    const Points points(base, 128);
    const Index index(points);
    CHECK(index.bytes_are_exact());
    Index::Search search;
    const cairn::RatioTest test{.ratio = 1.25F};
    int true_matches = 0, kept = 0;
    for (std::size_t i = 0; i < 400; ++i) {
      const std::span query(queries.data() + 128 * i, 128);
      cairn::RatioTestMatch<float> exact(test, cairn::L2{}), budgeted(test, cairn::L2{});
      REQUIRE(search.search(index, query, exact));
      search.search(index, query, budgeted, {.leaves = 128});
      true_matches += exact.accepted();
      kept += exact.accepted() && budgeted.accepted() && budgeted.id() == exact.id();
    }
    CHECK(true_matches > 100);
    CHECK(kept >= true_matches * 98 / 100);
  }

  TEST_CASE("equal points stay in many cells, and a search ends with the first") {
    const std::vector<float> numbers(4096 * 8, 0.3F);
    const Points points(numbers, 8);
    const Index index(points);
    CHECK(index.cells() == 128);
    Index::Search search;
    cairn::Nearest<float> nearest;
    cairn::Work work;
    CHECK(search.search(index, std::vector<float>(8, 0.3F), nearest, {}, &work));
    CHECK(nearest.reduced() == 0);
    CHECK(work.leaves == 2);
  }

  TEST_CASE("nothing in it, and bad input") {
    using cairn_test::message_of;
    const std::vector<std::array<float, 2>> none;
    using Small = cairn::DescriptorIndex<std::vector<std::array<float, 2>>>;
    Small::Search search;
    cairn::NearestTwo<float> two;
    CHECK(search.search(Small(none), std::array{1.0F, 2.0F}, two));
    std::vector<std::array<float, 2>> points(20, {1, 2});
    const Small index(points);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    CHECK(message_of([&] { search.search(index, std::array{1.0F, nan}, two); }).find("coordinate 1 is nan") !=
          std::string::npos);
    const std::vector<float> wide(2 * 16385, 1.0F);
    const Points wide_points(wide, 16385);
    CHECK(message_of([&] { Index bad(wide_points); }).find("16384 coordinates at most") != std::string::npos);
    points[3][1] = nan;
    CHECK(message_of([&] { Small bad(points); }).find("DescriptorIndex: point 3, coordinate 1") !=
          std::string::npos);
  }
}

}  // namespace descriptor_index_test
