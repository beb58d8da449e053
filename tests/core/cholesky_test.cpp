// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstdint>
#include <limits>

#include <Eigen/Cholesky>
#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>

using cairn::Cholesky;
using cairn::Matrix;
using cairn::Vector;

namespace {

template <int R, int C, class S>
Matrix<R, C, S> drawn(cairn::Random& random, int rows, int columns) {
  Matrix<R, C, S> a(rows, columns);
  for (int c = 0; c < columns; ++c)
    for (int r = 0; r < rows; ++r) a(r, c) = static_cast<S>(random.normal());
  return a;
}

/// Against Eigen's factor, which is written quite differently, and against what the words say.
template <int N, class S>
void check_against_eigen(int n, S tolerance) {
  cairn::Random random(static_cast<std::uint64_t>(n));
  for (int trial = 0; trial < 50; ++trial) {
    const Matrix<N, N, S> root = drawn<N, N, S>(random, n, n);
    const Matrix<N, N, S> a = root * root.transpose() + S(0.1) * Matrix<N, N, S>::Identity(n, n);
    const Matrix<N, 3, S> b = drawn<N, 3, S>(random, n, 3);
    const Vector<N, S> v = b.col(0);
    const Cholesky<N, S> factor(a);
    const Eigen::LLT<Matrix<N, N, S>> peer(a);
    REQUIRE(factor.good());
    CHECK(factor.lower().isApprox(Matrix<N, N, S>(peer.matrixL()), tolerance));
    CHECK(factor.solve(v).isApprox(peer.solve(v), tolerance));
    CHECK(factor.solve(b).isApprox(peer.solve(b), tolerance));
    CHECK(factor.whiten(v).squaredNorm() == doctest::Approx(static_cast<double>(v.dot(peer.solve(v)))));
    CHECK(factor.unwhiten(factor.whiten(b)).isApprox(peer.solve(b), tolerance));
    CHECK((a * factor.inverse()).isIdentity(tolerance));
    CHECK(factor.inverse() == factor.inverse().transpose());
  }
}

}  // namespace

TEST_SUITE("Cholesky") {
  TEST_CASE("agrees with Eigen's factor: fixed and dynamic sizes, float to long double") {
    check_against_eigen<1, double>(1, 1e-10);
    check_against_eigen<3, double>(3, 1e-10);
    check_against_eigen<11, double>(11, 1e-10);
    check_against_eigen<6, float>(6, 1e-2F);
    check_against_eigen<5, long double>(5, 1e-13L);
    check_against_eigen<cairn::dynamic, double>(40, 1e-10);
  }

  TEST_CASE("says what is not positive definite, and then answers NaN") {
    const double nan = std::numeric_limits<double>::quiet_NaN(),
                 inf = std::numeric_limits<double>::infinity();
    const auto refused = [](const Matrix<2>& a) {
      const Cholesky<2> factor(a);
      CHECK_FALSE(factor.inverse().allFinite());
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
