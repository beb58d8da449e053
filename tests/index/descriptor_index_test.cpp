// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>
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
constexpr auto with_and_without_codes = {cairn::DescriptorCodes::off, cairn::DescriptorCodes::on};

/// What one search under a budget got wrong of k nearest: a distance that is not that of its point, an order
/// that is none, an answer called exact that is not, nothing found though a block could be looked at.
std::size_t wrong_answers(const Index& index, const Points& points, const std::vector<float>& query,
                          std::size_t k, std::size_t leaves, Index::Search& search) {
  std::vector<cairn::Neighbor<float>> found(k);
  cairn::KNearest<float> collector(found.data(), k);
  cairn::Work work;
  const bool all = search.search(index, query, collector, {.leaves = leaves}, &work);
  collector.restore(cairn::L2{});
  const std::size_t count = collector.size();
  std::size_t wrong = work.leaves > leaves;
  wrong += count == 0 && leaves > 0;
  wrong += count == 0 && all;
  std::set<cairn::PointId> ids;
  for (std::size_t i = 0; i < count; ++i) {
    double square = 0;
    for (std::size_t a = 0; a < query.size(); ++a)
      square += std::pow(double{query[a]} - double{points[found[i].id][a]}, 2);
    wrong += std::abs(std::sqrt(square) - double{found[i].distance}) > 1e-5 * (1e-6 + std::sqrt(square));
    wrong += !ids.insert(found[i].id).second;
    wrong += i > 0 && found[i].distance < found[i - 1].distance;
  }
  if (!all) return wrong;
  const auto expected = cairn::BruteForce<float>(points).nearest(query, k);
  wrong += count != expected.size();
  for (std::size_t i = 0; i < std::min(count, expected.size()); ++i)
    wrong += std::abs(found[i].distance - expected[i].distance) > 1e-5F * (1e-6F + expected[i].distance);
  return wrong;
}

}  // namespace

