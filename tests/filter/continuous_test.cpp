// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/filter/information.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/kalman_bucy.hpp>
#include <cairn/models/linear.hpp>
#include <cairn/models/motion.hpp>
#include <cairn/models/sensor.hpp>

#include "filter/linear_problems.hpp"

namespace continuous_test {
namespace {

using cairn::Gaussian;
using cairn::InformationBelief;
using cairn::InformationFilter;
using cairn::KalmanBucy;
using cairn::Matrix;
using cairn::NoControl;
using cairn::Status;
using cairn::Vector;

// x' = noise of density q: the Brownian motion.
struct Brownian {
  using State = Vector<1>;
  using Control = NoControl;
  double q = 1.0;
  [[nodiscard]] Vector<1> rate(const State&, const Control&) const { return Vector<1>(0.0); }
  [[nodiscard]] Matrix<1> rate_jacobian(const State&, const Control&) const { return Matrix<1>(0.0); }
  [[nodiscard]] Matrix<1> spectral_density(const State&, const Control&) const { return Matrix<1>(q); }
};

// Position and velocity, driven by white acceleration.
struct Gliding {
  using State = Vector<2>;
  using Control = NoControl;
  double q = 1.0;
  [[nodiscard]] Vector<2> rate(const State& x, const Control&) const { return {x(1), 0.0}; }
  [[nodiscard]] Matrix<2> rate_jacobian(const State&, const Control&) const {
    return (Matrix<2>() << 0, 1, 0, 0).finished();
  }
  [[nodiscard]] Matrix<2> spectral_density(const State&, const Control&) const {
    return Vector<2>(0, q).asDiagonal();
  }
};

TEST_SUITE("kalman_bucy") {
  // P' = q - P^2 / r has the solution sqrt(q r) tanh(sqrt(q / r) t) from P(0) = 0.
  TEST_CASE("kalman-bucy: the Riccati equation of Brownian motion, by its closed form") {
    const double q = 2.0, r = 0.5;
    const cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(r)};
    Gaussian<Vector<1>> belief{Vector<1>(0.0), Matrix<1>(0.0)};
    REQUIRE(KalmanBucy{.steps = 1000}.filter(belief, Brownian{q}, sensor, Vector<1>(0.3), 0.7) ==
            Status::accepted);
    const double expected = std::sqrt(q * r) * std::tanh(std::sqrt(q / r) * 0.7);
    CHECK(std::abs(belief.covariance(0) - expected) < 1e-11);
    // and x' = P (z - x) / r integrates to z (1 - 1 / cosh(sqrt(q / r) t))
    CHECK(std::abs(belief.mean(0) - 0.3 * (1.0 - 1.0 / std::cosh(std::sqrt(q / r) * 0.7))) < 1e-11);
  }

  TEST_CASE("kalman-bucy: without measurements it is the discrete constant-velocity model") {
    const Gaussian<Vector<2>> prior{Vector<2>(1, 2), (Matrix<2>() << 2, 0.3, 0.3, 1).finished()};
    auto continuous = prior, discrete = prior;
    REQUIRE(KalmanBucy{}.predict(continuous, Gliding{0.7}, 0.9) == Status::accepted);
    REQUIRE(cairn::Kalman{}.predict(discrete, cairn::ConstantVelocity<1>{.density = 0.7}, 0.9) ==
            Status::accepted);
    CHECK((continuous.mean - discrete.mean).norm() < 1e-14);
    CHECK((continuous.covariance - discrete.covariance).norm() <
          1e-14);  // cubic in time: Runge-Kutta is exact
  }

  TEST_CASE("kalman-bucy: covariance and information forms agree, and the discrete filter tends to them") {
    const Gaussian<Vector<2>> prior{Vector<2>(1, 2), (Matrix<2>() << 2, 0.3, 0.3, 1).finished()};
    const Matrix<1, 2> h(1, 0);
    const double r = 0.3, seconds = 0.5;
    const cairn::LinearSensor<1, 2> density{h, Matrix<1>(r)};
    const Vector<1> z(1.7);
    auto by_covariance = prior;
    auto by_information = InformationBelief<Vector<2>>::from(prior).value();
    const KalmanBucy filter{.steps = 500};
    REQUIRE(filter.filter(by_covariance, Gliding{}, density, z, seconds) == Status::accepted);
    REQUIRE(filter.filter(by_information, Gliding{}, density, z, seconds) == Status::accepted);
    const auto back = by_information.gaussian().value();
    CHECK((back.mean - by_covariance.mean).norm() < 1e-10);
    CHECK((back.covariance - by_covariance.covariance).norm() < 1e-10);
    double last = 0.0;
    for (const int steps : {1000, 2000}) {
      const double dt = seconds / steps;
      const cairn::LinearSensor<1, 2> instant{h, Matrix<1>(r / dt)};
      auto discrete = prior;
      for (int k = 0; k < steps; ++k) {
        REQUIRE(cairn::Kalman{}.predict(discrete, cairn::ConstantVelocity<1>{}, dt) == Status::accepted);
        REQUIRE(cairn::Kalman{}.update(discrete, instant, z).accepted());
      }
      const double error = (discrete.covariance - by_covariance.covariance).norm();
      CHECK(error < 1e-2);
      if (last > 0.0) CHECK(error < 0.6 * last);  // first order in dt
      last = error;
    }
  }

