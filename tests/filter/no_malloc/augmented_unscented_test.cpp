// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/augmented_unscented.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/models/motion.hpp>

#include "filter/linear_problems.hpp"
#include "filter/no_malloc/eigen.hpp"
#include "support/random.hpp"

namespace augmented_unscented_test {
namespace {

using cairn::AugmentedUnscented;
using cairn::Gaussian;
using cairn::Kalman;
using cairn::Matrix;
using cairn::SE2;
using cairn::SigmaPoints;
using cairn::Status;
using cairn::Vector;
using cairn_test::LinearProblem;
using cairn_test::relative_error;

// 200 steps beside the Kalman filter; by step(), or by predict() and `updates` times update().
template <int N, int M, class S>
double distance_from_kalman(const SigmaPoints& points, int updates, bool by_step) {
  const auto seed = cairn_test::seed();
  CAPTURE(seed);
  cairn::Random random(seed);
  const LinearProblem<N, M, S> p(random);
  auto exact = p.prior, belief = p.prior;
  const AugmentedUnscented filter{.points = points};
  double worst = 0.0;
  for (int step = 0; step < 200; ++step) {
    REQUIRE(Kalman{}.predict(exact, p.process, 1.0) == Status::accepted);
    if (!by_step) REQUIRE(filter.predict(belief, p.process, 1.0) == Status::accepted);
    for (int k = 0; k < updates; ++k) {
      const Vector<M, S> z = cairn_test::random_matrix<M, 1, S>(random);
      const auto expected = Kalman{}.update(exact, p.sensor, z);
      const auto found =
          by_step ? filter.step(belief, p.process, 1.0, p.sensor, z) : filter.update(belief, p.sensor, z);
      REQUIRE(found.accepted());
      worst = std::max(worst, relative_error(found.covariance, expected.covariance));
    }
    worst = std::max(worst, relative_error(belief.covariance, exact.covariance));
    worst = std::max(worst, 0.1 * relative_error(belief.mean, exact.mean));
  }
  return worst;
}

// A wheel whose speed is known up to a factor: the noise multiplies.
struct Slipping {
  using State = SE2;
  using Control = Vector<2>;
  using Noise = Vector<2>;
  [[nodiscard]] SE2 propagate(const SE2& x, const Control& u, const Noise& w, double dt) const {
    return x * SE2::exp(Vector<3>(u(0) * (1 + w(0)) * dt, 0.0, u(1) * (1 + w(1)) * dt));
  }
  [[nodiscard]] Matrix<2> noise(const SE2&, const Control&, double) const {
    return Vector<2>(0.01, 0.04).asDiagonal();
  }
};

// A distance whose error grows with the distance.
struct Echo {
  using State = SE2;
  using Measurement = Vector<1>;
  using Noise = Vector<1>;
  [[nodiscard]] Vector<1> predict(const SE2& x, const Noise& v) const {
    return Vector<1>((Vector<2>(5, 1) - x.translation()).norm() * (1 + v(0)));
  }
  [[nodiscard]] Matrix<1> noise(const SE2&) const { return Matrix<1>(4e-4); }
};

TEST_SUITE("augmented_unscented") {
  TEST_CASE("augmented: is the Kalman filter on linear models, in all three forms and for every alpha") {
    for (const double alpha : {1.0, 1e-1, 1e-2, 1e-3, 1e-4}) {
      CAPTURE(alpha);
      const SigmaPoints points{.alpha = alpha, .beta = 2.0, .kappa = 0.0};
      const double tolerance = 1e-12 / alpha;
      CHECK(distance_from_kalman<2, 1, double>(points, 1, false) < tolerance);
      CHECK(distance_from_kalman<2, 1, double>(points, 2, false) < tolerance);
      CHECK(distance_from_kalman<2, 1, double>(points, 1, true) < tolerance);
      CHECK(distance_from_kalman<2, 1, float>(points, 1, true) < 1e-2);
    }
  }

  TEST_CASE("augmented: reproduces the EKF/UKF Toolbox of Hartikainen, Solin and Sarkka") {
    const cairn::LinearModel<2> process{(Matrix<2>() << 1, 1, 0, 1).finished(), 2 * Matrix<2>::Identity()};
    const cairn::LinearSensor<1, 2> sensor{Matrix<1, 2>(0.5, -0.3), Matrix<1>(0.5)};
    Gaussian<Vector<2>> belief{Vector<2>(1, 1), (Matrix<2>() << 1, 0.1, 0.1, 1).finished()};
    auto extended = belief;
    const AugmentedUnscented filter{.points = {.alpha = 1.0, .beta = 0.0, .kappa = 1.0}};
    for (int k = 0; k < 3; ++k) {
      REQUIRE(filter.predict(belief, process, 1.0) == Status::accepted);
      REQUIRE(filter.update(belief, sensor, Vector<1>(k + 1.0)).accepted());
      REQUIRE(filter.step(extended, process, 1.0, sensor, Vector<1>(k + 1.0)).accepted());
    }
    for (const auto& b : {belief, extended}) {
      CHECK((b.mean - Vector<2>(6.71906243764755, 1.52810614201467)).norm() < 2e-8);
      CHECK(std::abs(b.covariance(0, 0) - 4.3902465859811) < 2e-8);
      CHECK(std::abs(b.covariance(1, 1) - 5.40957304471697) < 2e-8);
    }
  }

  // With w added at the end its points only add Q; the same spread is kappa + n + q = kappa' + n.
  TEST_CASE("augmented: with additive noise predicts as the additive filter of the same spread") {
    const Gaussian<SE2> prior{SE2(1, 2, 3), Vector<3>(0.3, 0.2, 0.4).asDiagonal()};
    const cairn::Unicycle process{.speed_density = 0.1, .slip_density = 0.01, .turn_density = 0.1};
    for (const double alpha : {1.0, 1e-3}) {
      auto augmented = prior, additive = prior;
      const double beta = alpha * alpha;  // the term of m m^T speaks of the centre: equal only to O(m)
      const AugmentedUnscented a{.points = {.alpha = alpha, .beta = beta, .kappa = 0.5}};
      const cairn::Unscented b{.points = {.alpha = alpha, .beta = beta, .kappa = 3.5}};
      REQUIRE(a.predict(augmented, process, 0.7, Vector<2>(2, 1)) == Status::accepted);
      REQUIRE(b.predict(additive, process, 0.7, Vector<2>(2, 1)) == Status::accepted);
      CHECK(cairn::local(augmented.mean, additive.mean).norm() < 1e-9);
      CHECK(relative_error(augmented.covariance, additive.covariance) < 1e-9);
    }
  }

  TEST_CASE("augmented: noise that multiplies, against sampling") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const Gaussian<SE2> prior{SE2(0, 0, 0.5), Vector<3>(0.01, 0.02, 0.04).asDiagonal()};
    const Vector<2> u(3.0, 0.5);
    Gaussian<SE2> belief = prior;
    REQUIRE(AugmentedUnscented{}.predict(belief, Slipping{}, 1.0, u) == Status::accepted);
    constexpr int count = 40000;
    Vector<3> mean = Vector<3>::Zero();
    Matrix<3> square = Matrix<3>::Zero();
    for (int i = 0; i < count; ++i) {
      const SE2 x = cairn::sample(prior, random);
      const double w0 = random.normal(0.0, 0.1);
      const double w1 = random.normal(0.0, 0.2);
      const Vector<3> d = cairn::local(belief.mean, Slipping{}.propagate(x, u, Vector<2>(w0, w1), 1.0));
      mean += d / count;
      square += d * d.transpose() / count;
    }
    CHECK(mean.norm() < 0.02);
    CHECK(relative_error(belief.covariance, Matrix<3>(square - mean * mean.transpose())) < 0.05);
  }

