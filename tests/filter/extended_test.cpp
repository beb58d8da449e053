// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/manifold/so3.hpp>

#include "support/random.hpp"

namespace extended_test {
namespace {

using cairn::Gaussian;
using cairn::Matrix;
using cairn::NoControl;
using cairn::SO3;
using cairn::Status;
using cairn::Vector;

/// x' = x + dt (1 + x^2), whose slope changes by much within a step.
struct Growth {
  using State = Vector<1>;
  using Control = NoControl;
  [[nodiscard]] State propagate(const State& x, const Control&, double dt) const {
    return State(x(0) + dt * (1 + x(0) * x(0)));
  }
  [[nodiscard]] Matrix<1> jacobian(const State& x, const Control&, double dt) const {
    return Matrix<1>(1 + 2 * dt * x(0));
  }
  [[nodiscard]] Matrix<1> noise(const State&, const Control&, double) const { return Matrix<1>(0.25); }
};

/// The arc tangent: full steps of Gauss and Newton from beyond 1.39 lead farther and farther away.
struct Bend {
  using State = Vector<1>;
  using Measurement = Vector<1>;
  double variance;
  [[nodiscard]] Measurement predict(const State& x) const { return Measurement(std::atan(x(0))); }
  [[nodiscard]] Matrix<1> jacobian(const State& x) const { return Matrix<1>(1 / (1 + x(0) * x(0))); }
  [[nodiscard]] Matrix<1> noise(const State&) const { return Matrix<1>(variance); }
};

/// Twice the negative logarithm of the posterior density.
double cost(const Bend& sensor, double mean, double prior, double z, double x) {
  const double d = x - mean, r = z - std::atan(x);
  return d * d / prior + r * r / sensor.variance;
}

/// Its minimum by trying everything, finer and finer.
double best(const Bend& sensor, double mean, double prior, double z) {
  double centre = mean, reach = 40;
  for (int round = 0; round < 12; ++round) {
    double found = centre;
    for (int i = -2000; i <= 2000; ++i) {
      const double x = centre + reach * i / 2000;
      if (cost(sensor, mean, prior, z, x) < cost(sensor, mean, prior, z, found)) found = x;
    }
    centre = found;
    reach /= 100;
    if (reach < 1e-9) break;
  }
  return centre;
}

/// Two known directions, seen from a body that is turned by R.
struct Directions {
  using State = SO3;
  using Measurement = Vector<6>;
  Vector<3> first{1, 0, 0}, second{0, 0.6, 0.8};
  double variance = 0.09;
  [[nodiscard]] Measurement predict(const SO3& R) const {
    Measurement z;
    z << R.inverse().rotate(first), R.inverse().rotate(second);
    return z;
  }
  /// R exp(d) sees v = R^-1 p as v - d x v.
  [[nodiscard]] Matrix<6, 3> jacobian(const SO3& R) const {
    Matrix<6, 3> h;
    const Measurement z = predict(R);
    for (int k = 0; k < 2; ++k) {
      const double x = z(3 * k), y = z(3 * k + 1), w = z(3 * k + 2);
      h.row(3 * k) << 0, -w, y;
      h.row(3 * k + 1) << w, 0, -x;
      h.row(3 * k + 2) << -y, x, 0;
    }
    return h;
  }
  [[nodiscard]] Matrix<6> noise(const SO3&) const { return variance * Matrix<6>::Identity(); }
};

}  // namespace

TEST_SUITE("extended") {
  TEST_CASE("extended: a prediction spreads by the slope at the state before it") {
    Gaussian<Vector<1>> belief{Vector<1>(2.0), Matrix<1>(0.5)};
    REQUIRE(cairn::Extended{}.predict(belief, Growth{}, 0.5) == Status::accepted);
    CHECK(belief.mean(0) == doctest::Approx(2.0 + 0.5 * 5).epsilon(1e-14));
    CHECK(belief.covariance(0, 0) == doctest::Approx(9 * 0.5 + 0.25).epsilon(1e-14));
  }

  TEST_CASE("extended: iterations end at the maximum of the posterior, also where full steps run away") {
    const cairn::Extended filter{.iterations = 60};
    for (const double mean : {0.4, 1.2, 3.0, -6.0})
      for (const double variance : {1e-1, 1e-3, 1e-5})
        for (const double z : {0.0, 0.5, -0.2}) {
          CAPTURE(mean);
          CAPTURE(variance);
          CAPTURE(z);
          const Bend sensor{variance};
          Gaussian<Vector<1>> belief{Vector<1>(mean), Matrix<1>(25.0)};
          REQUIRE(filter.update(belief, sensor, Vector<1>(z)).accepted());
          const double x = best(sensor, mean, 25.0, z);
          const double slope = 1 / (1 + x * x), expected = 1 / (1 / 25.0 + slope * slope / variance);
          // A cost tells its minimum's place to the root of its rounding.
          CHECK(std::abs(belief.mean(0) - x) < 1e-4 * std::sqrt(expected));
          CHECK(belief.covariance(0, 0) == doctest::Approx(expected).epsilon(1e-4).scale(0));
        }
  }

  TEST_CASE("extended: on rotations iterations end where the posterior is level, with its curvature there") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const Directions sensor;
    for (int round = 0; round < 20; ++round) {
      CAPTURE(round);
      const auto draw = [&](double scale) {
        const double x = random.normal(), y = random.normal();
        return Vector<3>(scale * x, scale * y, scale * random.normal());
      };
      Gaussian<SO3> belief{SO3::exp(draw(1)), Matrix<3>::Zero()};
      belief.covariance << 0.5, 0.1, -0.05, 0.1, 0.3, 0.02, -0.05, 0.02, 0.2;
      const Gaussian<SO3> prior = belief;
      auto z = sensor.predict(prior.mean * SO3::exp(draw(0.5)));
      for (int i = 0; i < 6; ++i) z(i) += random.normal(0.0, 0.1);
      REQUIRE(cairn::Extended{.iterations = 100}.update(belief, sensor, z).accepted());

      const Vector<3> e = (prior.mean.inverse() * belief.mean).log();
      const Matrix<3> information = prior.covariance.inverse();
      const auto expected = [&](const Vector<3>& d) { return sensor.predict(prior.mean * SO3::exp(d)); };
      const auto half_cost = [&](const Vector<3>& d) {
        return 0.5 * (d.dot(information * d) + (z - expected(d)).squaredNorm() / sensor.variance);
      };
      constexpr double h = 1e-5;
      Vector<3> gradient;
      Matrix<6, 3> slope;
      Matrix<3> moved;  // how steps from the new mean follow those from the old one
      for (int i = 0; i < 3; ++i) {
        const Vector<3> step = h * Vector<3>::Unit(i), up = e + step, down = e - step;
        gradient(i) = (half_cost(up) - half_cost(down)) / (2 * h);
        slope.col(i) = (expected(up) - expected(down)) / (2 * h);
        const SO3 back = belief.mean.inverse();
        moved.col(i) =
            ((back * (prior.mean * SO3::exp(up))).log() - (back * (prior.mean * SO3::exp(down))).log()) /
            (2 * h);
      }
      CHECK(gradient.norm() < 1e-6);
      const Matrix<3> curvature = information + slope.transpose() * slope / sensor.variance;
      const Matrix<3> left = moved * curvature.inverse() * moved.transpose();
      CHECK((belief.covariance - left).norm() < 1e-7 * left.norm());
    }
  }
}

}  // namespace extended_test
