// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "frame_budget.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <deque>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>

#include "support/folder.hpp"

namespace frame_budget_test {
namespace {

using stereo_slam::FrameBudget;
using stereo_slam::Shed;
using stereo_slam::ShedSet;

constexpr int all_points = 2000;

bool has(const ShedSet& set, Shed kind) {
  return set[static_cast<std::size_t>(kind)];
}

/// Frames that cost a + b n milliseconds and whose number of points n was chosen `delay` frames before.
std::vector<int> points_over_frames(FrameBudget& budget, double a, double b, std::size_t delay,
                                    std::size_t frames) {
  std::deque<int> chosen(delay, budget.points());
  std::vector<int> used;
  for (std::size_t i = 0; i < frames; ++i) {
    chosen.push_back(budget.points());
    const int n = chosen.front();
    chosen.pop_front();
    used.push_back(n);
    budget.finish(n, n, a + b * n);
  }
  return used;
}

}  // namespace

TEST_SUITE_BEGIN("examples/frame_budget");

TEST_CASE("frame_budget: without one nothing is left out, whatever it takes") {
  FrameBudget budget({}, all_points);
  CHECK_FALSE(budget.on());
  for (int i = 0; i < 20; ++i) {
    budget.took(Shed::keyframe, 1e6);
    CHECK(budget.allows(Shed::keyframe, 1e9));
    CHECK(budget.finish(all_points, all_points, 1e9).none());
    CHECK(budget.points() == all_points);
  }
}

TEST_CASE("frame_budget: one that is long enough leaves nothing out") {
  FrameBudget budget({.milliseconds = 100}, all_points);
  for (int i = 0; i < 50; ++i) {
    CHECK(budget.allows(Shed::second_look, 40));
    budget.took(Shed::second_look, 10);
    CHECK(budget.finish(all_points, all_points, 80).none());
  }
  CHECK(budget.points() == all_points);
}

TEST_CASE("frame_budget: the points settle where the work fits, without swinging, however late they tell") {
  for (const std::size_t delay : {0U, 1U, 4U, 8U})
    for (const double fixed : {1.0, 8.0, 14.0}) {
      CAPTURE(delay);
      CAPTURE(fixed);
      constexpr double budget_ms = 20, each = 0.015;  // 2000 points: 30 ms and what is fixed
      FrameBudget budget({.milliseconds = budget_ms}, all_points);
      const std::vector<int> used = points_over_frames(budget, fixed, each, delay, 200);
      const double fits = (budget_ms - fixed) / each;
      CHECK(used.back() < fits);         // within the budget,
      CHECK(used.back() > 0.65 * fits);  // and not far below it
      CHECK(std::ranges::is_sorted(used, std::ranges::greater()));
      CHECK(used[150] == used.back());
    }
}

TEST_CASE(
    "frame_budget: never fewer than the least, nor than asked for, and all of them when there is time "
    "again") {
  FrameBudget budget({.milliseconds = 5}, all_points);
  CHECK(points_over_frames(budget, 50, 0.01, 2, 60).back() == 300);
  budget.finish(300, 300, 1e-3);  // one frame that took no time is no reason to take all points
  CHECK(budget.points() > 300);
  CHECK(budget.points() < 300 + (all_points - 300) / 3);
  CHECK(points_over_frames(budget, 0.1, 1e-4, 2, 60).back() == all_points);
  FrameBudget few({.milliseconds = 5}, 100);
  CHECK(points_over_frames(few, 50, 0.01, 0, 30).back() == 100);
  CHECK(few.finish(100, 100, 1e3).none());
}

TEST_CASE("frame_budget: work is left out where what it took of late does not fit, and is named") {
  FrameBudget budget({.milliseconds = 30}, all_points);
  CHECK(budget.allows(Shed::keyframe, 29));  // nothing is known of it
  budget.took(Shed::keyframe, 8);
  CHECK(budget.finish(all_points, all_points, 25).none());
  CHECK(budget.allows(Shed::keyframe, 22));
  CHECK_FALSE(budget.allows(Shed::keyframe, 22.1));
  CHECK(budget.allows(Shed::tidying, 22.1));
  ShedSet shed = budget.finish(all_points, all_points, 22.1);
  CHECK(has(shed, Shed::keyframe));
  CHECK(shed.count() == 1);
  CHECK(budget.finish(all_points, all_points, 10).none());  // a new frame
  shed = budget.finish(1000, 1000, 10);
  CHECK(has(shed, Shed::points));
  CHECK(shed.count() == 1);
}

TEST_CASE("frame_budget: what took long once is tried again, what always does is not begun too late") {
  FrameBudget budget({.milliseconds = 30}, all_points);
  budget.took(Shed::second_look, 500);  // the disk was asleep
  int refused = 0;
  while (!budget.allows(Shed::second_look, 15)) ++refused;
  CHECK(refused > 1);
  CHECK(refused < 40);
  for (int i = 0; i < 60; ++i) budget.took(Shed::second_look, 5);
  CHECK(budget.allows(Shed::second_look, 24));
  for (int i = 0; i < 1000; ++i) CHECK_FALSE(budget.allows(Shed::second_look, 30.5));
}

TEST_CASE("frame_budget: what was left out counts when the points are chosen") {
  // The frame fits without the second look; with fewer points it would fit with it, which is worth more.
  FrameBudget budget({.milliseconds = 30}, all_points);
  budget.took(Shed::second_look, 12);
  for (int i = 0; i < 5; ++i) {
    CHECK_FALSE(budget.allows(Shed::second_look, 26));
    budget.finish(all_points, all_points, 26);
    budget.took(Shed::second_look, 12);
  }
  CHECK(budget.points() < all_points);
}

TEST_CASE("frame_budget: one that is no time is refused") {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {0.0, -1.0, infinity, std::nan("")}) {
    CAPTURE(bad);
    const std::string words =
        cairn_test::message_of([&] { const FrameBudget budget({.milliseconds = bad}, all_points); });
    CHECK(words.find("expected a positive number of milliseconds") != std::string::npos);
  }
}

TEST_SUITE_END();

}  // namespace frame_budget_test
