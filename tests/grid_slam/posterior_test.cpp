// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// A robot drives five steps through a room; of the last pose, given the map that its path has made, a lattice
// of a million poses tells the posterior. What proposals draw and weigh has to be that.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/conditional.hpp>

#include "floor_plan.hpp"
#include "occupancy_map.hpp"
#include "support/random.hpp"

namespace posterior_test {
namespace {

using namespace cairn;
using namespace grid_slam;

using Points = std::vector<ScanPoint>;

/// 6 x 6 m, with a cupboard and a screen.
std::vector<Wall> room() {
  return {{-3, -3, 3, -3}, {3, -3, 3, 3},      {3, 3, -3, 3},      {-3, 3, -3, -3},
          {1, 3, 1, 2.2},  {1, 2.2, 2.1, 2.2}, {2.1, 2.2, 2.1, 3}, {0.7, -3, 1.3, -1.9}};
}

/// Every third degree to the front, a centimetre of noise.
Points seen_from(const SE2& pose, Random& random) {
  static const std::vector<Wall> walls = room();
  Points points;
  for (int beam = -30; beam <= 30; ++beam) {
    const double angle = 0.05 * beam;
    const double r = range_to_wall(walls, pose.x(), pose.y(), pose.angle() + angle) + 0.01 * random.normal();
    points.push_back({r * std::cos(angle), r * std::sin(angle)});
  }
  return points;
}

const SE2 step(0.2, 0.01, 0.12);  // what the robot does each time, and what its wheels say
const Matrix<3> noise = Vector<3>(0.02 * 0.02, 0.02 * 0.02, 0.015 * 0.015).asDiagonal();

/// What is asked: the map of a particle after four steps, the motion of the fifth, and what is seen then.
struct Question {
  OccupancyMap map;
  Gaussian<SE2> motion;
  Points seen;
};
Question fifth_step(std::uint64_t seed) {
  Random random(seed);
  const OccupancyMap empty{OccupancyGrid({.geometry = {}, .field_radius = 6}), {.independence = 0.1}};
  MappedPaths<OccupancyMap> belief(SE2(-1.5, -0.8, 0.1), empty, 1);
  SE2 truth = belief[0].pose;
  const auto motion = [](const SE2& x, std::size_t) {
    return RegimeMotion<SE2>{{{0, 1, {x * step, noise}}}};
  };
  const ConditionalFilter filter{.seed = seed};
  for (int k = 0; k < 4; ++k) {
    truth = truth * sample(Gaussian<SE2>{step, noise}, random);
    const MappingStep did = filter.step(belief, motion, FromMatch{}, seen_from(truth, random));
    REQUIRE(did.accepted());
  }
  truth = truth * sample(Gaussian<SE2>{step, noise}, random);
  return {belief[0].map, {belief[0].pose * step, noise}, seen_from(truth, random)};
}

/// Weighted steps from the motion's mean.
struct Weighted {
  std::vector<Vector<3>> steps;
  std::vector<double> weights;
  double total = 0;  ///< of the weights
};

/// The product of likelihood and motion at 100^3 poses over five standard deviations to each side; `total` is
/// its integral times e^-scale.
Weighted lattice(const Question& q, double scale) {
  constexpr int side = 100;
  Weighted all;
  all.steps.resize(side * side * side);
  all.weights.resize(all.steps.size());
  double volume = 1;
  std::array<double, 3> spacing{};
  for (int a = 0; a < 3; ++a) {
    spacing[static_cast<std::size_t>(a)] = 10 * std::sqrt(noise(a, a)) / side;
    volume *= spacing[static_cast<std::size_t>(a)];
  }
  parallel_for(all.steps.size(), 2, [&](std::size_t begin, std::size_t end) {
    auto field = q.map.grid.field();
    for (std::size_t i = begin; i < end; ++i) {
      std::size_t rest = i;
      double squared = 0;
      for (int a = 0; a < 3; ++a, rest /= side) {
        const double d =
            (static_cast<double>(rest % side) - 0.5 * (side - 1)) * spacing[static_cast<std::size_t>(a)];
        all.steps[i](a) = d;
        squared += d * d / noise(a, a);
      }
      const double l =
          log_likelihood(q.map.grid, field, q.seen, retract(q.motion.mean, all.steps[i]), q.map.model);
      all.weights[i] = volume * std::exp(l - scale - 0.5 * squared);
    }
  });
  const double constant =
      std::pow(2 * 3.14159265358979, 1.5) * std::sqrt(noise(0, 0) * noise(1, 1) * noise(2, 2));
  for (double& w : all.weights) all.total += w /= constant;
  return all;
}

/// Of `propose`; `total` is the mean of the weights times e^-scale.
template <class P>
Weighted draws(const Question& q, const P& propose, std::uint64_t seed, double scale,
               std::size_t count = 100000) {
  const RegimeMotion<SE2> motion{{{0, 1, q.motion}}};
  Weighted all{std::vector<Vector<3>>(count), std::vector<double>(count)};
  parallel_for(count, 2, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Random random(seed, i);
      const auto drawn = propose(q.map, motion, q.seen, random);
      all.steps[i] = local(q.motion.mean, drawn.pose);
      all.weights[i] = std::exp(drawn.log_weight - scale) / static_cast<double>(count);
    }
  });
  for (const double w : all.weights) all.total += w;
  return all;
}

