// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>

TEST_SUITE("statistics") {
  TEST_CASE("chi_square_quantile: agrees with printed tables") {
    CHECK(cairn::chi_square_quantile(0.95, 1) == doctest::Approx(3.841458820694124).epsilon(1e-12));
    CHECK(cairn::chi_square_quantile(0.99, 3) == doctest::Approx(11.344866730144373).epsilon(1e-12));
    CHECK(cairn::chi_square_quantile(0.5, 10) == doctest::Approx(9.341817765591976).epsilon(1e-12));
    CHECK(cairn::chi_square_quantile(0.0, 3) == 0.0);
  }

  TEST_CASE("chi_square_mean_band: the bands of the consistency tests") {
    const auto band = cairn::chi_square_mean_band(3, 50);
    CHECK(band.low == doctest::Approx(2.36).epsilon(0.003));
    CHECK(band.high == doctest::Approx(3.72).epsilon(0.003));
    CHECK(band.contains(3.0));
    CHECK_FALSE(band.contains(4.0));
  }

  TEST_CASE("chi_square_cdf: equals its closed form for two degrees of freedom") {
    for (const double x : {0.01, 0.5, 2.0, 7.0, 40.0})
      CHECK(cairn::chi_square_cdf(x, 2) == doctest::Approx(1.0 - std::exp(-0.5 * x)).epsilon(1e-13));
    CHECK(cairn::chi_square_cdf(-1.0, 2) == 0.0);
    CHECK(cairn::chi_square_cdf(INFINITY, 2) == 1.0);
  }

  TEST_CASE("log_gamma: factorials, the half's root of pi, and the library's function") {
    double factorial = 1;
    for (int n = 1; n <= 20; factorial *= n, ++n)
      CHECK(cairn::log_gamma(n) == doctest::Approx(std::log(factorial)).epsilon(1e-14));
    CHECK(std::exp(2 * cairn::log_gamma(0.5)) == doctest::Approx(std::acos(-1.0)).epsilon(1e-14));
    for (double x = 1e-6; x < 1e8; x *= 1.37) {
      const double known = std::lgamma(x);
      CHECK(std::abs(cairn::log_gamma(x) - known) <= 1e-14 * std::max(1.0, std::abs(known)));
    }
  }

  TEST_CASE("log_sum_exp: survives numbers whose exponentials do not") {
    const std::vector<double> values{-1000.0, -1000.0, -1000.0, -1000.0};
    CHECK(cairn::log_sum_exp(values) == doctest::Approx(-1000.0 + std::log(4.0)));
    CHECK(cairn::log_sum_exp({}) == -INFINITY);
  }

  TEST_CASE("running moments: equal the two-pass formulas far from zero") {
    cairn::Random random(7);
    std::vector<double> values(1000);
    cairn::RunningMoments moments;
    for (double& value : values) moments.add(value = 1e9 + random.normal());
    double mean = 0;
    for (const double value : values) mean += value - 1e9;
    mean /= 1000;
    double squares = 0;
    for (const double value : values) squares += (value - 1e9 - mean) * (value - 1e9 - mean);
    CHECK(moments.mean() - 1e9 == doctest::Approx(mean).epsilon(1e-6));
    CHECK(moments.variance() == doctest::Approx(squares / 999).epsilon(1e-6));
  }

  // At its mean P(a, a) = 1/2 + (1/3 + 1/(540 a) - ...) / sqrt(2 pi a), and within a deviation of it a sum of
  // so many squares is normal but for a skew of sqrt(8 / d): Cornish and Fisher's quantile.
  TEST_CASE("gamma_p: from few degrees of freedom to 10^12 it is what its expansion says") {
    for (double a = 100; a < 1e13; a *= 3) {
      CAPTURE(a);
      const double there = cairn::gamma_p(a, a);
      const double off = (1.0 / 3 + 1.0 / 540 / a) / std::sqrt(2 * std::numbers::pi * a);
      CHECK(std::abs(there - 0.5 - off) < 2e-3 / std::sqrt(a) / (a * a) + 1e-13);
      const double low = cairn::gamma_p(a, a - std::sqrt(a)), high = cairn::gamma_p(a, a + std::sqrt(a));
      CHECK(low > 0.15);
      CHECK(low < there);
      CHECK(high > there);
      CHECK(high < 0.86);
    }
    for (const double dof : {1e6, 1e9, 1e12}) {
      const auto band = cairn::chi_square_mean_band(1, dof);
      constexpr double z = 1.959963984540054;
      const double skew = 2 * (z * z - 1) / (3 * dof), spread = std::sqrt(2 / dof) * z;
      CHECK(std::abs(band.low - (1 + skew - spread)) < 1e-3 * skew + 1e-15);
      CHECK(std::abs(band.high - (1 + skew + spread)) < 1e-3 * skew + 1e-15);
    }
  }

  TEST_CASE("quantile: interpolates between order statistics") {
    CHECK(cairn::median({3.0, 1.0, 2.0}) == 2.0);
    CHECK(cairn::median({4.0, 1.0, 2.0, 3.0}) == 2.5);
    CHECK(cairn::quantile({0.0, 10.0}, 0.95) == doctest::Approx(9.5));
    CHECK(std::isnan(cairn::median({})));
    constexpr double infinite = std::numeric_limits<double>::infinity();
    CHECK(cairn::median({infinite, 2.0, 1.0}) == 2.0);
    CHECK(cairn::median({infinite, 1.0, infinite, infinite}) == infinite);
    CHECK(cairn::median({1.0, infinite}) == infinite);
    CHECK(cairn::quantile({-infinite, 1.0}, 0.25) == -infinite);
    CHECK(cairn::median({-1.5e308, 1.5e308}) == 0.0);
  }
}