  TEST_CASE("kalman-bucy: refuses bad steps and numbers and leaves the belief") {
    Gaussian<Vector<1>> belief{Vector<1>(0.0), Matrix<1>(1.0)};
    const cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(-1.0)};
    CHECK(KalmanBucy{}.predict(belief, Brownian{}, -0.1) == Status::bad_time_step);
    CHECK(KalmanBucy{.steps = 0}.predict(belief, Brownian{}, 0.1) == Status::bad_option);
    CHECK(KalmanBucy{}.predict(belief, Brownian{std::nan("")}, 0.1) == Status::not_finite);
    CHECK(KalmanBucy{}.predict(belief, Brownian{-100.0}, 0.1) == Status::not_positive_definite);
    CHECK(KalmanBucy{}.filter(belief, Brownian{}, sensor, Vector<1>(0), 0.1) ==
          Status::not_positive_definite);
    CHECK(belief.mean(0) == 0.0);
    CHECK(belief.covariance(0) == 1.0);
  }
}

TEST_SUITE("information") {
  TEST_CASE("information: starts from nothing and ends where least squares does") {
    const auto start = InformationBelief<Vector<2>>::ignorant(Vector<2>(0, 0));
    auto belief = start;
    CHECK_FALSE(belief.gaussian().has_value());
    const cairn_test::LineFit line;
    for (int i = 0; i < line.points; ++i)
      REQUIRE(InformationFilter{}.update(belief, line.sensor(i), line.height(i)) == Status::accepted);
    const auto found = belief.gaussian().value();
    CHECK((found.mean - line.solution).norm() < 1e-14);
    const Matrix<2> normal = 4.0 * line.design.transpose() * line.design;
    CHECK((found.covariance * normal - Matrix<2>::Identity()).norm() < 1e-13);
    // predicting with half the state unseen keeps the other half's ignorance
    auto half = start;
    const cairn::LinearSensor<1, 2> first{Matrix<1, 2>(1, 0), Matrix<1>(0.25)};
    REQUIRE(InformationFilter{}.update(half, first, Vector<1>(1.0)) == Status::accepted);
    REQUIRE(InformationFilter{}.predict(half,
                                        cairn::LinearModel<2>{Matrix<2>::Identity(), Matrix<2>::Identity()},
                                        1.0) == Status::accepted);
    CHECK(std::abs(half.information(0, 0) - 1.0 / 1.25) < 1e-14);
    CHECK(half.information(1, 1) == 0.0);
  }

  TEST_CASE("information: refuses bad numbers and leaves the belief") {
    auto belief = InformationBelief<Vector<2>>::ignorant(Vector<2>(0, 0));
    const cairn::LinearSensor<1, 2> sensor{Matrix<1, 2>(1, 0), Matrix<1>(0.25)};
    const cairn::LinearSensor<1, 2> negative{Matrix<1, 2>(1, 0), Matrix<1>(-0.25)};
    CHECK(InformationFilter{}.update(belief, sensor, Vector<1>(std::nan(""))) == Status::not_finite);
    CHECK(InformationFilter{}.update(belief, negative, Vector<1>(1)) == Status::not_positive_definite);
    const cairn::LinearModel<2> flat{Matrix<2>::Zero(), Matrix<2>::Identity()};
    CHECK(InformationFilter{}.predict(belief, flat, 1.0) == Status::not_positive_definite);
    CHECK(InformationFilter{}.predict(belief, flat, -1.0) == Status::bad_time_step);
    CHECK(belief.information.norm() == 0.0);
    CHECK(belief.vector.norm() == 0.0);
  }
}

}  // namespace
}  // namespace continuous_test
