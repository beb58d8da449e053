// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/manifold/derivatives.hpp>
#include <cairn/manifold/dual.hpp>
#include <cairn/manifold/se3.hpp>

#include "support/random.hpp"

namespace se3_test {
namespace {

using cairn::Matrix;
using cairn::SE3;
using cairn::SO3;
using cairn::Vector;

Vector<6> random_step(cairn::Random& random, double size) {
  Vector<6> d;
  for (int i = 0; i < 6; ++i) d(i) = size * random.uniform(-1, 1);
  return d;
}

}  // namespace

TEST_SUITE("se3") {
  TEST_CASE("SE3: exp is the exponential of the 4x4 twist and log undoes it") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const double size : {0.0, 1e-9, 1e-4, 0.1, 0.57, 0.58, 1.0, 1.7}) {
      const Vector<6> d = random_step(random, size);
      Matrix<4> twist = Matrix<4>::Zero();
      twist.topLeftCorner<3, 3>() = cairn::skew(d.tail<3>());
      twist.topRightCorner<3, 1>() = d.head<3>();
      Matrix<4> term = Matrix<4>::Identity(), sum = term;
      for (int k = 1; k < 60; ++k) sum += (term = (term * twist / k).eval());
      CHECK((SE3::exp(d).matrix() - sum).norm() < 5e-15);
      CHECK((SE3::exp(d).log() - d).norm() < 5e-15);
    }
  }

  TEST_CASE("SE3: obeys the laws of a group, names cancel, matrices agree") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 100; ++run) {
      const SE3 T_a_b = SE3::exp(random_step(random, 2)), T_b_c = SE3::exp(random_step(random, 2));
      const Vector<3> p_c(random.normal(), random.normal(), random.normal());
      CHECK((T_a_b * T_b_c * p_c - T_a_b * (T_b_c * p_c)).norm() < 1e-14);
      CHECK(((T_a_b * T_b_c).matrix() - T_a_b.matrix() * T_b_c.matrix()).norm() < 1e-14);
      CHECK((T_a_b * T_a_b.inverse()).log().norm() < 1e-14);
      CHECK((SE3::from_matrix(T_a_b.matrix()).matrix() - T_a_b.matrix()).norm() < 1e-14);
      const Vector<6> d = random_step(random, 1);
      CHECK(((T_a_b * SE3::exp(d)).matrix() - (SE3::exp(T_a_b.adjoint() * d) * T_a_b).matrix()).norm() <
            1e-13);
      CHECK((cairn::local(T_a_b, cairn::retract(T_a_b, d)) - d).norm() < 1e-14);
    }
  }

  TEST_CASE("SE3: Jacobians agree with numeric differentiation at every angle") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const double size : {0.0, 1e-8, 1e-3, 0.3, 0.57, 0.59, 1.0, 1.7}) {
      CAPTURE(size);
      const Vector<6> d = random_step(random, size);
      const auto numeric = cairn::numeric_jacobian([](const Vector<6>& e) { return SE3::exp(e); }, d);
      CHECK((SE3::right_jacobian(d) - numeric).norm() < 2e-9);
      CHECK((SE3::left_jacobian(d) - SE3::exp(d).adjoint() * SE3::right_jacobian(d)).norm() < 1e-13);
      CHECK((SE3::left_jacobian(d) * SE3::left_jacobian_inverse(d) - Matrix<6>::Identity()).norm() < 1e-13);
      CHECK((SE3::right_jacobian(d) * SE3::right_jacobian_inverse(d) - Matrix<6>::Identity()).norm() < 1e-13);
    }
  }

  TEST_CASE("SE3: dual numbers differentiate a point's path exactly, at the identity too") {
    using Dual = cairn::Dual<double, 6>;
    const Vector<3> p(0.3, -2, 5);
    Vector<6, Dual> d;
    for (int i = 0; i < 6; ++i) d(i) = Dual::variable(0.0, i);
    const Vector<3, Dual> moved = cairn::BasicSE3<Dual>::exp(d) * Vector<3, Dual>(p.cast<Dual>());
    Matrix<3, 6> expected;
    expected << Matrix<3>::Identity(), -cairn::skew(p);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 6; ++j) CHECK(moved(i).slope[j] == doctest::Approx(expected(i, j)).epsilon(1e-15));
  }

  TEST_CASE("SE3::from_matrix: refuses a wrong last row and numbers that are not finite") {
    Matrix<4> m = Matrix<4>::Identity();
    m(3, 0) = 0.5;
    CHECK_THROWS_AS((void)SE3::from_matrix(m), cairn::Error);
    m = Matrix<4>::Identity();
    m(0, 3) = NAN;
    CHECK_THROWS_AS((void)SE3::from_matrix(m), cairn::Error);
    m = 2 * Matrix<4>::Identity();
    CHECK_THROWS_AS((void)SE3::from_matrix(m), cairn::Error);
    CHECK((SE3().cast<float>().cast<double>().matrix() - Matrix<4>::Identity()).norm() == 0.0);
  }
}

}  // namespace se3_test
