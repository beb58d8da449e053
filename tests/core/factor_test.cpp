// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>

#include <doctest/doctest.h>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>

#include "support/random.hpp"

namespace factor_test {
namespace {

using cairn::Matrix;
using cairn::Vector;

/// Number (i, j) of a^T a.
template <class A>
long double square(const A& a, int i, int j) {
  long double sum = 0;
  for (int k = 0; k < static_cast<int>(a.rows()); ++k)
    sum += static_cast<long double>(a(k, i)) * static_cast<long double>(a(k, j));
  return sum;
}

/// Numbers of either sign, of which many are zero: columns with nothing below the diagonal come about.
Matrix<6, 4> sparse(cairn::Random& random) {
  Matrix<6, 4> a = Matrix<6, 4>::Zero();
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 6; ++i)
      if (random.below(3) == 0) a(i, j) = random.normal();
  return a;
}

}  // namespace

TEST_SUITE("factor") {
  TEST_CASE("triangularise: upper triangular, not negative on the diagonal, and of the same square") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int round = 0; round < 2000; ++round) {
      CAPTURE(round);
      const Matrix<6, 4> before = sparse(random);
      Matrix<6, 4> a = before;
      cairn::detail::triangularise(a);
      for (int j = 0; j < 4; ++j) {
        CHECK(a(j, j) >= 0);
        for (int i = j + 1; i < 6; ++i) CHECK(a(i, j) == 0);
        for (int i = 0; i < 4; ++i)
          CHECK(std::abs(static_cast<double>(square(a, i, j) - square(before, i, j))) < 1e-13);
      }
    }
  }

  TEST_CASE("pivoted_root: its square is the covariance, of whatever rank, and no more columns than that") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int round = 0; round < 500; ++round) {
      CAPTURE(round);
      const int rank = static_cast<int>(random.below(5));
      Matrix<4> half = Matrix<4>::Zero();
      for (int k = 0; k < rank; ++k)
        for (int i = 0; i < 4; ++i) half(i, k) = random.normal() * std::pow(10.0, i);
      const Matrix<4> a = half * half.transpose();
      cairn::detail::PivotedRoot<4, double> root;
      REQUIRE(cairn::detail::pivoted_root<4, double>(a, root));
      CHECK(root.rank == rank);
      for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) {
          long double sum = 0;
          for (int k = 0; k < 4; ++k) sum += static_cast<long double>(root.root(i, k)) * root.root(j, k);
          CHECK(std::abs(static_cast<double>(sum) - a(i, j)) <= 1e-13 * std::sqrt(a(i, i) * a(j, j)));
        }
    }
  }

  TEST_CASE("pivoted_root: what has a negative direction is refused, on the diagonal and beside it") {
    cairn::detail::PivotedRoot<2, double> root;
    for (const double variance : {1.0, 1e-6, 1e6}) {
      Matrix<2> a;
      a << variance, 0, 0, -variance;
      CHECK_FALSE(cairn::detail::pivoted_root<2, double>(a, root));
      a << variance, 1.001 * variance, 1.001 * variance, variance;
      CHECK_FALSE(cairn::detail::pivoted_root<2, double>(a, root));
      a << variance, variance, variance, variance;
      CHECK(cairn::detail::pivoted_root<2, double>(a, root));
      a << variance, 1e-3 * variance, 1e-3 * variance, 0;
      CHECK_FALSE(cairn::detail::pivoted_root<2, double>(a, root));
    }
  }
}

}  // namespace factor_test
