// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <initializer_list>

#include <doctest/doctest.h>

#include <cairn/manifold/detail/stumpff.hpp>

TEST_SUITE("stumpff") {
  TEST_CASE("stumpff: equals the closed forms in long double on both sides of the switch") {
    for (const double angle : {0.7, 0.9, 0.999999, 1.0, 1.000001, 1.5, 2.5, 3.14159, 6.0}) {
      const long double a = angle, x = a * a;
      const auto f = cairn::detail::stumpff(angle * angle);
      CHECK(f.c[0] == doctest::Approx(static_cast<double>(std::cos(a))).epsilon(1e-14));
      CHECK(f.c[1] == doctest::Approx(static_cast<double>(std::sin(a) / a)).epsilon(1e-14));
      CHECK(f.c[2] == doctest::Approx(static_cast<double>((1 - std::cos(a)) / x)).epsilon(1e-14));
      CHECK(f.c[3] == doctest::Approx(static_cast<double>((a - std::sin(a)) / (a * x))).epsilon(1e-14));
      CHECK(f.c[4] ==
            doctest::Approx(static_cast<double>((x / 2 - 1 + std::cos(a)) / (x * x))).epsilon(1e-13));
      CHECK(f.c[5] ==
            doctest::Approx(static_cast<double>((a * x / 6 - a + std::sin(a)) / (a * x * x))).epsilon(1e-13));
    }
  }

  TEST_CASE("stumpff: is 1/k! at zero and obeys the recurrence where closed forms cancel") {
    const auto zero = cairn::detail::stumpff(0.0);
    double factorial = 1;
    for (int k = 0; k < 6; ++k) {
      CHECK(zero.c[k] == doctest::Approx(1 / factorial).epsilon(1e-16));
      factorial *= k + 1;
    }
    for (const double x : {1e-20, 1e-10, 1e-4, 0.01, 0.3}) {
      const auto f = cairn::detail::stumpff(x);
      CHECK(f.c[3] == doctest::Approx(1.0 / 6 - x / 120 + x * x / 5040 - x * x * x / 362880).epsilon(1e-7));
      CHECK(f.c[2] - (0.5 - x * f.c[4]) == 0.0);
      CHECK(f.c[0] * f.c[0] + x * f.c[1] * f.c[1] == doctest::Approx(1).epsilon(1e-15));
    }
  }
}
