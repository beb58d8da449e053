// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/detail/joint_covariance.hpp>

#include "support/random.hpp"

namespace joint_covariance_test {
namespace {

/// B B^T of an n x rank matrix with rows of very different size.
std::vector<double> random_square(int n, int rank, cairn::Random& random) {
  std::vector<double> b(static_cast<std::size_t>(n * rank)), a(static_cast<std::size_t>(n * n));
  for (int i = 0; i < n; ++i) {
    const double size = std::pow(10.0, random.uniform(-6, 6));
    for (int k = 0; k < rank; ++k) b[static_cast<std::size_t>(i * rank + k)] = size * random.normal();
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < rank; ++k)
        a[static_cast<std::size_t>(j * n + i)] +=
            b[static_cast<std::size_t>(i * rank + k)] * b[static_cast<std::size_t>(j * rank + k)];
  return a;
}

TEST_SUITE("joint_covariance") {
  TEST_CASE("joint_covariance: the pivoted root is one of a covariance of any rank, and says which") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int n = 1; n <= 12; ++n)
      for (int rank = 0; rank <= n; ++rank)
        for (int round = 0; round < 10; ++round) {
          CAPTURE(n);
          CAPTURE(rank);
          const std::vector<double> a = random_square(n, rank, random);
          std::vector<double> root = a, diagonal(static_cast<std::size_t>(n));
          std::vector<int> order(static_cast<std::size_t>(n));
          int found = -1;
          REQUIRE(cairn::detail::pivoted_cholesky(root.data(), n, order.data(), diagonal.data(), found));
          CHECK(found == rank);
          // entry (row, k-th pivot), zero for rows that were pivots before
          const auto at = [&](int q, int k) {
            return q < k ? 0.0
                         : root[static_cast<std::size_t>(order[static_cast<std::size_t>(k)] * n +
                                                         order[static_cast<std::size_t>(q)])];
          };
          for (int p = 0; p < n; ++p)
            for (int q = 0; q < n; ++q) {
              double sum = 0.0;
              for (int k = 0; k < found; ++k) sum += at(p, k) * at(q, k);
              const int i = order[static_cast<std::size_t>(p)], j = order[static_cast<std::size_t>(q)];
              const double scale =
                  std::sqrt(a[static_cast<std::size_t>(i * n + i)] * a[static_cast<std::size_t>(j * n + j)]);
              CHECK(std::abs(sum - a[static_cast<std::size_t>(j * n + i)]) <= 1e-12 * scale);
            }
        }
  }

  TEST_CASE("joint_covariance: what is no covariance has no root") {
    const auto good = [](std::vector<double> a, int n) {
      std::vector<double> diagonal(static_cast<std::size_t>(n));
      std::vector<int> order(static_cast<std::size_t>(n));
      int rank = 0;
      return cairn::detail::pivoted_cholesky(a.data(), n, order.data(), diagonal.data(), rank);
    };
    const double nan = std::nan("");
    CHECK(good({1, 0.5, 0.5, 1}, 2));
    CHECK(good({1, 1, 1, 1}, 2));
    CHECK(good({0, 0, 0, 0}, 2));
    CHECK_FALSE(good({1, 1.001, 1.001, 1}, 2));
    CHECK_FALSE(good({1, 0, 0, -1e-9}, 2));
    CHECK_FALSE(good({0, 1e-9, 1e-9, 1}, 2));
    CHECK_FALSE(good({nan}, 1));
    CHECK_FALSE(good({1, nan, nan, 1}, 2));
    CHECK_FALSE(good({1.0, 0, 0, 1e308 * 10}, 2));
  }
}

}  // namespace
}  // namespace joint_covariance_test
