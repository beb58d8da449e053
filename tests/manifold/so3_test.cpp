// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <type_traits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/manifold/derivatives.hpp>
#include <cairn/manifold/so3.hpp>

#include "support/random.hpp"

namespace so3_test {
namespace {

using cairn::BasicSO3;
using cairn::Matrix;
using cairn::SO3;
using cairn::Vector;

template <class S>
Vector<3, S> direction(cairn::Random& random) {
  Vector<3> v(random.normal(), random.normal(), random.normal());
  return (v / v.norm()).cast<S>();
}

/// exp of skew(omega) by its power series in long double: the oracle.
Matrix<3> matrix_exponential(const Vector<3>& omega) {
  using Wide = Matrix<3, 3, long double>;
  const Wide W = cairn::skew(omega.cast<long double>().eval());
  Wide term = Wide::Identity(), sum = term;
  for (int k = 1; k < 60; ++k) {
    term = (term * W / static_cast<long double>(k)).eval();
    sum += term;
  }
  return sum.cast<double>();
}

}  // namespace

TEST_SUITE("so3") {
  TEST_CASE_TEMPLATE("SO3: exp equals the power series and log undoes it, from 1e-12 to pi", S, double,
                     float) {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const S tolerance = std::is_same_v<S, double> ? S(2e-15) : S(1e-6);
    for (const double angle :
         {0.0, 1e-12, 1e-6, 1e-3, 0.01, 0.019, 0.021, 0.5, 1.0, 2.0, 3.0, 3.1415, 3.14159}) {
      CAPTURE(angle);
      const Vector<3, S> omega = direction<S>(random) * static_cast<S>(angle);
      const auto R = BasicSO3<S>::exp(omega);
      CHECK((R.matrix() - matrix_exponential(omega.template cast<double>()).template cast<S>()).norm() <
            4 * tolerance);
      CHECK((R.log() - omega).norm() <= 4 * tolerance);
      CHECK(R.angle() == doctest::Approx(angle).epsilon(1e-5));
    }
  }

  TEST_CASE("SO3: log at and around half a turn has length pi and gives the same rotation") {
    for (const double angle : {M_PI, std::nextafter(M_PI, 4.0), M_PI + 1e-9, M_PI + 0.5}) {
      const SO3 R = SO3::exp(Vector<3>(0.6, 0, 0.8) * angle);
      CHECK(R.log().norm() <= M_PI + 1e-15);
      CHECK((SO3::exp(R.log()).matrix() - R.matrix()).norm() <
            2e-15);  // where products and sums are fused too
    }
    const SO3 exact = SO3::from_quaternion(0, 0, 1, 0);
    CHECK(exact.log().norm() == doctest::Approx(M_PI).epsilon(1e-16));
  }

  TEST_CASE("SO3: products, inverses and rotations are those of the matrices") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 100; ++run) {
      const SO3 a = SO3::exp(direction<double>(random) * random.uniform(0, 3)),
                b = SO3::exp(direction<double>(random) * random.uniform(0, 3));
      const Vector<3> p(random.normal(), random.normal(), random.normal());
      CHECK(((a * b).matrix() - a.matrix() * b.matrix()).norm() < 2e-15);
      CHECK((a.inverse().matrix() - a.matrix().transpose()).norm() == 0.0);
      CHECK((a * p - a.matrix() * p).norm() < 5e-15);
      CHECK(((a * SO3::exp(p)).matrix() - (SO3::exp(a.adjoint() * p) * a).matrix()).norm() < 5e-15);
    }
  }

  TEST_CASE("SO3: a million products stay a rotation") {
    SO3 R;
    const SO3 step = SO3::exp(Vector<3>(0.01, -0.02, 0.03));
    for (int i = 0; i < 1000000; ++i) R = R * step;
    CHECK((R.matrix().transpose() * R.matrix() - Matrix<3>::Identity()).norm() < 1e-15);
  }

  TEST_CASE("SO3: Jacobians agree with numeric differentiation and their inverses with inversion") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const double angle : {0.0, 1e-7, 1e-3, 0.5, 0.999, 1.001, 2.0, 3.0}) {
      const Vector<3> omega = direction<double>(random) * angle;
      const auto numeric = cairn::numeric_jacobian([](const Vector<3>& w) { return SO3::exp(w); }, omega);
      CHECK((SO3::right_jacobian(omega) - numeric).norm() < 1e-9);
      CHECK((SO3::left_jacobian(omega) - SO3::right_jacobian(omega).transpose()).norm() < 1e-15);
      CHECK((SO3::left_jacobian(omega) * SO3::left_jacobian_inverse(omega) - Matrix<3>::Identity()).norm() <
            1e-14);
      CHECK((SO3::right_jacobian(omega) * SO3::right_jacobian_inverse(omega) - Matrix<3>::Identity()).norm() <
            1e-14);
    }
  }

  TEST_CASE(
      "SO3::from_matrix: takes the nearest rotation of a rounded matrix, whatever the largest component") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 200; ++run) {
      const SO3 R = SO3::exp(direction<double>(random) * random.uniform(0, M_PI));
      CHECK((SO3::from_matrix(R.matrix()).matrix() - R.matrix()).norm() < 2e-15);
      Matrix<3> rounded = R.matrix();
      for (int i = 0; i < 9; ++i) rounded(i / 3, i % 3) = std::round(1e6 * rounded(i / 3, i % 3)) / 1e6;
      const Matrix<3> near = SO3::from_matrix(rounded).matrix();
      // nine entries, each of products whose factors are off by a rounding or two
      CHECK((near.transpose() * near - Matrix<3>::Identity()).norm() <
            16 * std::numeric_limits<double>::epsilon());
      // The nearest: R^T M is symmetric at the polar factor.
      const Matrix<3> symmetric = near.transpose() * rounded;
      CHECK((symmetric - symmetric.transpose()).norm() < 1e-14);
    }
  }

  TEST_CASE("SO3::from_matrix: keeps its digits where one component is all but everything") {
    // Half turns about an axis, and some nearly: the other three components must not be divided by.
    for (int axis = 0; axis < 4; ++axis)
      for (int other = 0; other < 4; ++other)
        for (const double small : {0.0, 1e-9, 1e-7, 1e-5, 1e-3}) {
          double q[4] = {0, 0, 0, 0};
          q[other] = small;
          q[axis] = 1;
          const SO3 R = SO3::from_quaternion(q[0], q[1], q[2], q[3]);
          CAPTURE(axis);
          CAPTURE(other);
          CAPTURE(small);
          CHECK((SO3::from_matrix(R.matrix()).inverse() * R).angle() < 2e-15);
        }
  }

  TEST_CASE("SO3: refuses what is no rotation") {
    Matrix<3> reflection = Matrix<3>::Identity();
    reflection(2, 2) = -1;
    Matrix<3> sheared = Matrix<3>::Identity();
    sheared(0, 1) = 0.1;
    Matrix<3> unknown = Matrix<3>::Identity();
    unknown(1, 1) = std::numeric_limits<double>::quiet_NaN();
    for (const Matrix<3>& m : {reflection, sheared, unknown, Matrix<3>(Matrix<3>::Zero())})
      CHECK_THROWS_AS((void)SO3::from_matrix(m), cairn::Error);
    CHECK_THROWS_AS((void)SO3::from_quaternion(0, 0, 0, 0), cairn::Error);
    CHECK_THROWS_AS((void)SO3::from_quaternion(1, INFINITY, 0, 0), cairn::Error);
    CHECK(SO3::from_quaternion(-2, 0, 0, 0).angle() == 0.0);
  }
}

}  // namespace so3_test