TEST_SUITE("descriptor_index") {
  TEST_CASE("an answer called exact is so, with codes and without, under any budget, among equals too") {
    const std::uint64_t seed = cairn_test::seed(80);
    CAPTURE(seed);
    cairn::Random random(seed);
    Index::Search search;
    std::vector<std::string> shapes = cairn_test::shapes();
    shapes.insert(shapes.end(), {"bytes", "few", "ring"});
    for (const std::string& shape : shapes)
      for (const std::size_t dim : {1U, 5U, 33U, 66U})
        for (const std::size_t in_cell : {1U, 6U, 40U}) {
          CAPTURE(shape);
          CAPTURE(dim);
          CAPTURE(in_cell);
          auto numbers = cairn_test::make_points<float>(shape, 500, dim, random);
          if (shape == "bytes")
            for (float& number : numbers) number = static_cast<float>(random.below(256));
          if (shape == "few")  // a dozen places, each many times
            for (std::size_t i = 12 * dim; i < numbers.size(); ++i) numbers[i] = numbers[i % (12 * dim)];
          if (shape == "ring")  // all as far from the first query
            for (std::size_t i = 0; i < numbers.size(); ++i)
              numbers[i] = i % dim == i / dim % dim ? (i / dim % 2 == 0 ? 40.0F : 0.0F) : 20.0F;
          const Points points(numbers, dim);
          for (const auto codes : with_and_without_codes) {
            const Index index(points, {.points_in_cell = in_cell, .codes = codes});
            REQUIRE(index.coded() == (codes == cairn::DescriptorCodes::on));
            for (int round = 0; round < 3; ++round) {
              std::vector<float> query(dim, 20.0F);
              if (round == 1) query.assign(numbers.begin(), numbers.begin() + static_cast<long>(dim));
              if (round == 2) query = cairn_test::make_points<float>("uniform", 1, dim, random);
              for (const std::size_t leaves : {0U, 1U, 2U, 3U, 5U, 9U, 20U, 40U, 100000U})
                for (const std::size_t k : {1U, 2U, 7U})
                  REQUIRE(wrong_answers(index, points, query, k, leaves, search) == 0);
              cairn::Nearest<float> nearest;
              REQUIRE(search.search(index, query, nearest));
            }
          }
        }
  }

  TEST_CASE("many neighbours: until so many are found there is no limit, and by codes nobody is left out") {
    cairn::Random random(cairn_test::seed(78));
    const std::size_t count = 3000, dim = 40;
    const auto numbers = cairn_test::make_points<float>("uniform", count, dim, random);
    const Points points(numbers, dim);
    const auto query = cairn_test::make_points<float>("uniform", 1, dim, random);
    Index::Search search;
    for (const std::size_t in_cell : {2U, 100U, 3000U}) {
      CAPTURE(in_cell);
      const Index index(points, {.points_in_cell = in_cell, .codes = cairn::DescriptorCodes::on});
      for (const std::size_t k : {30U, 300U, 2900U})
        for (const std::size_t leaves : {1U, 30U, 130U, 100000U}) {
          CAPTURE(k);
          CAPTURE(leaves);
          CHECK(wrong_answers(index, points, query, k, leaves, search) == 0);
        }
      std::vector<cairn::Neighbor<float>> found(2000);
      cairn::KNearest<float> collector(found.data(), found.size());
      cairn::Work work;
      search.search(index, query, collector, {.leaves = 100}, &work);
      // Of blocks looked at while there is no limit nobody is left out; their last places may be empty.
      if (in_cell == 3000) CHECK(collector.size() == 100 * 16);
      CHECK(collector.size() >= work.leaves);
    }
  }

  TEST_CASE("codes spare bytes and lose few: the same budget finds nearly as much") {
    cairn::Random random(cairn_test::seed(79));
    std::vector<float> numbers(20000 * 96);
    for (std::size_t i = 0; i < numbers.size(); i += 96) {
      float hidden[12];
      for (float& number : hidden) number = static_cast<float>(random.normal());
      for (std::size_t a = 0; a < 96; ++a)
        numbers[i + a] =
            hidden[a % 12] * hidden[(a * a + 1) % 12] + 0.2F * static_cast<float>(random.normal());
    }
    const Points points(numbers, 96);
    const Index plain(points, {.codes = cairn::DescriptorCodes::off});
    const Index coded(points, {.codes = cairn::DescriptorCodes::on});
    REQUIRE(plain.cells() == coded.cells());
    CHECK(coded.bytes() < 20000 * (128 + 48 + 16) * 3 / 2);
    const cairn::BruteForce<float> brute(points);
    Index::Search search;
    int of_plain = 0, of_coded = 0;
    std::size_t looked_at = 0;
    cairn::Work work;
    for (std::size_t i = 0; i < 300; ++i) {
      const std::size_t place = 96 * random.below(20000);
      std::vector<float> query(&numbers[place], &numbers[place] + 96);
      for (float& number : query) number += 0.5F * static_cast<float>(random.normal());
      const auto expected = brute.nearest(query)->id;
      cairn::Nearest<float> by_plain, by_coded;
      search.search(plain, query, by_plain, {.leaves = 40});
      search.search(coded, query, by_coded, {.leaves = 40}, &work);
      looked_at += search.looked_at();
      of_plain += by_plain.id() == expected;
      of_coded += by_coded.id() == expected;
    }
    MESSAGE(of_plain << " of 300 found without codes, " << of_coded << " with them, bytes of " << looked_at
                     << " of " << work.distances << " points looked at");
    CHECK(of_plain > 150);
    CHECK(of_coded >= of_plain - 6);
    CHECK(looked_at < work.distances / 5);
  }

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

  TEST_CASE("queries beyond the range of bytes have few points measured too, and exact answers") {
    const std::uint64_t seed = cairn_test::seed(94);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const auto codes : with_and_without_codes) {
      const std::size_t dim = 48, count = 4000;
      auto numbers = cairn_test::make_points<float>("uniform", count, dim, random);
      const float low = *std::min_element(numbers.begin(), numbers.end());
      const float high = *std::max_element(numbers.begin(), numbers.end());
      const float step = 0.05F * (high - low);
      const Points points(numbers, dim);
      const Index index(points, {.codes = codes});
      const cairn::BruteForce<float> brute(points);
      Index::Search search;
      std::size_t within = 0, beyond = 0;
      for (int i = 0; i < 60; ++i) {
        std::vector<float> query = cairn_test::make_points<float>("uniform", 1, dim, random);
        const bool outside = i % 2 == 1;
        if (outside)
          for (std::size_t a = 0; a < dim; a += 3)
            query[a] = (a % 2 == 0 ? low : high) + (a % 2 == 0 ? -step : step);
        cairn::NearestTwo<float> two;
        search.search(index, query, two, {.leaves = 40}, nullptr, outside ? &beyond : &within);
        cairn::NearestTwo<float> best;
        REQUIRE(search.search(index, query, best));
        const auto expected = brute.nearest(query, 2);
        CHECK(best.first() == doctest::Approx(expected[0].distance).epsilon(1e-6));
        CHECK(best.second() == doctest::Approx(expected[1].distance).epsilon(1e-6));
      }
      CAPTURE(within);
      CHECK(beyond < 4 * within);
    }
  }

  TEST_CASE("roundings that all go one way hide no point from an exact answer") {
    // Bytes are steps of one. Of the last two points the first one is 18 away and 16 by its bytes; the other
    // one 16.2, and 24 by its bytes, since each of 64 coordinates is rounded away from the query's.
    const std::size_t dim = 64;
    std::vector<float> numbers;
    for (const float number : {0.0F, 255.0F, 98.24F, 102.51F}) numbers.insert(numbers.end(), dim, number);
    const Points points(numbers, dim);
    for (const auto codes : with_and_without_codes) {
      const Index index(points, {.codes = codes});
      const auto nearest = index.nearest(std::vector<float>(dim, 100.49F));
      CHECK(nearest->id == 3);
      CHECK(nearest->distance == doctest::Approx(16.16F));
    }
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
    const Index coded(points, {.codes = cairn::DescriptorCodes::on});
    for (const Index* searched : {&index, &coded}) {
      cairn::Nearest<float> nearest;
      cairn::Work work;
      CHECK(search.search(*searched, std::vector<float>(8, 0.3F), nearest, {}, &work));
      CHECK(nearest.reduced() == 0);
      CHECK(work.leaves == 2);
    }
  }

  TEST_CASE("it grows and shrinks like a set, whatever the points, and answers like brute force") {
    const std::uint64_t seed = cairn_test::seed(86);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const std::string& shape : cairn_test::shapes())
      for (const std::size_t dim : {1U, 7U, 8U}) {
        CAPTURE(shape);
        CAPTURE(dim);
        const auto numbers = cairn_test::make_points<float>(shape, 1500, dim, random);
        Points points{std::span(numbers).first(100 * dim), dim};
        const auto codes = dim == 7 ? cairn::DescriptorCodes::on : cairn::DescriptorCodes::off;
        Index index(points, {.points_in_cell = 12, .codes = codes});
        std::set<cairn::PointId> live;
        for (cairn::PointId id = 0; id < 100; ++id) live.insert(id);
        std::size_t known = 100;
        for (int step = 0; step < 60; ++step) {
          const std::size_t more = std::min<std::size_t>(random.below(80), 1500 - known);
          points = Points(std::span(numbers).first((known + more) * dim), dim);
          index.insert(static_cast<cairn::PointId>(known), more);
          for (std::size_t i = 0; i < more; ++i) live.insert(static_cast<cairn::PointId>(known++));
          const std::size_t gone = step == 40 ? 100000 : random.below(50);  // once all of them
          for (std::size_t i = 0; i < (gone > known ? known : gone); ++i) {
            const auto id = static_cast<cairn::PointId>(gone > known ? i : random.below(known));
            REQUIRE(index.erase(id) == (live.erase(id) > 0));
          }
          if (step % 3 == 0)  // what was erased may come back
            for (int i = 0; i < 20; ++i) {
              const auto id = static_cast<cairn::PointId>(random.below(known));
              if (live.insert(id).second) index.insert(id);
            }
          REQUIRE(index.size() == live.size());
          std::vector<float> rows;
          for (const cairn::PointId id : live) {
            const auto point = points[id];
            for (std::size_t a = 0; a < dim; ++a) rows.push_back(point[a]);
          }
          const auto query = cairn_test::make_points<float>("uniform", 1, dim, random);
          const auto found = index.nearest(query, 5);
          REQUIRE(found.size() == std::min<std::size_t>(5, live.size()));
          if (live.empty()) continue;
          const auto expected = cairn::BruteForce<float>(Points(rows, dim)).nearest(query, 5);
          for (std::size_t i = 0; i < found.size(); ++i) {
            REQUIRE(live.contains(found[i].id));
            REQUIRE(found[i].distance == doctest::Approx(expected[i].distance).epsilon(1e-5));
          }
        }
      }
  }

  TEST_CASE("an index that grew keeps its cells small, and finds about as much as one built at once") {
    cairn::Random random(cairn_test::seed(87));
    std::vector<float> numbers(12000 * 16);
    for (std::size_t i = 0; i < numbers.size(); i += 16) {
      float hidden[4];
      for (float& number : hidden) number = static_cast<float>(random.normal());
      for (std::size_t a = 0; a < 16; ++a)
        numbers[i + a] = hidden[a % 4] * hidden[(a * a + 1) % 4] + 0.1F * static_cast<float>(random.normal());
    }
    const Points all(numbers, 16);
    const Index at_once(all);
    Points part{std::span(numbers).first(500 * 16), 16};
    Index grown(part);
    for (std::size_t begin = 500; begin < 12000; begin += 500) {
      part = Points(std::span(numbers).first((begin + 500) * 16), 16);
      grown.insert(static_cast<cairn::PointId>(begin), 500);
    }
    CHECK(grown.cells() >= 12000 / 64);
    CHECK(grown.bytes() < 12000 * (16 + 4 + 4 + 4) * 3);
    const cairn::BruteForce<float> brute(all);
    int of_grown = 0, of_built = 0;
    for (int i = 0; i < 300; ++i) {
      const std::size_t place = 16 * random.below(12000);
      std::vector<float> query(&numbers[place], &numbers[place] + 16);
      for (float& number : query) number += 0.1F * static_cast<float>(random.normal());
      const auto nearest = brute.nearest(query)->id;
      of_grown += grown.nearest(query, {.leaves = 8})->id == nearest;
      of_built += at_once.nearest(query, {.leaves = 8})->id == nearest;
    }
    MESSAGE(of_grown << " of 300 found by the index that grew, " << of_built << " by the one built at once");
    CHECK(of_built > 200);
    CHECK(of_grown > of_built - 30);
  }

  TEST_CASE("an index that grows large takes to codes, and answers on") {
    cairn::Random random(cairn_test::seed(78));
    std::vector<float> numbers(34000 * 128);
    for (float& number : numbers) number = static_cast<float>(random.below(100));
    Points points{std::span(numbers).first(32000 * 128), 128};
    Index index(points);
    REQUIRE_FALSE(index.coded());
    points = Points(numbers, 128);
    index.insert(32000, 1000);
    REQUIRE(index.coded());
    index.insert(33000, 1000);
    for (cairn::PointId id = 0; id < 32000; id += 2) index.erase(id);
    const cairn::BruteForce<float> brute(points);
    for (std::size_t i = 1; i < 34000; i += 3001) {
      std::vector<float> query(&numbers[i * 128], &numbers[i * 128] + 128);
      CHECK((index.nearest(query)->distance == 0) == (i >= 32000 || i % 2 == 1));
      query[7] += 0.3F;
      Index::Search search;
      cairn::Nearest<float> nearest;
      REQUIRE(search.search(index, query, nearest));
      if (i % 2 == 1) CHECK(nearest.reduced() == doctest::Approx(0.09));
    }
  }

  TEST_CASE("points far outside of the first, of no byte's value, and whole regions erased") {
    cairn::Random random(cairn_test::seed(88));
    std::vector<float> numbers(4000);
    for (std::size_t i = 0; i < 4000; ++i)
      numbers[i] = i < 2000   ? static_cast<float>(random.below(200))
                   : i < 3000 ? static_cast<float>(200 * random.uniform())
                              : static_cast<float>(2000 * random.uniform()) - 500;
    const auto first = [&](std::size_t count) {
      return Points(std::span<const float>(numbers).first(2 * count), 2);
    };
    for (const auto codes : with_and_without_codes) {
      Points points = first(1000);
      Index index(points, {.points_in_cell = 100, .codes = codes});
      REQUIRE(index.bytes_are_exact());
      std::vector<float> live(numbers.begin(), numbers.begin() + 2000);
      const auto check = [&] {
        const Points left(live, 2);
        const cairn::BruteForce<float> brute(left);
        for (int i = 0; i < 300; ++i) {
          const std::vector<float> query{static_cast<float>(2400 * random.uniform()) - 700,
                                         static_cast<float>(2400 * random.uniform()) - 700};
          const auto found = index.nearest(query, 3);
          const auto expected = brute.nearest(query, 3);
          for (std::size_t k = 0; k < 3; ++k)
            REQUIRE(found[k].distance == doctest::Approx(expected[k].distance).epsilon(1e-5));
          const std::vector<float> near{query[0] / 12 + 60, query[1] / 12 + 60};
          REQUIRE(index.nearest(near)->distance ==
                  doctest::Approx(brute.nearest(near)->distance).epsilon(1e-5));
        }
      };
      for (const std::size_t known : {1000U, 1500U, 2000U}) {
        points = first(known);
        index.insert(static_cast<cairn::PointId>(live.size() / 2), known - live.size() / 2);
        live.assign(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(2 * known));
        check();
      }
      CHECK_FALSE(index.bytes_are_exact());
      const std::size_t cells = index.cells();
      for (const float side : {40.0F, 80.0F, 120.0F}) {  // of a stripe that is emptied
        live.clear();
        for (cairn::PointId id = 0; id < 2000; ++id) {
          if (points[id][0] < side)
            index.erase(id);
          else
            live.insert(live.end(), {points[id][0], points[id][1]});
        }
        REQUIRE(index.size() == live.size() / 2);
        check();
      }
      CHECK(index.cells() <
            cells);  // by five or more of 15 to 19 over twenty seeds: all that lay in the stripe
    }
  }

  TEST_CASE("points that widen a cell are found across its border, and cells outlive others that go") {
    cairn::Random random(cairn_test::seed(89));
    std::vector<std::array<float, 2>> points;
    const auto add = [&](float x, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i)
        points.push_back(
            {x + static_cast<float>(random.below(16)), 20 + static_cast<float>(random.below(16))});
    };
    for (const float x : {10.0F, 80.0F, 150.0F, 220.0F}) add(x, 100);
    cairn::DescriptorIndex index(points, {.points_in_cell = 100});
    REQUIRE(index.cells() == 4);
    add(36, 60);  // on the first cell's side of the border at 53
    index.insert(400, 60);
    REQUIRE(index.cells() == 4);  // they joined the first
    for (cairn::PointId gone = 0; gone < 400; gone += 100) {
      for (int i = 0; i < 300; ++i) {
        const std::array query{static_cast<float>(240 * random.uniform()),
                               static_cast<float>(60 * random.uniform())};
        float least = std::numeric_limits<float>::infinity();
        for (cairn::PointId id = gone; id < points.size(); ++id)
          least = std::min(least, std::hypot(points[id][0] - query[0], points[id][1] - query[1]));
        REQUIRE(index.nearest(query)->distance == doctest::Approx(least).epsilon(1e-5));
      }
      for (cairn::PointId id = gone; id < gone + 100; ++id) REQUIRE(index.erase(id));
      if (gone == 0)  // and the first cell with them
        for (cairn::PointId id = 400; id < 460; ++id) REQUIRE(index.erase(id));
      if (gone == 0) CHECK(index.cells() == 3);
      if (gone == 0) points.resize(400);
    }
    CHECK(index.empty());
  }

  TEST_CASE("insertions of what is there, is none of the set or is not finite change nothing") {
    using cairn_test::message_of;
    std::vector<std::array<float, 2>> points(50);
    for (std::size_t i = 0; i < 50; ++i) points[i] = {static_cast<float>(i), 1};
    cairn::DescriptorIndex index(points);
    const auto refusal = [&](cairn::PointId first, std::size_t count) {
      return message_of([&] { index.insert(first, count); });
    };
    CHECK(refusal(50, 1).find("of a set of 50") != std::string::npos);
    CHECK(refusal(cairn::no_point, 1).find("of a set of 50") != std::string::npos);
    CHECK(refusal(7, 1).find("point 7 is in the index already") != std::string::npos);
    points.resize(60, {100, 2});
    points[57][1] = std::numeric_limits<float>::infinity();
    CHECK(refusal(50, 10).find("point 57, coordinate 1") != std::string::npos);
    CHECK(refusal(49, 5).find("point 49 is in the index already") != std::string::npos);
    CHECK(index.size() == 50);
    CHECK(index.nearest(std::array{100.0F, 2.0F})->id == 49);
    CHECK_FALSE(index.erase(55));
    CHECK_FALSE(index.erase(cairn::no_point));
    index.insert(50, 7);
    CHECK(index.nearest(std::array{100.0F, 2.0F})->distance == 0);
  }

  TEST_CASE("what an empty index takes in says how many coordinates it has") {
    using cairn_test::message_of;
    struct Flat {
      float x, y;
    };
    std::vector<Flat> cloud;
    const cairn::Through seen(cloud, 2,
                              [](const Flat& p, std::size_t axis) { return axis == 0 ? p.x : p.y; });
    cairn::DescriptorIndex index(seen);
    for (int i = 0; i < 40; ++i) cloud.push_back({static_cast<float>(i), 1});
    index.insert(0, 40);
    CHECK(index.dimension() == 2);
    CHECK(index.nearest(std::array{7.0F, 1.0F})->id == 7);

    std::vector<const float*> pointers;
    cairn::DescriptorIndex of_pointers(pointers);
    pointers.assign(40, &cloud[0].x);
    CHECK(message_of([&] { of_pointers.insert(0, 40); }).find("at least one coordinate") !=
          std::string::npos);
    CHECK(of_pointers.empty());
  }

  TEST_CASE("an insertion that is refused makes no codes") {
    std::vector<std::array<float, 96>> points(1);
    cairn::DescriptorIndex index(points, {.points_in_cell = 4096});
    points.resize(std::size_t{1} << 16U);
    for (std::size_t i = 0; i < points.size(); ++i) points[i][i % 96] = static_cast<float>(i % 251);
    CHECK(cairn_test::message_of([&] { index.insert(0, points.size()); }).find("point 0 is in the index") !=
          std::string::npos);
    CHECK_FALSE(index.coded());
  }

  TEST_CASE("a difference that rounds to a byte's value is not taken for the point") {
    // From -2^33 on, 0.3 and 0.4 are the same 128 steps of 2^26 away.
    const std::vector<float> numbers{-8589934592.0F, 8455716864.0F, 0.3F, 0.4F};
    const Points points(numbers, 1);
    const Index index(points);
    const auto found = index.nearest(std::vector<float>{0.3F}, 2);
    CHECK(found[0].id == 2);
    CHECK(found[1].id == 3);
    CHECK(found[1].distance == doctest::Approx(0.1));
  }

  TEST_CASE("small cells in few dimensions: whole blocks of cells are taken, and the answers are exact") {
    cairn::Random random(cairn_test::seed());
    std::vector<std::array<float, 3>> points(600);
    const auto any = [&] {
      std::array<float, 3> p{};
      for (float& v : p) v = static_cast<float>(random.uniform());
      return p;
    };
    for (auto& p : points) p = any();
    const cairn::DescriptorIndex<std::vector<std::array<float, 3>>> index(points, {.points_in_cell = 2});
    for (int k = 0; k < 50; ++k) {
      const auto query = any();
      std::vector<float> squares;
      for (const auto& p : points) {
        float sum = 0;
        for (std::size_t i = 0; i < 3; ++i) sum += (p[i] - query[i]) * (p[i] - query[i]);
        squares.push_back(sum);
      }
      std::ranges::sort(squares);
      const auto found = index.nearest(query, 40);
      REQUIRE(found.size() == 40);
      for (std::size_t i = 0; i < 40; ++i)
        CHECK(found[i].distance == doctest::Approx(std::sqrt(squares[i])).epsilon(1e-5));
    }
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
