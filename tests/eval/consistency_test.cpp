// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/eval/consistency.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se3.hpp>

#include "support/random.hpp"

using cairn::Consistency;
using cairn::Matrix;
using cairn::Vector;

namespace consistency_test {
namespace {

// A covariance with correlations, its factor, and draws from it scaled by `factor`.
template <int N>
cairn::ConsistencyTest draw(double factor, int count, std::uint64_t seed) {
  cairn::Random random(seed);
  Matrix<N> L = Matrix<N>::Identity();
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < i; ++j) L(i, j) = random.uniform(-1.0, 1.0);
  const Matrix<N> covariance = L * L.transpose();
  cairn::ConsistencyTest test(N);
  for (int k = 0; k < count; ++k) {
    Vector<N> u;
    for (int i = 0; i < N; ++i) u(i) = random.normal();
    test.add(*cairn::normalised_squared(factor * (L * u), covariance));
  }
  return test;
}

}  // namespace

TEST_SUITE("consistency") {
  TEST_CASE("consistency: equals the closed form") {
    const Vector<2> e(3.0, 4.0);
    Matrix<2> P;
    P << 2.0, 1.0, 1.0, 2.0;  // P^-1 = [2 -1; -1 2] / 3
    CHECK(*cairn::normalised_squared(e, P) == doctest::Approx((2 * 9 - 2 * 12 + 2 * 16) / 3.0));
  }

  TEST_CASE("consistency: a covariance that is not positive definite is no verdict") {
    const Vector<2> e(1.0, 1.0);
    Matrix<2> P;
    P << 1.0, 2.0, 2.0, 1.0;
    CHECK_FALSE(cairn::normalised_squared(e, P).has_value());
    CHECK_FALSE(cairn::normalised_squared(e, Matrix<2>::Zero()).has_value());
    CHECK_FALSE(cairn::normalised_squared(e, Matrix<2>::Identity() * 5e-324).has_value());
  }

  TEST_CASE("consistency: right covariances are inside the band, wrong ones on the right side of it") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    CHECK(draw<3>(1.0, 2000, seed).verdict(0.9999) == Consistency::consistent);
    CHECK(draw<6>(1.0, 2000, seed).verdict(0.9999) == Consistency::consistent);
    CHECK(draw<3>(1.15, 2000, seed).verdict(0.9999) == Consistency::optimistic);
    CHECK(draw<3>(0.85, 2000, seed).verdict(0.9999) == Consistency::pessimistic);
  }

  TEST_CASE("consistency: the bands are those of the tables") {
    cairn::ConsistencyTest test(6);
    for (int i = 0; i < 50; ++i) test.add(6.0);
    CHECK(test.band().low == doctest::Approx(5.08).epsilon(0.002));
    CHECK(test.band().high == doctest::Approx(7.00).epsilon(0.002));
    CHECK(test.band_of(20).low == doctest::Approx(4.58).epsilon(0.002));
    CHECK(test.mean() == 6.0);
  }

  TEST_CASE("consistency: nees steps on the manifold from the estimate to the truth") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto draw_tangent = [&](double size) {
      Vector<6> d;
      for (int i = 0; i < 6; ++i) d(i) = size * random.normal();
      return d;
    };
    const cairn::SE3 estimate = cairn::SE3::exp(draw_tangent(1.0));
    const Vector<6> d = draw_tangent(0.3);
    const Matrix<6> P = Matrix<6>::Identity() * 0.04;
    CHECK(cairn::nees(cairn::Gaussian<cairn::SE3>{estimate, P}, cairn::retract(estimate, d)) ==
          doctest::Approx(d.squaredNorm() / 0.04).epsilon(1e-9));
  }

  TEST_CASE("consistency: refuses values that are no normalised squares") {
    const auto previous = cairn::set_violation_handler(
        [](const cairn::Violation& violation) { throw std::logic_error(violation.sentence); });
    cairn::ConsistencyTest test(2);
    CHECK_THROWS_AS(test.add(std::nan("")), std::logic_error);
    CHECK_THROWS_AS(test.add(-1.0), std::logic_error);
    CHECK_THROWS_AS(static_cast<void>(test.band()), std::logic_error);
    CHECK_THROWS_AS(cairn::ConsistencyTest(0.0), std::logic_error);
    cairn::set_violation_handler(previous);
  }
}

}  // namespace consistency_test
