// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/manifold/pack.hpp>
#include <cairn/manifold/pack_math.hpp>

namespace pack_test {
namespace {

constexpr int width = cairn::detail::pack_width<double>;
using P = cairn::Pack<double, width>;

// Distance in units of the last place of the true value, which is known to more digits.
double ulps(double value, long double truth) {
  const double size = std::abs(static_cast<double>(truth));
  const double unit = std::nextafter(size, std::numeric_limits<double>::infinity()) - size;
  return static_cast<double>(std::abs(static_cast<long double>(value) - truth) /
                             static_cast<long double>(unit));
}

P random_pack(cairn::Random& random, double size) {
  P x;
  for (int l = 0; l < width; ++l) {
    const double value = size * (2.0 * random.uniform() - 1.0);
    x.lanes[l] = value;
  }
  return x;
}

TEST_SUITE("pack") {
  TEST_CASE("sin, cos and atan2 are right to 2.5 units in the last place") {
    cairn::Random random(3);
    double worst = 0.0;
    for (int k = 0; k < 20000; ++k) {
      const double exponent = 9.0 * random.uniform() - 4.5;
      const P x = random_pack(random, std::pow(10.0, exponent));
      const P y = random_pack(random, 1.0);
      const P s = sin(x), c = cos(x), a = atan2(y, x);
      for (int l = 0; l < width; ++l) {
        worst = std::max(worst, ulps(s[l], std::sin(static_cast<long double>(x[l]))));
        worst = std::max(worst, ulps(c[l], std::cos(static_cast<long double>(x[l]))));
        worst = std::max(
            worst, ulps(a[l], std::atan2(static_cast<long double>(y[l]), static_cast<long double>(x[l]))));
      }
    }
    CHECK(worst < 2.5);
    CHECK(worst > 0.1);  // the oracle has more digits than the answer
  }
  TEST_CASE("multiples of pi/2 and arguments beyond the reduction") {
    for (int k = -40; k <= 40; ++k) {
      const double x = k * 1.57079632679489661923;
      CHECK(std::abs(sin(P(x))[0] - std::sin(x)) < 1e-15);
      CHECK(std::abs(cos(P(x))[0] - std::cos(x)) < 1e-15);
    }
    CHECK(sin(P(1e300))[0] == std::sin(1e300));
    CHECK(cos(P(123456789.0))[0] == std::cos(123456789.0));
  }
  TEST_CASE("atan2 on the axes, at the origin and in every quadrant") {
    for (const double y : {-2.0, -1.0, 0.0, 1.0, 2.0})
      for (const double x : {-2.0, -1.0, 0.0, 1.0, 2.0})
        CHECK(atan2(P(y), P(x))[0] == doctest::Approx(std::atan2(y, x)).epsilon(1e-15));
  }
  TEST_CASE("not a number stays one, and infinity becomes one") {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double infinity = std::numeric_limits<double>::infinity();
    CHECK(std::isnan(sin(P(nan))[0]));
    CHECK(std::isnan(cos(P(infinity))[0]));
    CHECK(std::isnan(atan2(P(nan), P(1.0))[0]));
    CHECK(std::isnan(atan2(P(1.0), P(nan))[0]));
    CHECK(std::isnan(sqrt(P(-1.0))[0]));
  }
  TEST_CASE("angles wrap lane by lane") {
    P x(0.5);
    x.lanes[width - 1] = 7.0;
    const P w = wrapped(x);
    CHECK(w[0] == 0.5);
    CHECK(w[width - 1] == doctest::Approx(7.0 - 6.283185307179586).epsilon(1e-15));
  }
  TEST_CASE("select takes from the first where the mask holds") {
    P x(1.0);
    x.lanes[0] = -1.0;
    const P chosen = select(x < P(0.0), P(10.0), P(20.0));
    CHECK(chosen[0] == 10.0);
    CHECK(chosen[width - 1] == 20.0);
  }
  TEST_CASE("floats and other functions go number by number") {
    using F = cairn::Pack<float, 4>;
    CHECK(sin(F(0.5F))[3] == std::sin(0.5F));
    CHECK(atan2(F(0.5F), F(-2.0F))[1] == std::atan2(0.5F, -2.0F));
    CHECK(sqrt(F(2.0F))[2] == std::sqrt(2.0F));
    CHECK(exp(P(1.25))[0] == std::exp(1.25));
    CHECK(log(P(1.25))[width - 1] == std::log(1.25));
    CHECK(floor(P(-1.25))[0] == -2.0);
  }
}

}  // namespace
}  // namespace pack_test
