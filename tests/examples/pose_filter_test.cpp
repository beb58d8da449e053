// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "pose_filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/random.hpp>
#include <cairn/manifold/derivatives.hpp>

#include "support/random.hpp"

namespace pose_filter_test {
namespace {

using stereo_slam::Motion;
using stereo_slam::MotionOptions;
using stereo_slam::Moving;
using stereo_slam::PoseFilter;
using stereo_slam::SteadyTwist;

constexpr std::array<Motion, 3> filters{Motion::ekf, Motion::iterated, Motion::ukf};

cairn::Vector<6> draw(cairn::Random& random, double position, double angle) {
  cairn::Vector<6> d;
  for (int i = 0; i < 6; ++i) d(i) = random.normal(0, i < 3 ? position : angle);
  return d;
}

cairn::Matrix<6> covariance_of(double position, double angle) {
  cairn::Matrix<6> P = cairn::Matrix<6>::Zero();
  for (int i = 0; i < 6; ++i) P(i, i) = std::pow(i < 3 ? position : angle, 2);
  return P;
}

/// White acceleration, in steps that are short against dt.
Moving driven(Moving x, const SteadyTwist& process, double dt, int steps, cairn::Random& random) {
  const double h = dt / steps;
  for (int i = 0; i < steps; ++i) {
    const cairn::Vector<6> kick =
        draw(random, process.acceleration * std::sqrt(h), process.turning * std::sqrt(h));
    const cairn::Vector<6> mean = x.part<1>() + 0.5 * kick;
    x = Moving(x.part<0>() * cairn::SE3::exp(h * mean), x.part<1>() + kick);
  }
  return x;
}

MotionOptions with(Motion filter) {
  MotionOptions options;
  options.filter = filter;
  return options;
}

}  // namespace

TEST_SUITE_BEGIN("stereo_slam/pose_filter");

TEST_CASE("pose_filter: the process's derivative is the numeric one") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  const SteadyTwist process;
  for (int i = 0; i < 20; ++i) {
    const Moving x(cairn::SE3::exp(draw(random, 2, 1)), draw(random, 10, 2));
    const cairn::Matrix<12> numeric =
        cairn::numeric_jacobian([&](const Moving& y) { return process.propagate(y, {}, 0.1); }, x);
    CHECK((process.jacobian(x, {}, 0.1) - numeric).cwiseAbs().maxCoeff() < 1e-6);
    CHECK(cairn::local(process.propagate(x, {}, 0), x).norm() < 1e-12);
  }
}

TEST_CASE("pose_filter: its noise is what white acceleration does to a twist that turns slowly") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  const SteadyTwist process{0.7, 0.4};
  const Moving start(cairn::SE3::exp(draw(random, 2, 1)), draw(random, 1, 0.3));
  const double dt = 0.1;
  const Moving end = process.propagate(start, {}, dt);
  cairn::Matrix<12> sum = cairn::Matrix<12>::Zero();
  constexpr int runs = 4000;
  for (int i = 0; i < runs; ++i) {
    const cairn::Vector<12> d = cairn::local(end, driven(start, process, dt, 20, random));
    sum += d * d.transpose() / runs;
  }
  const cairn::Matrix<12> Q = process.noise(start, {}, dt);
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j < 12; ++j) {
      CAPTURE(i);
      CAPTURE(j);  // five standard deviations of a sample covariance, and 2 % for the turn of a step
      const double unit = std::sqrt(Q(i, i) * Q(j, j));
      CHECK(std::abs(sum(i, j) - Q(i, j)) < (5 * std::sqrt(2.0 / runs) + 0.02) * unit);
    }
}

