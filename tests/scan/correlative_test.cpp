// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/scan/correlative.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace correlative_test {
namespace {

using namespace cairn;

ScoreGrid drawn_grid(Random& random, int side) {
  ScoreGrid grid({0.1, 0, 0}, {-side / 2, -side / 2}, side, side);
  const std::uint64_t filled = 5 + random.below(60);
  for (std::uint64_t i = 0; i < filled; ++i)
    grid(static_cast<int>(random.below(static_cast<unsigned>(side))),
         static_cast<int>(random.below(static_cast<unsigned>(side)))) =
        static_cast<std::uint8_t>(1 + random.below(255));
  return grid;
}

std::vector<ScanPoint> drawn_points(Random& random, double reach) {
  std::vector<ScanPoint> points;
  const std::uint64_t count = 1 + random.below(12);
  for (std::uint64_t i = 0; i < count; ++i)
    points.push_back({random.uniform(-reach, reach), random.uniform(-reach, reach)});
  return points;
}

/// The best score of all poses of the lattice, one by one.
double exhaustive(const CorrelativeSearch& search, const std::vector<ScanPoint>& points, const SE2& middle,
                  const SearchWindow& window) {
  const double step = search.heading_step(points);
  const int a = static_cast<int>(window.angle / step), x = static_cast<int>(window.x / 0.1),
            y = static_cast<int>(window.y / 0.1);
  double best = 0;
  for (int i = -a; i <= a; ++i)
    for (int j = -y; j <= y; ++j)
      for (int k = -x; k <= x; ++k)
        best = std::max(best, search.score(points, SE2(middle.x() + 0.1 * k, middle.y() + 0.1 * j,
                                                       middle.angle() + i * step)));
  return best;
}

}  // namespace

