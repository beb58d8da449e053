// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/symmetric_eigen.hpp>

#include "support/random.hpp"

namespace symmetric_eigen_test {
namespace {

template <class S>
struct Eigen {
  std::vector<S> values, vectors;
  bool good = false;
};

template <class S>
Eigen<S> eigen_of(std::vector<S> a, std::size_t n, S tolerance = 0) {
  Eigen<S> result{std::vector<S>(n), std::vector<S>(n * n)};
  result.good =
      cairn::symmetric_eigen(std::span(a), std::span(result.values), std::span(result.vectors), tolerance);
  return result;
}

/// A sum of `rank` signed squares.
template <class S>
std::vector<S> symmetric(std::size_t n, std::size_t rank, cairn::Random& random) {
  std::vector<S> a(n * n, S(0));
  for (std::size_t r = 0; r < rank; ++r) {
    std::vector<double> x(n);
    for (double& number : x) number = random.normal();
    const double sign = random.below(2) == 0 ? 1 : -1;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) a[i * n + j] += static_cast<S>(sign * x[i] * x[j]);
  }
  return a;
}

template <class S>
S largest(const std::vector<S>& numbers) {
  S result = 0;
  for (const S number : numbers) result = std::max(result, std::abs(number));
  return result;
}

/// |A v - l v| and |V^T V - I|, the largest entries, in long double.
template <class S>
void check_law(const std::vector<S>& a, std::size_t n, const Eigen<S>& eigen, long double error) {
  const long double size = largest(a);
  for (std::size_t i = 0; i < n; ++i) {
    const S* v = eigen.vectors.data() + i * n;
    for (std::size_t r = 0; r < n; ++r) {
      long double sum = -static_cast<long double>(eigen.values[i]) * v[r];
      for (std::size_t k = 0; k < n; ++k) sum += static_cast<long double>(a[r * n + k]) * v[k];
      CHECK(std::abs(sum) <= error * size);
    }
    for (std::size_t j = 0; j <= i; ++j) {
      long double sum = i == j ? -1 : 0;
      for (std::size_t k = 0; k < n; ++k) sum += static_cast<long double>(v[k]) * eigen.vectors[j * n + k];
      CHECK(std::abs(sum) <= error);
    }
  }
  CHECK(std::is_sorted(eigen.values.rbegin(), eigen.values.rend()));
}

}  // namespace

TEST_SUITE("symmetric_eigen") {
  TEST_CASE("symmetric_eigen: second differences have the eigenvalues 2 - 2 cos(k pi / (n + 1))") {
    for (const std::size_t n : {1U, 2U, 3U, 7U, 40U}) {
      CAPTURE(n);
      std::vector<double> a(n * n, 0.0);
      for (std::size_t i = 0; i < n; ++i) {
        a[i * n + i] = 2;
        if (i > 0) a[i * n + i - 1] = a[(i - 1) * n + i] = -1;
      }
      const Eigen<double> eigen = eigen_of(a, n);
      REQUIRE(eigen.good);
      for (std::size_t k = 0; k < n; ++k) {
        const double angle = std::numbers::pi * static_cast<double>(n - k) / static_cast<double>(n + 1);
        CHECK(std::abs(eigen.values[k] - (2 - 2 * std::cos(angle))) <
              1e-13);  // n epsilon times the largest is 4e-14
      }
      check_law(a, n, eigen, 1e-13L);
    }
  }

  TEST_CASE("symmetric_eigen: A v = l v of unit vectors at right angles, of whatever rank, sign and scale") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int round = 0; round < 300; ++round) {
      CAPTURE(round);
      const std::size_t n = 1 + random.below(9);
      const std::size_t rank = random.below(static_cast<std::uint32_t>(n + 2));
      std::vector<double> a = symmetric<double>(n, rank, random);
      for (double& number : a) number = std::ldexp(number, round % 601 - 300);
      const Eigen<double> eigen = eigen_of(a, n);
      REQUIRE(eigen.good);
      check_law(a, n, eigen, 3e-14L);
      if (rank + 1 < n)
        CHECK(std::count_if(eigen.values.begin(), eigen.values.end(), [&](double value) {
                return std::abs(value) > 1e-13 * largest(a);
              }) <= static_cast<std::ptrdiff_t>(rank));
      const std::vector<float> small = symmetric<float>(n, n, random);
      const Eigen<float> of_floats = eigen_of(small, n);
      REQUIRE(of_floats.good);
      check_law(small, n, of_floats, 2e-5L);
    }
  }

  TEST_CASE("symmetric_eigen: a size known when compiling gives the same bits") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int round = 0; round < 100; ++round) {
      const std::vector<double> a = symmetric<double>(4, 4, random);
      std::array<double, 16> fixed, vectors;
      std::array<double, 4> values;
      std::copy(a.begin(), a.end(), fixed.begin());
      REQUIRE(cairn::symmetric_eigen(std::span(fixed), std::span(values), std::span(vectors)));
      const Eigen<double> eigen = eigen_of(a, 4);
      CHECK(std::equal(values.begin(), values.end(), eigen.values.begin()));
      CHECK(std::equal(vectors.begin(), vectors.end(), eigen.vectors.begin()));
    }
  }

  TEST_CASE("symmetric_eigen: equal eigenvalues keep their order, and a tolerance ends it early") {
    const Eigen<double> equal = eigen_of<double>({3, 0, 0, 0, 5, 0, 0, 0, 3}, 3);
    REQUIRE(equal.good);
    CHECK(equal.values == std::vector<double>{5, 3, 3});
    CHECK(equal.vectors == std::vector<double>{0, 1, 0, 1, 0, 0, 0, 0, 1});
    const Eigen<double> early = eigen_of<double>({1, 1e-3, 1e-3, 2}, 2, 1e-2);
    REQUIRE(early.good);
    CHECK(early.values == std::vector<double>{2, 1});
    CHECK(eigen_of<double>({1, 1e-3, 1e-3, 2}, 2).values[0] > 2);
    CHECK(eigen_of<double>({0, 0, 0, 0}, 2).good);
    CHECK(eigen_of<double>({}, 0).good);
  }

  TEST_CASE("symmetric_eigen: numbers that are not finite, or whose sums are not, are refused") {
    const double infinity = std::numeric_limits<double>::infinity();
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), infinity, -infinity, 1.5e308}) {
      CAPTURE(bad);
      CHECK_FALSE(eigen_of<double>({bad, 1, 1, 2}, 2).good);
      CHECK_FALSE(eigen_of<double>({1, bad, bad, 2}, 2).good);
    }
    CHECK(eigen_of<double>({1e307, 1e306, 1e306, -1e307}, 2).good);
    CHECK(eigen_of<double>({1e-310, 1e-311, 1e-311, 2e-310}, 2).good);
  }
}
}  // namespace symmetric_eigen_test
