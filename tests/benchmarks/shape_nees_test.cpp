// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/shape_nees.hpp"

#include <optional>

#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/eval/consistency.hpp>
#include <cairn/manifold/se3.hpp>

namespace {

using cairn::dynamic;
using cairn::Matrix;
using cairn::Vector;

Vector<dynamic> normal_numbers(cairn::Random& random, Eigen::Index n) {
  Vector<dynamic> v(n);
  for (Eigen::Index i = 0; i < n; ++i) v(i) = random.normal();
  return v;
}

Matrix<dynamic> some_covariance(cairn::Random& random, Eigen::Index n) {
  Matrix<dynamic> A(n, n);
  for (Eigen::Index i = 0; i < n; ++i) A.col(i) = normal_numbers(random, n);
  return A * A.transpose() + Matrix<dynamic>::Identity(n, n);
}

}  // namespace

TEST_SUITE("shape_nees") {
  TEST_CASE("shape_nees: a rigid motion of all points is no error of their shape") {
    cairn::Random random(1);
    const Vector<dynamic> points = normal_numbers(random, 24);
    const cairn::SE3 T = cairn::SE3::exp((Vector<6>() << 1, -2, 3, 4, -5, 6).finished() * 1e-6);
    Vector<dynamic> errors(24);
    for (Eigen::Index i = 0; i < 24; i += 3)
      errors.segment<3>(i) = T * Vector<3>(points.segment<3>(i)) - points.segment<3>(i);
    const Matrix<dynamic> P = 1e-12 * some_covariance(random, 24);
    const auto found = cairn_bench::shape_nees(points, errors, P);
    REQUIRE(found);
    CHECK(found->shape < 1e-6);
    CHECK(found->frame == doctest::Approx(*cairn::normalised_squared(errors, P)));
  }

  TEST_CASE("shape_nees: equal to NEES with a very uncertain frame, and the frame is the rest") {
    cairn::Random random(2);
    const Vector<dynamic> points = normal_numbers(random, 15), errors = normal_numbers(random, 15);
    const Matrix<dynamic> P = some_covariance(random, 15);
    Matrix<dynamic, 6> G(15, 6);
    for (Eigen::Index i = 0; i < 15; i += 3)
      G.middleRows<3>(i) << Matrix<3>::Identity(), -cairn::skew(Vector<3>(points.segment<3>(i)));
    const Matrix<dynamic> vague = P + 1e7 * G * G.transpose();
    const auto found = cairn_bench::shape_nees(points, errors, P);
    REQUIRE(found);
    CHECK(found->shape == doctest::Approx(*cairn::normalised_squared(errors, vague)).epsilon(1e-4));
    CHECK(found->shape + found->frame == doctest::Approx(*cairn::normalised_squared(errors, P)));
  }

  TEST_CASE("shape_nees: 3 n - 6 in the mean for errors as the covariance says") {
    cairn::Random random(3);
    const Vector<dynamic> points = normal_numbers(random, 18);
    const Matrix<dynamic> P = some_covariance(random, 18);
    const Matrix<dynamic> L = cairn::Cholesky<dynamic>(P).lower().triangularView<Eigen::Lower>();
    cairn::ConsistencyTest shape(12), frame(6);
    for (int run = 0; run < 2000; ++run) {
      const Vector<dynamic> errors = L * normal_numbers(random, 18);
      const auto found = cairn_bench::shape_nees(points, errors, P);
      REQUIRE(found);
      shape.add(found->shape);
      frame.add(found->frame);
    }
    CHECK(shape.verdict(0.999) == cairn::Consistency::consistent);
    CHECK(frame.verdict(0.999) == cairn::Consistency::consistent);
  }

  TEST_CASE("shape_nees: nothing for points on a line, for no covariance, for none") {
    Vector<dynamic> line(12);
    line << 0, 0, 0, 1, 2, 3, 2, 4, 6, -1, -2, -3;
    const Vector<dynamic> errors = Vector<dynamic>::Ones(12);
    CHECK_FALSE(cairn_bench::shape_nees(line, errors, Matrix<dynamic>::Identity(12, 12)));
    cairn::Random random(4);
    const Vector<dynamic> points = normal_numbers(random, 12);
    CHECK(cairn_bench::shape_nees(points, errors, Matrix<dynamic>::Identity(12, 12)));
    CHECK_FALSE(cairn_bench::shape_nees(points, errors, Matrix<dynamic>::Zero(12, 12)));
    CHECK_FALSE(cairn_bench::shape_nees({}, {}, {}));
  }
}