TEST_SUITE("scan/correlative") {
  TEST_CASE("correlative: the best score is that of looking at every pose") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 1000; ++trial) {
      const CorrelativeSearch search(drawn_grid(random, 24), 1 + static_cast<int>(random.below(5)));
      const auto points = drawn_points(random, 0.8);
      // Off the cells' borders: a sum of steps may round across one.
      const SE2 middle(0.03 + 0.1 * static_cast<double>(random.below(5)),
                       0.07 - 0.1 * static_cast<double>(random.below(5)), random.uniform(-3, 3));
      const SearchWindow window{random.uniform(0, 0.9), random.uniform(0, 0.9), random.uniform(0, 0.4)};
      const auto found = search.find(points, middle, window);
      const double best = exhaustive(search, points, middle, window);
      REQUIRE((found ? found->score : 0.0) == doctest::Approx(best).epsilon(1e-12));
      if (!found) continue;
      REQUIRE(search.score(points, found->pose) == doctest::Approx(best).epsilon(1e-12));
      REQUIRE(std::abs(found->pose.x() - middle.x()) <= window.x + 1e-9);
      REQUIRE(std::abs(wrapped(found->pose.angle() - middle.angle())) <= window.angle + 1e-9);
    }
  }

  TEST_CASE(
      "correlative: points that no lattice of headings holds are refused, a score of 1 is never exceeded") {
    ScoreGrid grid({0.05, 0, 0}, {0, 0}, 40, 40);
    grid(20, 20) = 255;
    const CorrelativeSearch search(grid);
    const SearchWindow window{0.1, 0.1, 0.1};
    for (const double x : {1e9, 1e300, std::nan(""), std::numeric_limits<double>::infinity()}) {
      const std::vector<ScanPoint> points{{1.02, 1.02}, {0, x}};
      const std::string said =
          cairn_test::message_of([&] { static_cast<void>(search.find(points, SE2(), window)); });
      CHECK(said.find("less than 2^20 cells from the scanner") != std::string::npos);
      CHECK_FALSE(cairn_test::message_of([&] { static_cast<void>(search.heading_step(points)); }).empty());
    }
    const std::vector<ScanPoint> points{{1.02, 1.02}};
    REQUIRE(search.find(points, SE2(), window, 0.999).has_value());
    CHECK(search.find(points, SE2(), window, 0.999)->score == 1);
    for (const double least : {1.0, 2.0, 1e300, std::numeric_limits<double>::infinity()})
      CHECK_FALSE(search.find(points, SE2(), window, least).has_value());
  }

  TEST_CASE(
      "correlative: places apart are those of taking the best pose, then the best beside it, and so on") {
    const std::uint64_t seed = cairn_test::seed(4);
    CAPTURE(seed);
    Random random(seed);
    std::size_t seconds = 0;
    for (int trial = 0; trial < 200; ++trial) {
      const CorrelativeSearch search(drawn_grid(random, 24), 1 + static_cast<int>(random.below(5)));
      const auto points = drawn_points(random, 0.8);
      const SE2 middle(0.03, 0.07, random.uniform(-3, 3));
      const SearchWindow window{random.uniform(0, 0.9), random.uniform(0, 0.9), random.uniform(0, 0.4)};
      const PlacesApart apart{random.uniform(0.15, 0.8), random.uniform(0.05, 0.5)};
      const auto places = search.find_places(points, middle, window, 3, apart);
      const double step = search.heading_step(points);
      const int a = static_cast<int>(window.angle / step), x = static_cast<int>(window.x / 0.1),
                y = static_cast<int>(window.y / 0.1);
      for (std::size_t n = 0; n < 3; ++n) {
        double best = 0;
        for (int i = -a; i <= a; ++i)
          for (int j = -y; j <= y; ++j)
            for (int k = -x; k <= x; ++k) {
              const SE2 pose(middle.x() + 0.1 * k, middle.y() + 0.1 * j, middle.angle() + i * step);
              bool beside = true;
              for (std::size_t m = 0; m < n && m < places.size(); ++m)
                beside =
                    beside &&
                    ((places[m].pose.translation() - pose.translation()).norm() >= apart.distance - 1e-9 ||
                     std::abs(wrapped(places[m].pose.angle() - pose.angle())) >= apart.angle - 1e-9);
              if (beside) best = std::max(best, search.score(points, pose));
            }
        REQUIRE((n < places.size() ? places[n].score : 0.0) == doctest::Approx(best).epsilon(1e-12));
        if (n >= places.size()) break;
        seconds += n == 1;
      }
    }
    CHECK(seconds > 50);
  }

  TEST_CASE(
      "correlative: in a row of equal rooms a scan of one has look-alikes, in one with a cupboard none") {
    // Three rooms of 2 x 2 m in a row, seen from the middle of the second; a cupboard stands in a corner of
    // one or of each.
    const auto rooms = [](const std::vector<int>& with_cupboard) {
      ScoreGrid grid({0.1, 0, 0}, {-5, -5}, 70, 30);
      for (int room = 0; room < 3; ++room) {
        for (int i = 0; i <= 20; ++i)
          for (const auto& [column, row] : {std::pair{i, 0}, {i, 20}, {0, i}, {20, i}})
            grid(5 + 20 * room + column, 5 + row) = 255;
        if (std::ranges::count(with_cupboard, room) == 0) continue;
        for (int i = 0; i <= 8; ++i)
          for (const auto& [column, row] : {std::pair{i, 8}, {8, i}})
            grid(5 + 20 * room + column, 5 + row) = 255;
      }
      return CorrelativeSearch(grid);
    };
    std::vector<ScanPoint> seen;  // from the middle of a room with a cupboard
    for (int i = -10; i <= 10; ++i)
      for (const auto& [x, y] : {std::pair{i, -10}, {i, 10}, {-10, i}, {10, i}})
        seen.push_back({0.1 * x, 0.1 * y});
    for (int i = -10; i <= -2; ++i)
      for (const auto& [x, y] : {std::pair{i, -2}, {-2, i}}) seen.push_back({0.1 * x, 0.1 * y});
    const SE2 middle(3.05, 1.05, 0);
    const SearchWindow window{2.5, 0.5, 0.1};
    const PlacesApart apart{0.7, 1};
    const auto answer = [&](const CorrelativeSearch& search, double share) {
      const auto found = search.find(seen, middle, window);
      REQUIRE(found);
      CHECK(found->score == doctest::Approx(1));
      return search.has_look_alike(*found, seen, middle, window, apart, share);
    };
    CHECK(answer(rooms({0, 1, 2}), 0.9));
    CHECK(answer(rooms({1, 2}), 0.9));
    CHECK_FALSE(answer(rooms({1}), 0.9));
    CHECK(answer(rooms({1}), 0.7));  // the walls alone
    // Of a window that holds one room alone, that is the only one.
    const CorrelativeSearch equal = rooms({0, 1, 2});
    const SearchWindow narrow{1.5, 0.5, 0.1};
    const auto found = equal.find(seen, middle, narrow);
    REQUIRE(found);
    CHECK_FALSE(equal.has_look_alike(*found, seen, middle, narrow, apart, 0.9));
  }

  TEST_CASE("correlative: a square's largest is the largest of its cells") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    const ScoreGrid grid = drawn_grid(random, 20);
    ScoreGrid wide = grid;
    int side = 1;
    for (const int shift : {1, 1, 3, 2, 8}) {
      wide = wide.largest_of_two(shift);
      side += shift;
      for (int row = 0; row < wide.rows(); ++row)
        for (int column = 0; column < wide.columns(); ++column) {
          int largest = 0;
          for (int r = 0; r < side; ++r)
            for (int c = 0; c < side; ++c)
              largest = std::max(largest, grid.at(column - side + 1 + c, row - side + 1 + r));
          REQUIRE(wide.at(column, row) == largest);
        }
    }
  }

  TEST_CASE("correlative: nothing is found above what there is, or without points") {
    ScoreGrid grid({0.1, 0, 0}, {0, 0}, 10, 10);
    grid(5, 5) = 128;
    const CorrelativeSearch search(grid, 3);
    const std::vector<ScanPoint> one{{0, 0}};
    CHECK(search.find(one, SE2(0.55, 0.25, 0), {0.5, 0.5, 0}));
    CHECK_FALSE(search.find(one, SE2(0.55, 0.25, 0), {0.5, 0.5, 0}, 0.51));
    CHECK_FALSE(search.find(one, SE2(0.55, 0.25, 0), {0.5, 0.2, 0}));
    CHECK_FALSE(search.find({}, SE2(), {}));
    CHECK_FALSE(search.find(one, SE2(1e5, 1e5, 0), {}));
  }

  TEST_CASE("correlative: bad windows, middles and sizes are refused in words") {
    const CorrelativeSearch search(ScoreGrid({0.1, 0, 0}, {0, 0}, 4, 4), 2);
    const std::vector<ScanPoint> one{{0, 0}};
    const auto words = [&](const SE2& middle, const SearchWindow& window) {
      return cairn_test::message_of([&] { static_cast<void>(search.find(one, middle, window)); });
    };
    CHECK(words(SE2(), {1000, 1, 0}).find("window") != std::string::npos);
    CHECK(words(SE2(), {1, std::nan(""), 0}).find("window") != std::string::npos);
    CHECK(words(SE2(), {1, 1, 4}).find("window") != std::string::npos);
    CHECK(words(SE2(1e12, 0, 0), {}).find("origin") != std::string::npos);
    CHECK(cairn_test::message_of([] { const ScoreGrid grid({}, {}, 0, 3); }).find("16384") !=
          std::string::npos);
    CHECK(cairn_test::message_of([] {
            const CorrelativeSearch none(ScoreGrid({}, {}, 3, 3), 0);
          }).find("levels") != std::string::npos);
  }
}

}  // namespace correlative_test
