// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/filter/detail/symmetric_rows.hpp>

#include "support/random.hpp"

namespace symmetric_rows_test {
namespace {

using cairn::detail::padded;
using cairn::detail::SymmetricRows;

/// The same numbers in a full square.
template <class S>
struct Square {
  int n = 0;
  std::vector<S> numbers;
  explicit Square(int size) : n(size), numbers(static_cast<std::size_t>(size * size)) {}
  S& operator()(int i, int j) { return numbers[static_cast<std::size_t>(i * n + j)]; }
};

template <class S>
void fill(SymmetricRows<S>& rows, Square<S>& square, cairn::Random& random) {
  rows = {};
  rows.resize(square.n);
  for (int i = 0; i < square.n; ++i)
    for (int j = 0; j <= i; ++j)
      rows.row(i)[j] = square(i, j) = square(j, i) = static_cast<S>(random.uniform(-1, 1));
}
template <class S>
double difference(const SymmetricRows<S>& rows, Square<S>& square) {
  double largest = rows.size() == square.n ? 0.0 : 1e300;
  for (int i = 0; i < square.n; ++i)
    for (int j = 0; j < square.n; ++j)
      largest = std::max(largest, std::abs(static_cast<double>(rows.at(i, j) - square(i, j))));
  return largest;
}

TEST_SUITE("symmetric_rows") {
  TEST_CASE_TEMPLATE("symmetric_rows: every operation is that on a full square, at every size", S, float,
                     double) {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const double rounding = sizeof(S) == 4 ? 1e-5 : 1e-13;
    for (int n = 1; n <= 70; ++n) {
      CAPTURE(n);
      SymmetricRows<S> rows;
      Square<S> square(n);
      const std::size_t stride = padded<S>(n + 3);

      // whole rows out and in
      fill(rows, square, random);
      const int count = 1 + static_cast<int>(random.below(static_cast<std::uint64_t>(std::min(n, 6))));
      const int first = static_cast<int>(random.below(static_cast<std::uint64_t>(n - count + 1)));
      std::vector<S> taken(static_cast<std::size_t>(count) * stride, S(7));
      rows.gather(first, count, taken.data(), stride);
      for (int k = 0; k < count; ++k)
        for (std::size_t i = 0; i < stride; ++i) {
          const bool outside = i >= static_cast<std::size_t>(n);
          CHECK(taken[static_cast<std::size_t>(k) * stride + i] ==
                (outside ? S(0) : square(first + k, static_cast<int>(i))));
        }
      for (int k = 0; k < count; ++k)
        for (int i = 0; i < n; ++i) {
          const bool upper = i >= first && i < first + count && i > first + k;
          const S value = static_cast<S>(random.uniform());
          taken[static_cast<std::size_t>(k) * stride + static_cast<std::size_t>(i)] = value;
          if (!upper) square(first + k, i) = square(i, first + k) = value;
        }
      rows.scatter(first, count, taken.data(), stride);
      CHECK(difference(rows, square) == 0.0);

      // products, of any number of terms, on any rows
      for (const int terms : {1, 2, 3, 4, 7}) {
        CAPTURE(terms);
        fill(rows, square, random);
        std::vector<S> left(static_cast<std::size_t>(terms) * stride), right(left.size());
        for (int k = 0; k < terms; ++k)
          for (int i = 0; i < n; ++i) {
            left[static_cast<std::size_t>(k) * stride + static_cast<std::size_t>(i)] =
                static_cast<S>(random.uniform(-1, 1));
            right[static_cast<std::size_t>(k) * stride + static_cast<std::size_t>(i)] =
                static_cast<S>(random.uniform(-1, 1));
          }
        const int from = static_cast<int>(random.below(static_cast<std::uint64_t>(n)));
        const int to = from + 1 + static_cast<int>(random.below(static_cast<std::uint64_t>(n - from)));
        rows.subtract_products(from, to, left.data(), right.data(), stride, terms);
        for (int i = from; i < to; ++i)
          for (int j = 0; j <= i; ++j) {
            for (int k = 0; k < terms; ++k)
              square(i, j) -= left[static_cast<std::size_t>(k) * stride + static_cast<std::size_t>(i)] *
                              right[static_cast<std::size_t>(k) * stride + static_cast<std::size_t>(j)];
            square(j, i) = square(i, j);
          }
        CHECK(difference(rows, square) < rounding);
      }

      // turned
      if (n >= 3) {
        fill(rows, square, random);
        S by[9];
        for (S& number : by) number = static_cast<S>(random.uniform(-1, 1));
        const int at = static_cast<int>(random.below(static_cast<std::uint64_t>(n - 2)));
        rows.template turn<3>(at, by);
        Square<S> half(n), turned(n);
        const auto factor = [&](int i, int j) {
          const bool inside = i >= at && i < at + 3 && j >= at && j < at + 3;
          return inside ? by[(j - at) * 3 + (i - at)] : S(i == j && (i < at || i >= at + 3) ? 1 : 0);
        };
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j)
            for (int k = 0; k < n; ++k) half(i, j) += factor(i, k) * square(k, j);
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j)
            for (int k = 0; k < n; ++k) turned(i, j) += half(i, k) * factor(j, k);
        CHECK(difference(rows, turned) < rounding);
      }

      // zero, dropped, and new rows that are zero although others stood there
      fill(rows, square, random);
      rows.set_zero(first, count);
      for (int k = first; k < first + count; ++k)
        for (int i = 0; i < n; ++i) square(k, i) = square(i, k) = S(0);
      CHECK(difference(rows, square) == 0.0);
      fill(rows, square, random);
      std::vector<int> kept;
      for (int i = 0; i < n; ++i)
        if (random.below(3) != 0) kept.push_back(i);
      rows.keep(kept);
      Square<S> rest(static_cast<int>(kept.size()));
      for (int i = 0; i < rest.n; ++i)
        for (int j = 0; j < rest.n; ++j)
          rest(i, j) = square(kept[static_cast<std::size_t>(i)], kept[static_cast<std::size_t>(j)]);
      CHECK(difference(rows, rest) == 0.0);
      rows.resize(n);
      for (int i = rest.n; i < n; ++i)
        for (int j = 0; j <= i; ++j) CHECK(rows.at(i, j) == S(0));
    }
  }
}

}  // namespace
}  // namespace symmetric_rows_test