  // 500 runs of 10 steps: the average NEES lies inside its 99.9 % band whichever way the points are drawn.
  TEST_CASE("augmented: is consistent where noise multiplies") {
    for (const bool by_step : {false, true}) {
      cairn::Random random(cairn_test::seed());
      cairn::RunningMoments nees;
      const AugmentedUnscented filter{};
      const Vector<2> u(0.5, 0.3);
      for (int run = 0; run < 500; ++run) {
        Gaussian<SE2> belief{SE2(0, 0, 0), Vector<3>(0.01, 0.01, 0.01).asDiagonal()};
        SE2 truth = cairn::sample(belief, random);
        for (int step = 0; step < 10; ++step) {
          const double w0 = random.normal(0.0, 0.1);
          const double w1 = random.normal(0.0, 0.2);
          truth = Slipping{}.propagate(truth, u, Vector<2>(w0, w1), 1.0);
          const Vector<1> z = Echo{}.predict(truth, Vector<1>(random.normal(0.0, 0.02)));
          if (by_step) {
            REQUIRE(filter.step(belief, Slipping{}, 1.0, Echo{}, z, u).accepted());
          } else {
            REQUIRE(filter.predict(belief, Slipping{}, 1.0, u) == Status::accepted);
            REQUIRE(filter.update(belief, Echo{}, z).accepted());
          }
        }
        nees.add(cairn::nees(belief, truth));
      }
      CAPTURE(by_step);
      CHECK(nees.mean() > 2.6);
      CHECK(nees.mean() < 3.5);
    }
  }