/// Where along an axis the lattice's mass is parted into equal shares.
std::vector<double> quantiles(const Weighted& all, int axis, std::size_t parts) {
  std::vector<std::pair<double, double>> along;
  for (std::size_t i = 0; i < all.steps.size(); ++i) along.emplace_back(all.steps[i](axis), all.weights[i]);
  std::sort(along.begin(), along.end());
  std::vector<double> ends;
  double sum = 0;
  for (const auto& [at, weight] : along) {
    sum += weight;
    // Between two planes of the lattice, so that no mass lies on an end.
    if (ends.size() + 1 < parts &&
        sum > all.total * static_cast<double>(ends.size() + 1) / static_cast<double>(parts))
      ends.push_back(at + 0.05 * std::sqrt(noise(axis, axis)));
  }
  return ends;
}

/// Shares of the mass in the boxes that the ends of the axes bound.
std::vector<double> shares(const Weighted& all, const std::array<std::vector<double>, 3>& ends) {
  std::vector<double> mass((ends[0].size() + 1) * (ends[1].size() + 1) * (ends[2].size() + 1), 0);
  for (std::size_t i = 0; i < all.steps.size(); ++i) {
    std::size_t box = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto after = std::lower_bound(ends[a].begin(), ends[a].end(), all.steps[i](static_cast<int>(a)));
      box = box * (ends[a].size() + 1) + static_cast<std::size_t>(after - ends[a].begin());
    }
    mass[box] += all.weights[i] / all.total;
  }
  return mass;
}

double total_variation(const Weighted& a, const Weighted& b, const std::array<std::vector<double>, 3>& ends) {
  const std::vector<double> p = shares(a, ends), q = shares(b, ends);
  double sum = 0;
  for (std::size_t i = 0; i < p.size(); ++i) sum += 0.5 * std::abs(p[i] - q[i]);
  return sum;
}

}  // namespace

TEST_SUITE("grid_slam/posterior") {
  TEST_CASE("posterior: both proposals are the lattice's distribution, and their weights its integral") {
    const std::uint64_t seed = cairn_test::seed(3);
    CAPTURE(seed);
    // One room and drive for every seed, which draw from what there is to be drawn.
    const Question question = fifth_step(5);
    const double scale = question.map.log_likelihood(question.motion.mean, question.seen);
    const Weighted truth = lattice(question, scale);
    std::array<std::vector<double>, 3> boxes;
    for (int a = 0; a < 3; ++a) boxes[static_cast<std::size_t>(a)] = quantiles(truth, a, 4);
    const Weighted matched = draws(question, FromMatch{}, seed, scale);
    const Weighted bootstrap = draws(question, FromMotion{}, seed + 1000, scale);
    for (const Weighted* drawn : {&matched, &bootstrap}) {
      CHECK(drawn->total == doctest::Approx(truth.total).epsilon(0.01).scale(0));
      CHECK(total_variation(*drawn, truth, boxes) < 0.02);
      for (int a = 0; a < 3; ++a) {
        std::array<std::vector<double>, 3> along;
        along[static_cast<std::size_t>(a)] = quantiles(truth, a, 20);
        CHECK(total_variation(*drawn, truth, along) < 0.02);
      }
    }
    // The test sees what it is for: without their weights the draws are another distribution.
    const auto without_weights = [&](Weighted drawn) {
      std::fill(drawn.weights.begin(), drawn.weights.end(), 1.0);
      drawn.total = static_cast<double>(drawn.weights.size());
      return total_variation(drawn, truth, boxes);
    };
    FromMatch single;
    single.draws = 1;
    const double of_one = without_weights(draws(question, single, seed, scale, 10000));
    CHECK(of_one > 0.1);
    CHECK(without_weights(bootstrap) > 0.1);
    // One of several, kept by its weight, is nearly the posterior by itself.
    CHECK(without_weights(matched) < 0.5 * of_one);
  }
}

}  // namespace posterior_test
