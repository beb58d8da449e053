// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "wheel_errors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <deque>
#include <iterator>
#include <map>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so2.hpp>

namespace fastslam {
namespace {

using cairn::SE2;
using cairn::Vector;

/// Metres gone, radians turned on the way and radians turned on the spot, by odometry until a time.
class Gone {
public:
  explicit Gone(std::span<const WheelSpeeds> odometry) : odometry_(odometry) {
    for (std::size_t i = 0; i + 1 < odometry.size(); ++i)
      until_.emplace_back(until_.back() + (odometry[i + 1].time - odometry[i].time) * rates(odometry[i]));
  }
  [[nodiscard]] Vector<3> until(double time) const {
    const auto after = std::ranges::upper_bound(odometry_, time, {}, &WheelSpeeds::time);
    if (after == odometry_.begin()) return Vector<3>::Zero();
    const auto i = static_cast<std::size_t>(after - odometry_.begin()) - 1;
    if (after == odometry_.end()) return until_[i];
    return until_[i] + (time - odometry_[i].time) * rates(odometry_[i]);
  }

private:
  static Vector<3> rates(const WheelSpeeds& now) {
    return is_on_the_spot(now) ? Vector<3>(now.speed, 0, now.turn) : Vector<3>(now.speed, now.turn, 0);
  }

  std::span<const WheelSpeeds> odometry_;
  std::vector<Vector<3>> until_{Vector<3>::Zero()};
};

/// A bar code seen at two times.
struct SeenTwice {
  double from, to;
  Vector<2> place;  // from the robot, at first
  double bearing;   // then
};

/// Each sighting with the last one of the same code that is `least` to `most` seconds before it.
std::vector<SeenTwice> seen_twice(std::span<const CodeSighting> sightings, double least, double most) {
  std::vector<SeenTwice> pairs;
  std::map<int, std::deque<const CodeSighting*>> sightings_of;  // not older than that
  for (const CodeSighting& seen : sightings) {
    std::deque<const CodeSighting*>& before = sightings_of[seen.code];
    while (!before.empty() && seen.time - before.front()->time > most) before.pop_front();
    const auto too_late = std::ranges::partition_point(before, [&](const CodeSighting* old) {
      return seen.time > old->time && seen.time - old->time >= least;
    });
    if (too_late != before.begin()) {
      const CodeSighting& first = **std::prev(too_late);
      const Vector<2> place = first.range * Vector<2>(std::cos(first.bearing), std::sin(first.bearing));
      pairs.push_back({first.time, seen.time, place, seen.bearing});
    }
    before.push_back(&seen);
  }
  return pairs;
}

/// What odometry says of the robot between the two sightings.
Vector<3> gone_between(const SeenTwice& pair, const Gone& gone, double delay) {
  return gone.until(pair.to - delay) - gone.until(pair.from - delay);
}

/// How far the bearings of codes that were seen twice are from where wheels with these errors would have
/// turned them [rad]: the sum, which a code that is read wrongly does not pull at.
double sum_of_errors(const std::vector<SeenTwice>& pairs, const Gone& gone, const WheelErrors& wheels) {
  double sum = 0;
  for (const SeenTwice& p : pairs) {
    const Vector<3> moved = gone_between(p, gone, wheels.delay);
    const double turned = wheels.turn * moved(1) + wheels.turn_on_the_spot * moved(2);
    const Vector<2> then = SE2::exp(Vector<3>(moved(0), 0, turned)).inverse() * p.place;
    sum += std::abs(cairn::SO2(p.bearing - std::atan2(then(1), then(0))).angle());
  }
  return sum;
}

}  // namespace

bool is_on_the_spot(const WheelSpeeds& odometry) {
  constexpr double slowest = 0.01;  // [m/s]
  return std::abs(odometry.speed) < slowest;
}

WheelErrors wheel_errors(std::span<const WheelSpeeds> odometry, std::span<const CodeSighting> sightings) {
  constexpr std::size_t enough = 100, enough_turned = 30;
  constexpr double turned = 0.1;  // [rad]
  constexpr int most_rounds = 10;
  const std::vector<SeenTwice> soon = seen_twice(sightings, 0, 1);
  const std::vector<SeenTwice> later = seen_twice(sightings, 1, 2);
  const Gone gone(odometry);
  // The best of middle + i step, |i| <= reach; of two as good the one nearer to the middle.
  const auto best = [&](const auto& pairs, const auto& with, int middle, int step, int reach) {
    int found = middle;
    double least = sum_of_errors(pairs, gone, with(middle));
    for (int i = 1; i <= reach; ++i)
      for (const int value : {middle + i * step, middle - i * step})
        if (const double sum = sum_of_errors(pairs, gone, with(value)); sum < least) {
          least = sum;
          found = value;
        }
    return found;
  };
  const auto has_turned = [&](int kind, double delay) {
    const auto has = [&](const SeenTwice& p) {
      return std::abs(gone_between(p, gone, delay)(kind)) > turned;
    };
    return static_cast<std::size_t>(std::ranges::count_if(later, has)) >= enough_turned;
  };
  WheelErrors now;
  for (int round = 0; round < most_rounds; ++round) {
    const WheelErrors before = now;
    const auto set = [&](double WheelErrors::* which, double to) {
      WheelErrors wheels = now;
      wheels.*which = to;
      return wheels;
    };
    if (soon.size() >= enough) {
      const auto delayed = [&](int hundredths) { return set(&WheelErrors::delay, hundredths / 100.0); };
      now = delayed(best(soon, delayed, 0, 1, 50));
    }
    int kind = 1;
    for (const auto which : {&WheelErrors::turn, &WheelErrors::turn_on_the_spot}) {
      if (!has_turned(kind++, now.delay)) continue;
      const auto turning = [&](int thousandths) { return set(which, thousandths / 1000.0); };
      now = turning(best(later, turning, best(later, turning, 1000, 20, 30), 1, 20));
    }
    if (now == before) break;
  }
  return now;
}

}  // namespace fastslam
