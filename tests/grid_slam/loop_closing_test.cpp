// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "loop_closing.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/filter/gaussian.hpp>

#include "support/random.hpp"

namespace loop_closing_test {
namespace {

using namespace cairn;
using namespace grid_slam;

StepChain drawn_chain(Random& random, std::size_t steps, double sigma) {
  StepChain chain{SE2(1, 2, 0.3), {}, {}};
  for (std::size_t k = 0; k < steps; ++k) {
    chain.steps.emplace_back(0.5 + 0.1 * random.normal(), 0.05 * random.normal(), 0.2 * random.normal());
    Matrix<3> a;
    for (int i = 0; i < 9; ++i) a(i / 3, i % 3) = sigma * random.normal();
    chain.covariances.emplace_back(a * a.transpose() + Matrix<3>(sigma * sigma * Matrix<3>::Identity()));
  }
  return chain;
}

/// -2 log of the density of a path given the loops, but for a constant.
double cost(const StepChain& chain, const std::vector<Loop>& loops, const std::vector<SE2>& poses) {
  double sum = 0;
  for (std::size_t k = 0; k < chain.steps.size(); ++k) {
    const Vector<3> d = local(chain.steps[k], SE2(poses[k].inverse() * poses[k + 1]));
    sum += d.dot(chain.covariances[k].inverse() * d);
  }
  for (const Loop& loop : loops) {
    const Vector<3> d = local(SE2(poses[loop.first].inverse() * poses[loop.last]), loop.T_first_last);
    sum += d.dot(loop.covariance.inverse() * d);
  }
  return sum;
}

/// Three steps, each of a length that is uncertain and a turn that is not, and a loop from the first pose to
/// the last: few enough paths for counting all.
namespace toy {

constexpr std::size_t steps = 3, parts = 3, classes = parts * parts * parts;
constexpr std::array<double, steps> length{1.0, 0.8, 1.2}, turn{0.9, -1.7, 0.4}, sigma{0.2, 0.3, 0.25};
constexpr double seen_x = 1.75, seen_y = 1.0, seen_sigma = 0.4;

Loop loop() {
  return {0, steps, SE2(seen_x, seen_y, turn[0] + turn[1] + turn[2]),
          Matrix<3>(Vector<3>(seen_sigma * seen_sigma, seen_sigma * seen_sigma, 1).asDiagonal())};
}

/// Which of the thirds of its prior, about, each step's error is in: their ends lie between the lattice's
/// points.
std::size_t class_of(const std::array<double, steps>& errors) {
  std::size_t number = 0;
  for (std::size_t k = 0; k < steps; ++k) {
    const double e = errors[k] / sigma[k];
    number = parts * number + (e < -0.45 ? 0U : e < 0.45 ? 1U : 2U);
  }
  return number;
}
std::size_t class_of(const std::vector<PathPose<SE2>>& path) {
  std::array<double, steps> errors{};
  for (std::size_t k = 0; k < steps; ++k)
    errors[k] = (path[k].pose.inverse() * path[k + 1].pose).x() - length[k];
  return class_of(errors);
}

/// What is to come out, by summing prior times likelihood over a lattice of all paths.
std::vector<double> enumerated() {
  std::vector<double> probability(classes, 0);
  constexpr int half = 50;
  constexpr double spacing = 0.1;  // standard deviations
  double total = 0;
  for (int a = -half; a <= half; ++a)
    for (int b = -half; b <= half; ++b)
      for (int c = -half; c <= half; ++c) {
        const std::array<double, steps> units{spacing * a, spacing * b, spacing * c};
        std::array<double, steps> errors{};
        double x = 0, y = 0, heading = 0, prior = 0;
        for (std::size_t k = 0; k < steps; ++k) {
          errors[k] = units[k] * sigma[k];
          x += (length[k] + errors[k]) * std::cos(heading);
          y += (length[k] + errors[k]) * std::sin(heading);
          heading += turn[k];
          prior += units[k] * units[k];
        }
        // The loop's error is on the right of the last pose: turned, which a circle does not mind.
        const double dx = (x - seen_x) / seen_sigma, dy = (y - seen_y) / seen_sigma;
        const double p = std::exp(-0.5 * (prior + dx * dx + dy * dy));
        probability[class_of(errors)] += p;
        total += p;
      }
  for (double& p : probability) p /= total;
  return probability;
}

std::vector<PathPose<SE2>> drawn_path(Random& random) {
  std::vector<PathPose<SE2>> path{{SE2(), {SE2(), Matrix<3>::Zero()}, SE2(), SE2(), 0}};
  for (std::size_t k = 0; k < steps; ++k) {
    const SE2 before = path.back().pose, mean = before * SE2(length[k], 0, turn[k]);
    // On the right of the pose after the turn, so turned back.
    const Vector<2> along(std::cos(turn[k]), -std::sin(turn[k]));
    Matrix<3> covariance = Matrix<3>::Zero();
    covariance.topLeftCorner<2, 2>() = sigma[k] * sigma[k] * along * along.transpose();
    const SE2 drawn = before * SE2(length[k] + sigma[k] * random.normal(), 0, turn[k]);
    path.push_back({drawn, {mean, covariance}, before, drawn, k + 1});
  }
  return path;
}

/// Pearson's sum over the classes.
double distance_from(const std::vector<double>& expected, const std::vector<double>& counted, double count) {
  double sum = 0;
  for (std::size_t i = 0; i < classes; ++i) {
    const double e = count * expected[i];
    sum += (counted[i] - e) * (counted[i] - e) / e;
  }
  return sum;
}

}  // namespace toy

}  // namespace

TEST_SUITE("grid_slam/loop_closing") {
  TEST_CASE(
      "loop_closing: without noise the path is the least squares' optimum: no pose can be moved for less") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 10; ++trial) {
      const StepChain chain = drawn_chain(random, 20, 0.01);
      const auto before = poses_of(chain);
      std::vector<Loop> loops;
      for (const auto& [first, last] :
           std::vector<std::pair<std::size_t, std::size_t>>{{0, 15}, {3, 20}, {5, 9}})
        loops.push_back(
            {first, last,
             retract(SE2(before[first].inverse() * before[last]),
                     Vector<3>(0.03 * random.normal(), 0.03 * random.normal(), 0.01 * random.normal())),
             Matrix<3>(1e-4 * Matrix<3>::Identity())});
      const std::vector<Vector<3>> none(loops.size(), Vector<3>::Zero());
      auto poses = conditioned(chain, loops, none);
      const double least = cost(chain, loops, poses);
      CHECK(least < cost(chain, loops, before));
      // A loop's error is linearised without its own turn, about a hundredth here, so that the optimum is
      // missed by some thousandths of a step's deviation, 0.01 or more. A pose half a hundredth of one off,
      // in units of the step below, would be seen.
      for (std::size_t k = 1; k < poses.size(); ++k)
        for (int axis = 0; axis < 3; ++axis)
          for (const double h : {5e-4, -5e-4}) {
            const SE2 kept = poses[k];
            Vector<3> d = Vector<3>::Zero();
            d(axis) = h;
            poses[k] = retract(kept, d);
            REQUIRE(cost(chain, loops, poses) > least);
            poses[k] = kept;
          }
    }
  }

  TEST_CASE(
      "loop_closing: paths drawn from the steps and moved by noisy loops have the posterior's moments") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    const StepChain chain = drawn_chain(random, 6, 0.004);
    const auto mean_path = poses_of(chain);
    const Loop loop{1, 5, retract(SE2(mean_path[1].inverse() * mean_path[5]), Vector<3>(0.01, -0.01, 0.004)),
                    Matrix<3>(4e-5 * Matrix<3>::Identity())};
    // The joint Gaussian of the path's end seen from pose 1, by the information form: S and R are independent
    // measurements of it.
    const Matrix<3> prior = ChainCovariance(chain).between(1, 5);
    const Matrix<3> posterior = (prior.inverse() + loop.covariance.inverse()).inverse();
    const Vector<3> expected = posterior * (loop.covariance.inverse() * Vector<3>(0.01, -0.01, 0.004));
    constexpr int count = 20000;
    Vector<3> mean = Vector<3>::Zero();
    Matrix<3> square = Matrix<3>::Zero();
    for (int i = 0; i < count; ++i) {
      StepChain drawn = chain;
      for (std::size_t k = 0; k < drawn.steps.size(); ++k)
        drawn.steps[k] = sample(Gaussian<SE2>{chain.steps[k], chain.covariances[k]}, random);
      const Vector<3> v = std::sqrt(4e-5) * Vector<3>(random.normal(), random.normal(), random.normal());
      const auto poses = conditioned(drawn, {loop}, {v});
      const Vector<3> d =
          local(SE2(mean_path[1].inverse() * mean_path[5]), SE2(poses[1].inverse() * poses[5]));
      mean += d / count;
      square += d * d.transpose() / count;
    }
    const Matrix<3> covariance = square - mean * mean.transpose();
    for (int i = 0; i < 3; ++i) {
      CHECK(std::abs(mean(i) - expected(i)) < 5 * std::sqrt(posterior(i, i) / count) + 2e-4);
      CHECK(covariance(i, i) == doctest::Approx(posterior(i, i)).epsilon(0.06).scale(0));
    }
  }

  TEST_CASE(
      "loop_closing: the move of a path keeps its distribution, in detailed balance: all paths enumerated") {
    const std::uint64_t seed = cairn_test::seed(5);
    CAPTURE(seed);
    Random random(seed);
    const std::vector<double> expected = toy::enumerated();
    constexpr int count = 60000;
    std::vector<double> once(toy::classes, 0), again(toy::classes, 0), twice_counted(toy::classes, 0);
    std::vector<double> from_to(toy::classes * toy::classes, 0);
    for (int i = 0; i < count; ++i) {
      const auto moved = moved_by(toy::drawn_path(random), {toy::loop()}, random);
      const auto moved_again = moved_by(moved, {toy::loop()}, random);
      const std::size_t from = toy::class_of(moved), to = toy::class_of(moved_again);
      ++once[from];
      ++again[to];
      ++from_to[from * toy::classes + to];
      // What would be wrong: to take the moved path for one that was drawn.
      auto taken_for_drawn = moved;
      for (std::size_t k = 1; k < taken_for_drawn.size(); ++k) {
        taken_for_drawn[k].before = taken_for_drawn[k - 1].pose;
        taken_for_drawn[k].drawn = taken_for_drawn[k].pose;
      }
      ++twice_counted[toy::class_of(moved_by(taken_for_drawn, {toy::loop()}, random))];
    }
    const double enough = chi_square_quantile(1 - 1e-6, toy::classes - 1);
    CHECK(toy::distance_from(expected, once, count) < enough);
    CHECK(toy::distance_from(expected, again, count) < enough);
    CHECK(toy::distance_from(expected, twice_counted, count) > 3 * enough);
    // As many paths go from a to b as from b to a.
    double sum = 0, pairs = 0, changed = 0;
    for (std::size_t a = 0; a < toy::classes; ++a)
      for (std::size_t b = 0; b < a; ++b) {
        const double there = from_to[a * toy::classes + b], back = from_to[b * toy::classes + a];
        changed += there + back;
        if (there + back < 20) continue;
        sum += (there - back) * (there - back) / (there + back);
        ++pairs;
      }
    CHECK(pairs > 20);
    CHECK(changed > 0.2 * count);
    CHECK(sum < chi_square_quantile(1 - 1e-6, pairs));
  }

  TEST_CASE("loop_closing: no loops leave the chain, and steps outside of all loops their values") {
    Random random(3);
    const StepChain chain = drawn_chain(random, 10, 0.01);
    const auto before = poses_of(chain);
    const auto same = conditioned(chain, {}, {});
    for (std::size_t k = 0; k < before.size(); ++k) CHECK(local(before[k], same[k]).norm() < 1e-12);
    const Loop loop{2, 6, SE2(2.5, 0.3, 0.2), Matrix<3>(1e-6 * Matrix<3>::Identity())};
    const auto moved = conditioned(chain, {loop}, {Vector<3>::Zero()});
    for (std::size_t k = 0; k <= 2; ++k) CHECK(local(before[k], moved[k]).norm() < 1e-12);
    for (std::size_t k = 6; k < 10; ++k)
      CHECK(local(chain.steps[k], SE2(moved[k].inverse() * moved[k + 1])).norm() < 1e-9);
    CHECK(local(loop.T_first_last, SE2(moved[2].inverse() * moved[6])).norm() < 0.05);
  }
}

}  // namespace loop_closing_test
