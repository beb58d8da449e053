// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/timeline.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "support/random.hpp"

namespace timeline_test {
namespace {

using cairn::Compass;
using cairn::Extended;
using cairn::Gaussian;
using cairn::PlanarPosition;
using cairn::SE2;
using cairn::SO2;
using cairn::Status;
using cairn::Timeline;
using cairn::Unicycle;
using cairn::Vector;

using Run = Timeline<Extended, Unicycle, Compass, PlanarPosition>;

// One thing that happens: 0 a control, 1 a heading, 2 a position.
struct Happening {
  int kind;
  double time;
  Vector<2> number;
};

std::vector<Happening> random_story(cairn::Random& random, int count) {
  std::vector<Happening> story;
  for (int i = 0; i < count; ++i) {
    Happening h{static_cast<int>(random.below(3)), 0.1 + 0.1 * i, Vector<2>::Zero()};
    h.number(0) = random.uniform(-1.0, 1.0);
    h.number(1) = random.uniform(-1.0, 1.0);
    story.push_back(h);
  }
  return story;
}

const Gaussian<SE2> prior{SE2(0, 0, 0.3), Vector<3>(0.5, 0.5, 0.2).asDiagonal()};
const Vector<2> start(1.0, 0.2);

Status tell(Run& run, const Happening& h) {
  if (h.kind == 0) return run.steer(h.number, h.time);
  if (h.kind == 1) return run.measure(Compass{.sigma = 0.3}, SO2(h.number(0)), h.time).status;
  return run.measure(PlanarPosition{.sigma = 0.4}, h.number, h.time).status;
}

// The filter by hand, everything in order.
Gaussian<SE2> in_order(const Extended& filter, const std::vector<Happening>& story, double end) {
  Gaussian<SE2> belief = prior;
  Vector<2> control = start;
  double time = 0.0;
  for (const Happening& h : story) {
    if (h.time > end) break;
    REQUIRE(filter.predict(belief, Unicycle{}, h.time - time, control) == Status::accepted);
    time = h.time;
    if (h.kind == 0) control = h.number;
    if (h.kind == 1) static_cast<void>(filter.update(belief, Compass{.sigma = 0.3}, SO2(h.number(0))));
    if (h.kind == 2) static_cast<void>(filter.update(belief, PlanarPosition{.sigma = 0.4}, h.number));
  }
  if (end > time) REQUIRE(filter.predict(belief, Unicycle{}, end - time, control) == Status::accepted);
  return belief;
}

bool same(const Gaussian<SE2>& a, const Gaussian<SE2>& b) {
  return cairn::local(a.mean, b.mean).norm() == 0.0 && a.covariance == b.covariance;
}

TEST_SUITE("timeline") {
  TEST_CASE("timeline: in any order of arrival it is the filter that got everything in order, bit for bit") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const double gate : {std::numeric_limits<double>::infinity(), 3.0}) {
      const Extended filter{.gate = gate};
      for (int run = 0; run < 20; ++run) {
        const auto story = random_story(random, 30);
        auto arrival = story;
        for (std::size_t i = arrival.size(); i > 1; --i) std::swap(arrival[i - 1], arrival[random.below(i)]);
        Run timeline(filter, Unicycle{}, prior, 0.0, start, 100.0);
        for (const Happening& h : arrival) {
          const Status status = tell(timeline, h);
          REQUIRE((status == Status::accepted || status == Status::gated));
        }
        CHECK(timeline.size() == story.size());
        CHECK(same(timeline.belief(), in_order(filter, story, story.back().time)));
        CHECK(same(timeline.at(1.23).value(), in_order(filter, story, 1.23)));
        CHECK(same(timeline.at(9.0).value(), in_order(filter, story, 9.0)));
        CHECK(same(timeline.at(0.0).value(), prior));
      }
    }
  }

  TEST_CASE("timeline: a measurement skipped is a prediction, one repeated counts twice") {
    Run timeline(Extended{}, Unicycle{}, prior, 0.0, start, 10.0);
    Gaussian<SE2> twice = prior, once = prior;
    const Compass compass{.sigma = 0.3};
    REQUIRE(timeline.measure(compass, SO2(0.5), 1.0).accepted());
    REQUIRE(timeline.measure(compass, SO2(0.5), 1.0).accepted());
    REQUIRE(Extended{}.predict(twice, Unicycle{}, 1.0, start) == Status::accepted);
    once = twice;
    REQUIRE(Extended{}.update(twice, compass, SO2(0.5)).accepted());
    REQUIRE(Extended{}.update(twice, compass, SO2(0.5)).accepted());
    CHECK(same(timeline.belief(), twice));
    // two readings of one heading are one of half the variance
    REQUIRE(Extended{}.update(once, Compass{.sigma = 0.3 / std::sqrt(2.0)}, SO2(0.5)).accepted());
    CHECK(cairn::local(once.mean, twice.mean).norm() < 1e-12);
    CHECK((once.covariance - twice.covariance).norm() < 1e-12);
  }

