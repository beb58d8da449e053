// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/models/linear.hpp>

#include "support/elimination.hpp"
#include "support/random.hpp"

namespace kalman_test {
namespace {

using cairn::Gaussian;
using cairn::Identity;
using cairn::Kalman;
using cairn::Matrix;
using cairn::NoControl;
using cairn::Status;
using cairn::Vector;
using cairn_test::inverse_of;
using cairn_test::solved;

// A landmark that is seen directly: F = H = I.
struct Sighting {
  using State = Vector<3>;
  using Measurement = Vector<3>;
  static constexpr bool linear = true;
  Matrix<3> covariance;
  [[nodiscard]] Measurement predict(const State& x) const { return x; }
  [[nodiscard]] Identity<3> jacobian(const State&) const { return {}; }
  [[nodiscard]] const Matrix<3>& noise(const State&) const { return covariance; }
};

TEST_SUITE("kalman") {
  TEST_CASE("kalman: two sightings of a landmark are their information-weighted mean") {
    Matrix<3> p;
    p << 4, 1, 0, 1, 3, 0.5, 0, 0.5, 2;
    Matrix<3> r;
    r << 1, 0.2, 0, 0.2, 2, 0, 0, 0, 5;
    Gaussian<Vector<3>> belief{Vector<3>(1, 2, 3), p};
    const Vector<3> z(2, 0, 4);
    const auto innovation = Kalman{}.update(belief, Sighting{r}, z);
    REQUIRE(innovation.accepted());
    const Matrix<3> information = inverse_of(p) + inverse_of(r);
    const Matrix<3> expected = inverse_of(information);
    CHECK((belief.covariance - expected).norm() < 1e-14);
    const Vector<3> mean = expected * (solved(p, Vector<3>(1, 2, 3)) + solved(r, z));
    CHECK((belief.mean - mean).norm() < 1e-14);
    CHECK((innovation.covariance - (p + r)).norm() == 0.0);
    const Vector<3> d = z - Vector<3>(1, 2, 3);
    CHECK(innovation.nis == doctest::Approx(cairn_test::normalised_square(p + r, d)).epsilon(1e-14));
    const Matrix<3> s = p + r;
    const double determinant = s(0, 0) * (s(1, 1) * s(2, 2) - s(1, 2) * s(2, 1)) -
                               s(0, 1) * (s(1, 0) * s(2, 2) - s(1, 2) * s(2, 0)) +
                               s(0, 2) * (s(1, 0) * s(2, 1) - s(1, 1) * s(2, 0));
    CHECK(innovation.log_likelihood() ==
          doctest::Approx(-0.5 * (innovation.nis + std::log(determinant) + 3 * std::log(2 * M_PI))));
  }

  TEST_CASE(
      "kalman: the gate is for the squared distance, whether sizes are known when compiling or running") {
    constexpr int d = cairn::dynamic;
    const cairn::LinearSensor<1, 1> sensor{Matrix<1>(1.0), Matrix<1>(1.5)};
    const cairn::LinearSensor<d, d> loose{Matrix<d>::Constant(1, 1, 1.0), Matrix<d>::Constant(1, 1, 1.5)};
    for (const double gate : {0.25, 1.0, 9.0})
      for (const double share : {0.99, 1.01}) {
        CAPTURE(gate);
        CAPTURE(share);
        const double z = std::sqrt(share * gate * (0.5 + 1.5));
        const Status expected = share < 1 ? Status::accepted : Status::gated;
        Gaussian<Vector<1>> belief{Vector<1>(0.0), Matrix<1>(0.5)};
        CHECK(Kalman{.gate = gate}.update(belief, sensor, Vector<1>(z)).status == expected);
        CHECK((belief.mean(0) == 0.0) == (share > 1));
        Gaussian<Vector<d>> of_any_size{Vector<d>::Zero(1), Matrix<d>::Constant(1, 1, 0.5)};
        CHECK(Kalman{.gate = gate}.update(of_any_size, loose, Vector<d>::Constant(1, z)).status == expected);
        CHECK((of_any_size.mean(0) == 0.0) == (share > 1));
      }
  }

  TEST_CASE("kalman: a sensor that is better than the prior by all digits leaves its own variance") {
    constexpr int d = cairn::dynamic;
    for (const double r : {1e-13, 1e-16, 1e-20, 0.0})
      for (const auto form : {cairn::Form::standard, cairn::Form::joseph, cairn::Form::sequential}) {
        CAPTURE(r);
        // Seen is the second of two numbers, of variance 2; the first, of 3, goes with it by 1.
        const double left = 2 * r / (2 + r), first = 3 - 1 / (2 + r), both = r / (2 + r);
        const auto check = [&](const auto& covariance) {
          CHECK(std::abs(covariance(1, 1) - left) <= 1e-3 * left);
          CHECK(covariance(0, 0) == doctest::Approx(first).epsilon(1e-12));
          // A part of a deviation's rounding beside what it would be alone.
          CHECK(std::abs(covariance(1, 0) - both) <= 1e-3 * std::sqrt(first * left));
        };
        Matrix<2> p;
        p << 3, 1, 1, 2;
        const Kalman filter{.form = form};
        Gaussian<Vector<2>> belief{Vector<2>(0, 0), p};
        const cairn::LinearSensor<1, 2> sensor{Matrix<1, 2>(0, 1), Matrix<1>(r)};
        REQUIRE(filter.update(belief, sensor, Vector<1>(1.0)).accepted());
        check(belief.covariance);
        CHECK(belief.mean(1) == doctest::Approx(1.0).epsilon(1e-12));
        Gaussian<Vector<d>> of_any_size{Vector<d>::Zero(2), p};
        const cairn::LinearSensor<d, d> loose{Matrix<1, 2>(0, 1), Matrix<d>::Constant(1, 1, r)};
        REQUIRE(filter.update(of_any_size, loose, Vector<d>::Constant(1, 1.0)).accepted());
        check(of_any_size.covariance);
      }
  }
}

}  // namespace
}  // namespace kalman_test
