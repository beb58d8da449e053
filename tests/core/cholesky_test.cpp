// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>

using cairn::Cholesky;
using cairn::Matrix;
using cairn::Vector;

namespace cholesky_test {
namespace {

template <int R, int C, class S>
Matrix<R, C, S> drawn(cairn::Random& random, int rows, int columns) {
  Matrix<R, C, S> a(rows, columns);
  for (int c = 0; c < columns; ++c)
    for (int r = 0; r < rows; ++r) a(r, c) = static_cast<S>(random.normal());
  return a;
}

/// What the words say.
template <int N, class S>
void check_factor(int n, S tolerance) {
  cairn::Random random(static_cast<std::uint64_t>(n));
  for (int trial = 0; trial < 50; ++trial) {
    const Matrix<N, N, S> root = drawn<N, N, S>(random, n, n);
    const Matrix<N, N, S> identity = Matrix<N, N, S>::Identity(n, n);
    const Matrix<N, N, S> a = root * root.transpose() + S(0.1) * identity;
    const Matrix<N, 3, S> b = drawn<N, 3, S>(random, n, 3);
    const Vector<N, S> v = b.col(0);
    const Cholesky<N, S> factor(a);
    const auto near = [&](const auto& x, const auto& y) {
      return (x - y).cwiseAbs().maxCoeff() <= tolerance * (S(1) + y.cwiseAbs().maxCoeff());
    };
    REQUIRE(factor.good());
    const Matrix<N, N, S>& lower = factor.lower();
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < c; ++r) CHECK(lower(r, c) == S(0));
    CHECK(near((lower * lower.transpose()).eval(), a));
    CHECK(near((a * factor.solve(v)).eval(), v));
    CHECK(near((a * factor.solve(b)).eval(), b));
    CHECK(near((lower * factor.whiten(b)).eval(), b));
    CHECK(near((lower.transpose() * factor.unwhiten(b)).eval(), b));
    CHECK(near((a * factor.inverse()).eval(), identity));
    CHECK(factor.inverse() == factor.inverse().transpose());
  }
}

}  // namespace

TEST_SUITE("Cholesky") {
  TEST_CASE("factors, solves and inverts: fixed and dynamic sizes, float to long double") {
    check_factor<1, double>(1, 1e-10);
    check_factor<6, float>(6, 2e-3F);
    check_factor<5, long double>(5, 1e-13L);
    check_factor<cairn::dynamic, double>(40, 1e-9);
  }

  TEST_CASE("agrees with Eigen's factor") {
    cairn::Random random(11);
    const Matrix<11> root = drawn<11, 11, double>(random, 11, 11);
    const Matrix<11> a = root * root.transpose();
    const Eigen::LLT<Matrix<cairn::dynamic>> peer(a);
    CHECK(Cholesky<11>(a).lower().isApprox(Matrix<cairn::dynamic>(peer.matrixL()), 1e-12));
    CHECK(std::exp(Cholesky<11>(a).log_determinant()) ==
          doctest::Approx(Matrix<cairn::dynamic>(a).determinant()).epsilon(1e-10));
  }

  TEST_CASE("says what is not positive definite, and then answers NaN") {
    const double nan = std::numeric_limits<double>::quiet_NaN(),
                 inf = std::numeric_limits<double>::infinity();
    const auto refused = [](const Matrix<2>& a) {
      const Cholesky<2> factor(a);
      CHECK_FALSE(factor.inverse().allFinite());
      CHECK(std::isnan(factor.log_determinant()));
      CHECK_FALSE(factor.solve(Vector<2>(1, 1)).allFinite());
      return !factor.good();
    };
    CHECK(refused((Matrix<2>() << 1, 2, 2, 1).finished()));
    CHECK(refused((Matrix<2>() << 1, 1, 1, 1).finished()));
    CHECK(refused((Matrix<2>() << -1, 0, 0, 1).finished()));
    CHECK(refused((Matrix<2>() << nan, 0, 0, 1).finished()));
    CHECK(refused((Matrix<2>() << 1, nan, nan, 1).finished()));
    CHECK(refused((Matrix<2>() << 1, 0, 0, inf).finished()));
    CHECK(refused(Matrix<2>::Zero()));
    for (const auto& a : {Matrix<cairn::dynamic>::Identity(3, 2), Matrix<cairn::dynamic>::Identity(2, 3)}) {
      const Cholesky<cairn::dynamic> factor(a);
      CHECK_FALSE(factor.good());
      CHECK_FALSE(factor.solve(Vector<cairn::dynamic>(Vector<cairn::dynamic>::Ones(a.rows()))).allFinite());
    }
  }

  TEST_CASE("least_share: what the other rows leave of a row, whatever its unit") {
    Matrix<2> a;
    a << 4, 2 * 0.6, 2 * 0.6, 1;  // correlation 0.6 leaves 1 - 0.36
    CHECK(Cholesky<2>(a).least_share() == doctest::Approx(0.64));
    const Matrix<2> scale = Vector<2>(1e6, 1e-6).asDiagonal();
    CHECK(Cholesky<2>(scale * a * scale).least_share() == doctest::Approx(0.64));
    CHECK(Cholesky<2>(Matrix<2>::Identity()).least_share() == 1.0);
  }

  TEST_CASE("add_transposed_product: what the expression gives") {
    cairn::Random random(3);
    const Matrix<8, 3> a = drawn<8, 3, double>(random, 8, 3);
    const Matrix<8, 11> b = drawn<8, 11, double>(random, 8, 11);
    Matrix<3, 11> sum = drawn<3, 11, double>(random, 3, 11);
    const Matrix<3, 11> expected = sum - 0.7 * a.transpose() * b;
    cairn::add_transposed_product(sum, a, b, -0.7);
    CHECK(sum.isApprox(expected, 1e-13));
  }
}

}  // namespace cholesky_test
