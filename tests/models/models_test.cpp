// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/differentiate.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/unscented.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "support/random.hpp"

namespace models_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::NoControl;
using cairn::SE2;
using cairn::Status;
using cairn::Vector;

TEST_SUITE("models") {
  TEST_CASE("models: Jacobians agree with central differences") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto draw = [&] { return random.uniform(-2, 2); };
    for (int run = 0; run < 20; ++run) {
      const SE2 pose(draw(), draw(), draw());
      CHECK(cairn::check_jacobian(cairn::Unicycle{}, pose, Vector<2>(draw(), draw()), 0.7).worst < 1e-8);
      const Vector<2> beacon(draw() + 5, draw());
      CHECK(cairn::check_jacobian(cairn::RangeBearing{.beacon = beacon}, pose).worst < 1e-8);
      CHECK(cairn::check_jacobian(cairn::Compass{}, pose).worst < 1e-8);
      CHECK(cairn::check_jacobian(cairn::PlanarPosition{}, pose).worst < 1e-8);
      Vector<6> x;
      for (int i = 0; i < 6; ++i) x(i) = draw();
      CHECK(cairn::check_jacobian(cairn::ConstantVelocity<3>{}, x, NoControl{}, 0.3).worst < 1e-8);
      CHECK(cairn::check_jacobian(cairn::ConstantAcceleration<2>{}, x, NoControl{}, 0.3).worst < 1e-8);
      CHECK(cairn::check_jacobian(cairn::PositionSensor<3, 6>{}, x).worst < 1e-8);
    }
    // and the checker does see a wrong one
    struct Wrong : cairn::Compass {
      [[nodiscard]] Matrix<1, 3> jacobian(const SE2&) const { return Matrix<1, 3>(0, 0, -1); }
    };
    CHECK_FALSE(cairn::check_jacobian(Wrong{}, SE2(1, 2, 3)).agrees());
  }

  // Two steps of dt/2 must be one step of dt.
  template <class F>
  void check_halves(const F& process) {
    constexpr int n = cairn::dof<typename F::State>;
    const typename F::State x = F::State::Ones();
    const Matrix<n> half = process.jacobian(x, NoControl{}, 0.25);
    const Matrix<n> whole = process.jacobian(x, NoControl{}, 0.5);
    CHECK((half * half - whole).norm() < 1e-15);
    const Matrix<n> q = process.noise(x, NoControl{}, 0.25);
    const Matrix<n> whole_q = process.noise(x, NoControl{}, 0.5);
    CHECK((half * q * half.transpose() + q - whole_q).norm() < 1e-15);
    CHECK((process.propagate(x, NoControl{}, 0.5) - whole * x).norm() < 1e-15);
  }
  TEST_CASE("constant velocity and acceleration: two half steps are a whole one, noise included") {
    check_halves(cairn::ConstantVelocity<2>{.density = 0.7});
    check_halves(cairn::ConstantAcceleration<2>{.density = 0.7});
  }

  // Average NEES and NIS over 500 runs of 20 steps on the last step: inside the two-sided 99.9 % band.
  template <class Filter>
  void check_consistency(const Filter& filter) {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::Unicycle process{.speed_density = 0.01, .slip_density = 0.001, .turn_density = 0.002};
    cairn::RunningMoments nees, nis;
    for (int run = 0; run < 500; ++run) {
      Gaussian<SE2> belief{SE2(0, 0, 3.0), Vector<3>(0.04, 0.04, 0.01).asDiagonal()};
      SE2 truth = cairn::sample(belief, random);
      for (int step = 0; step < 20; ++step) {
        const Vector<2> control(1.0, 0.3);
        REQUIRE(filter.predict(belief, process, 0.5, control) == Status::accepted);
        truth = cairn::sample(
            Gaussian<SE2>{process.propagate(truth, control, 0.5), process.noise(truth, control, 0.5)},
            random);
        const cairn::RangeBearing sensor{.beacon = Vector<2>(step % 2 == 0 ? 10 : -10, 8)};
        const auto z = cairn::sample(
            Gaussian<cairn::RangeBearing::Measurement>{sensor.predict(truth), sensor.noise(truth)}, random);
        const auto innovation = filter.update(belief, sensor, z);
        REQUIRE(innovation.accepted());
        if (step == 19) nis.add(innovation.nis);
      }
      nees.add(cairn::nees(belief, truth));
    }
    CHECK(cairn::chi_square_mean_band(3, 500, 0.999).contains(nees.mean()));
    CHECK(cairn::chi_square_mean_band(2, 500, 0.999).contains(nis.mean()));
  }
  TEST_CASE("unicycle with beacons: extended, iterated and unscented filters are consistent") {
    check_consistency(cairn::Extended{});
    check_consistency(cairn::Extended{.iterations = 5});
    check_consistency(cairn::Unscented{});
  }

  // The same unicycle as a template, for dual numbers.
  struct TemplatedUnicycle : cairn::Unicycle {
    template <class T>
    [[nodiscard]] cairn::BasicSE2<T> propagate(const cairn::BasicSE2<T>& pose, const Vector<2>& u,
                                               double dt) const {
      return pose * cairn::BasicSE2<T>::exp(Vector<3, T>(T(u(0) * dt), T(0), T(u(1) * dt)));
    }
  };
  TEST_CASE("automatic and numeric: give the filter the Jacobian by hand gives") {
    const Gaussian<SE2> prior{SE2(1, 2, 3), Vector<3>(0.04, 0.09, 0.01).asDiagonal()};
    auto by_hand = prior, by_duals = prior, by_differences = prior;
    const Vector<2> u(1.0, 0.5);
    REQUIRE(cairn::Extended{}.predict(by_hand, cairn::Unicycle{}, 0.5, u) == Status::accepted);
    REQUIRE(cairn::Extended{}.predict(by_duals, cairn::automatic(TemplatedUnicycle{}), 0.5, u) ==
            Status::accepted);
    REQUIRE(cairn::Extended{}.predict(by_differences, cairn::numeric(cairn::Unicycle{}), 0.5, u) ==
            Status::accepted);
    CHECK((by_duals.covariance - by_hand.covariance).norm() < 1e-15);
    CHECK((by_differences.covariance - by_hand.covariance).norm() < 1e-9);
  }

  // On a sensor bent so much that one linearisation fails, iterating finds the peak of the posterior.
  TEST_CASE("extended: iterations end at the maximum of the posterior") {
    const cairn::RangeBearing sensor{.beacon = Vector<2>(0.5, 0), .range_sigma = 0.01, .bearing_sigma = 0.01};
    const Gaussian<SE2> prior{SE2(0, 0, 0), Vector<3>(1, 1, 0.01).asDiagonal()};
    const auto z = cairn::RangeBearing::measurement(1.5, 0.6);
    auto belief = prior;
    REQUIRE(cairn::Extended{.iterations = 30}.update(belief, sensor, z).accepted());
    const auto cost = [&](const SE2& x) {
      const Vector<3> e = cairn::local(prior.mean, x);
      const auto r = cairn::local(sensor.predict(x), z);
      return e.dot(prior.covariance.inverse() * e) + r.dot(cairn::Matrix<2>(sensor.noise(x)).inverse() * r);
    };
    const double best = cost(belief.mean);
    for (int axis = 0; axis < 3; ++axis)
      for (const double step : {1e-3, -1e-3}) {
        Vector<3> d = Vector<3>::Zero();
        d(axis) = step;
        CHECK(cost(cairn::retract(belief.mean, d)) > best);
      }
    auto once = prior;
    REQUIRE(cairn::Extended{}.update(once, sensor, z).accepted());
    CHECK(cost(once.mean) > best + 1.0);
  }
}

}  // namespace
}  // namespace models_test
