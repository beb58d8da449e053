// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/simd/matrix_product.hpp>

#include "support/random.hpp"

namespace matrix_product_test {

/// Largest difference from the sums in long double, over rounding of the sums of magnitudes.
template <class S>
double error(int rows, int inner, int columns, cairn::Random& random) {
  const auto size = [](int a, int b) { return static_cast<std::size_t>(a) * static_cast<std::size_t>(b); };
  std::vector<S> a(size(rows, inner)), b(size(inner, columns));
  std::vector<S> c(size(rows, columns) + 1, S(77));  // what stood there before counts for nothing
  for (S& number : a) number = static_cast<S>(random.normal());
  for (S& number : b) number = static_cast<S>(random.normal());
  cairn::detail::multiply(a.data(), b.data(), c.data(), rows, inner, columns);
  double worst = c.back() == S(77) ? 0.0 : 1e9;  // nothing is written behind the end
  for (int j = 0; j < columns; ++j)
    for (int i = 0; i < rows; ++i) {
      long double sum = 0, magnitudes = 0;
      for (int k = 0; k < inner; ++k) {
        const long double term = static_cast<long double>(a[size(k, rows) + static_cast<std::size_t>(i)]) *
                                 static_cast<long double>(b[size(j, inner) + static_cast<std::size_t>(k)]);
        sum += term;
        magnitudes += std::abs(term);
      }
      const S got = c[size(j, rows) + static_cast<std::size_t>(i)];
      const long double rounding = magnitudes * std::numeric_limits<S>::epsilon() * (inner + 1);
      if (static_cast<long double>(got) != sum)
        worst =
            std::max(worst, static_cast<double>(std::abs(static_cast<long double>(got) - sum) / rounding));
    }
  return worst;
}

TEST_CASE("matrix product: of every shape up to 19 it is the sum of products, and nothing else is written") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  double worst = 0, worst_of_floats = 0, worst_of_others = 0;
  for (int rows = 0; rows < 20; ++rows)
    for (int inner = 0; inner < 20; inner += inner < 4 ? 1 : 5)
      for (int columns = 0; columns < 20; ++columns) {
        worst = std::max(worst, error<double>(rows, inner, columns, random));
        worst_of_floats = std::max(worst_of_floats, error<float>(rows, inner, columns, random));
        if (columns < 6)
          worst_of_others = std::max(worst_of_others, error<long double>(rows, inner, columns, random));
      }
  CHECK(worst <= 1);
  CHECK(worst_of_floats <= 1);
  CHECK(worst_of_others <= 1);
}

TEST_CASE("matrix product: large ones agree with Eigen's, transposed or not") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  using M = cairn::Matrix<cairn::dynamic>;
  M a(61, 83), b(83, 47);
  for (double& number : a.reshaped()) number = random.normal();
  for (double& number : b.reshaped()) number = random.normal();
  const M expected = a * b;
  CHECK((cairn::product(a, b) - expected).norm() <= 1e-12 * expected.norm());
  CHECK((cairn::transposed_product(M(a.transpose()), b) - expected).norm() <= 1e-12 * expected.norm());
  CHECK((cairn::product_transposed(a, M(b.transpose())) - expected).norm() <= 1e-12 * expected.norm());
}

}  // namespace matrix_product_test
