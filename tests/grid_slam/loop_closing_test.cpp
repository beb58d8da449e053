// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "loop_closing.hpp"

#include <cmath>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
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
      for (std::size_t k = 1; k < poses.size(); ++k)
        for (int axis = 0; axis < 3; ++axis)
          for (const double h : {1e-4, -1e-4}) {
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
    const Matrix<3> prior = covariance_between(chain, 1, 5);
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
      CHECK(covariance(i, i) == doctest::Approx(posterior(i, i)).epsilon(0.06));
    }
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