  TEST_CASE("augmented: refuses bad options and numbers, keeps the belief, and never allocates") {
    cairn::Random random(4);
    LinearProblem<2, 1> p(random);
    auto belief = p.prior;
    const double nan = std::nan("");
    const Vector<1> z(0.0);
    const AugmentedUnscented filter{};
    CHECK(filter.predict(belief, p.process, -1) == Status::bad_time_step);
    CHECK(filter.step(belief, p.process, nan, p.sensor, z).status == Status::bad_time_step);
    CHECK(AugmentedUnscented{.points = {.kappa = -4}}.predict(belief, p.process, 1) == Status::bad_option);
    CHECK(AugmentedUnscented{.fading = 0.9}.predict(belief, p.process, 1) == Status::bad_option);
    CHECK(AugmentedUnscented{.gate = 0}.update(belief, p.sensor, z).status == Status::bad_option);
    CHECK(AugmentedUnscented{.gate = 1e-9}.update(belief, p.sensor, Vector<1>(90.0)).status == Status::gated);
    CHECK(AugmentedUnscented{.gate = 1e-9}.step(belief, p.process, 1, p.sensor, Vector<1>(90.0)).status ==
          Status::gated);
    CHECK(AugmentedUnscented{.stabilising_noise = 1}.step(belief, p.process, 1, p.sensor, z).status ==
          Status::bad_option);
    CHECK(filter.update(belief, p.sensor, Vector<1>(nan)).status == Status::not_finite);
    auto broken = p;
    broken.process.covariance(0, 0) = nan;
    broken.sensor.covariance(0, 0) = INFINITY;
    CHECK(filter.predict(belief, broken.process, 1) == Status::not_finite);
    CHECK(filter.update(belief, broken.sensor, z).status == Status::not_finite);
    CHECK(filter.step(belief, p.process, 1, broken.sensor, z).status == Status::not_finite);
    broken.sensor.covariance = -Matrix<1>::Identity();
    CHECK(filter.update(belief, broken.sensor, z).status == Status::not_positive_definite);
    CHECK(filter.step(belief, p.process, 1, broken.sensor, z).status == Status::not_positive_definite);
    CHECK(belief.mean == p.prior.mean);
    CHECK(belief.covariance == p.prior.covariance);
    {
      const cairn_test::NoAllocation guard;
      CHECK(filter.predict(belief, p.process, 1) == Status::accepted);
      CHECK(filter.update(belief, p.sensor, z).accepted());
      CHECK(filter.step(belief, p.process, 1, p.sensor, z).accepted());
    }
    belief.covariance(0, 0) = -1;
    CHECK(filter.predict(belief, p.process, 1) == Status::not_positive_definite);
    CHECK(filter.step(belief, p.process, 1, p.sensor, z).status == Status::not_positive_definite);
  }
}

}  // namespace
}  // namespace augmented_unscented_test