  TEST_CASE("timeline: forgets beyond its horizon and says so") {
    cairn::Random random(3);
    const auto story = random_story(random, 50);
    Run timeline(Extended{}, Unicycle{}, prior, 0.0, start, 1.0);
    for (const Happening& h : story) REQUIRE(tell(timeline, h) == Status::accepted);
    CHECK(timeline.size() <= 12);
    CHECK(same(timeline.belief(), in_order(Extended{}, story, story.back().time)));
    const auto before = timeline.belief();
    CHECK(tell(timeline, {1, 3.0, Vector<2>(0, 0)}) == Status::too_old);
    CHECK(tell(timeline, {0, 3.0, Vector<2>(0, 0)}) == Status::too_old);
    CHECK_FALSE(timeline.at(3.0).has_value());
    CHECK(same(timeline.belief(), before));
  }

  TEST_CASE(
      "timeline: what is older than the horizon is refused, though nothing came since, and several go at "
      "once") {
    const std::vector<Happening> story{{1, 0.1, Vector<2>(0.4, 0)},    {2, 0.2, Vector<2>(0.5, -0.1)},
                                       {0, 0.3, Vector<2>(0.8, -0.3)}, {2, 0.35, Vector<2>(0.3, 0.3)},
                                       {1, 5.0, Vector<2>(0.2, 0)},    {2, 5.5, Vector<2>(4.0, 1.0)}};
    Run timeline(Extended{}, Unicycle{}, prior, 0.0, start, 1.0);
    for (const Happening& h : story) REQUIRE(tell(timeline, h) == Status::accepted);
    CHECK(timeline.size() == 2);
    CHECK(same(timeline.belief(), in_order(Extended{}, story, 5.5)));
    CHECK(same(timeline.at(4.6).value(), in_order(Extended{}, story, 4.6)));
    for (const double late : {0.36, 2.0, 4.49}) {
      CAPTURE(late);
      CHECK(tell(timeline, {1, late, Vector<2>(0, 0)}) == Status::too_old);
      CHECK(tell(timeline, {0, late, Vector<2>(0, 0)}) == Status::too_old);
      CHECK_FALSE(timeline.at(late).has_value());
    }
    CHECK(tell(timeline, {1, 4.51, Vector<2>(0, 0)}) == Status::accepted);
  }

  TEST_CASE("timeline: refuses bad numbers and stays as it was") {
    Run timeline(Extended{}, Unicycle{}, prior, 0.0, start, 10.0);
    const double nan = std::nan("");
    REQUIRE(tell(timeline, {2, 1.0, Vector<2>(0, 1)}) == Status::accepted);
    const auto before = timeline.belief();
    CHECK(tell(timeline, {1, nan, Vector<2>(0, 0)}) == Status::bad_time_step);
    CHECK(tell(timeline, {0, INFINITY, Vector<2>(0, 0)}) == Status::bad_time_step);
    CHECK(tell(timeline, {2, 2.0, Vector<2>(nan, 0)}) == Status::not_finite);
    CHECK(tell(timeline, {2, 0.5, Vector<2>(0, nan)}) == Status::not_finite);
    CHECK(tell(timeline, {0, 0.5, Vector<2>(nan, 0)}) == Status::not_finite);
    // the newest too: no prediction needs it yet, and none could be made after it
    CHECK(tell(timeline, {0, 1.0, Vector<2>(nan, 0)}) == Status::not_finite);
    CHECK(tell(timeline, {0, 1.5, Vector<2>(0, INFINITY)}) == Status::not_finite);
    CHECK_FALSE(timeline.at(nan).has_value());
    CHECK(timeline.size() == 1);
    CHECK(same(timeline.belief(), before));
    CHECK(tell(timeline, {2, 2.0, Vector<2>(0, 1)}) == Status::accepted);
  }
}

}  // namespace
}  // namespace timeline_test