TEST_CASE("pose_filter: each of the three knows how wrong it is, and they agree") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  constexpr double position = 0.02, angle = 0.002, dt = 0.1;
  std::array<double, 3> nees{};
  double apart = 0;
  int count = 0;
  for (int run = 0; run < 60; ++run) {
    Moving truth(cairn::SE3::exp(draw(random, 1, 1)), draw(random, 2, 0.3));
    std::array<PoseFilter, 3> of{PoseFilter(with(filters[0])), PoseFilter(with(filters[1])),
                                 PoseFilter(with(filters[2]))};
    const cairn::SE3 first = truth.part<0>() * cairn::SE3::exp(draw(random, position, angle));
    for (PoseFilter& filter : of) filter.begin(first, covariance_of(position, angle));
    for (int k = 0; k < 20; ++k) {
      truth = driven(truth, SteadyTwist{}, dt, 10, random);
      const cairn::SE3 seen = truth.part<0>() * cairn::SE3::exp(draw(random, position, angle));
      for (PoseFilter& filter : of) {
        filter.predict(dt);
        // Every fourth frame shows nothing: what is predicted is held against the truth as well.
        if (k % 4 != 3) REQUIRE(filter.update(seen, covariance_of(position, angle)));
      }
      ++count;
      for (std::size_t i = 0; i < 3; ++i) {
        const auto pose = of[i].pose();
        REQUIRE(pose);
        const cairn::Vector<6> error = cairn::local(pose->mean, truth.part<0>());
        nees[i] += cairn::Cholesky<6>(pose->covariance).whiten(error).squaredNorm();
        apart = std::max(apart, cairn::local(pose->mean, of[0].pose()->mean).norm());
      }
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    CAPTURE(i);  // 60 runs of neighbours that err together: a tenth off is two standard deviations
    CHECK(nees[i] / count > 5);
    CHECK(nees[i] / count < 7);
  }
  CHECK(apart > 0);  // they are three
  CHECK(apart < 0.02);
}

TEST_CASE(
    "pose_filter: a jump is refused and leaves the belief; what is refused follows from the covariance") {
  for (const Motion motion : filters) {
    PoseFilter filter(with(motion));
    filter.begin({}, covariance_of(0.01, 0.001));
    cairn::SE3 at;
    const cairn::SE3 step = cairn::SE3::exp((cairn::Vector<6>() << 0, 0, 0.1, 0, 0.02, 0).finished());
    for (int k = 0; k < 10; ++k) {
      at = at * step;
      filter.predict(0.1);
      REQUIRE(filter.update(at, covariance_of(0.01, 0.001)));
    }
    filter.predict(0.1);
    const auto before = *filter.pose();
    CHECK((before.mean.translation() - (at * step).translation()).norm() < 0.02);
    const cairn::SE3 aside(at.rotation(), at.translation() + cairn::Vector<3>(0.6, 0, 0));
    CHECK_FALSE(filter.update(aside, covariance_of(0.01, 0.001)));
    CHECK(filter.pose()->mean.matrix() == before.mean.matrix());
    CHECK(filter.pose()->covariance == before.covariance);
    CHECK(filter.update(aside, covariance_of(0.3, 0.001)));  // as vague as this it may well be
  }
}

TEST_CASE("pose_filter: a camera that sees nothing is known for half a second, not for three") {
  for (const Motion motion : filters) {
    PoseFilter filter(with(motion));
    CHECK_FALSE(filter.knows());
    CHECK_FALSE(filter.pose());
    filter.begin({}, covariance_of(0.01, 0.001));
    CHECK(filter.knows());
    for (int k = 0; k < 10; ++k) {
      filter.predict(0.1);
      REQUIRE(filter.update({}, covariance_of(0.01, 0.001)));
    }
    for (int k = 0; k < 5; ++k) filter.predict(0.1);
    CHECK(filter.knows());
    for (int k = 0; k < 25; ++k) filter.predict(0.1);
    CHECK_FALSE(filter.knows());
    filter.begin({}, covariance_of(0.01, 0.001));
    CHECK(filter.knows());
  }
  PoseFilter off;
  off.begin({}, covariance_of(0.01, 0.001));
  CHECK_FALSE(off.on());
  CHECK_FALSE(off.knows());
}

TEST_CASE("pose_filter: what is not finite is not taken") {
  for (const Motion motion : filters) {
    PoseFilter filter(with(motion));
    filter.begin({}, covariance_of(0.01, 0.001));
    filter.predict(0.1);
    cairn::Matrix<6> P = covariance_of(0.01, 0.001);
    P(2, 2) = std::numeric_limits<double>::quiet_NaN();
    CHECK_FALSE(filter.update({}, P));
    CHECK(filter.update({}, covariance_of(0.01, 0.001)));
    filter.predict(std::numeric_limits<double>::infinity());
    CHECK_FALSE(filter.knows());
  }
}

TEST_SUITE_END();

}  // namespace pose_filter_test
