// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstddef>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/vision/detail/quadratic_peak.hpp>

#include "support/random.hpp"

namespace quadratic_peak_test {
namespace {

using cairn::detail::Neighbourhood;

template <class F>
Neighbourhood sampled(F&& function) {
  Neighbourhood n;
  for (std::size_t s = 0; s < 3; ++s)
    for (std::size_t y = 0; y < 3; ++y)
      for (std::size_t x = 0; x < 3; ++x)
        n[s][y][x] = static_cast<float>(
            function(static_cast<double>(x) - 1, static_cast<double>(y) - 1, static_cast<double>(s) - 1));
  return n;
}

}  // namespace

TEST_SUITE("quadratic_peak") {
  TEST_CASE("fit_peak: finds the top of a hill whose root is quadratic exactly") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int trial = 0; trial < 200; ++trial) {
      const double x0 = random.uniform(-1, 1), y0 = random.uniform(-1, 1), s0 = random.uniform(-1, 1);
      const double a = random.uniform(0.5, 2), b = random.uniform(0.5, 2), c = random.uniform(0.5, 2);
      const double skew = random.uniform(-0.45, 0.45);
      const auto peak = cairn::detail::fit_peak(sampled([&](double x, double y, double s) {
        const double dx = x - x0, dy = y - y0, ds = s - s0;
        return std::pow(40 - a * dx * dx - b * dy * dy - 2 * skew * dx * dy - c * ds * ds, 2);
      }));
      REQUIRE(peak.has_value());
      CHECK(peak->x == doctest::Approx(x0).epsilon(1e-4));
      CHECK(peak->y == doctest::Approx(y0).epsilon(1e-4));
      CHECK(peak->layer == doctest::Approx(s0).epsilon(1e-4));
      CHECK(peak->height == doctest::Approx(std::pow(40 - c * s0 * s0, 2)).epsilon(1e-5));
    }
  }

  TEST_CASE("fit_peak: a plain, a saddle and a pit have no peak") {
    CHECK_FALSE(cairn::detail::fit_peak(sampled([](double, double, double) { return 3; })));
    CHECK_FALSE(
        cairn::detail::fit_peak(sampled([](double x, double y, double s) { return x * x - y * y - s * s; })));
    CHECK_FALSE(cairn::detail::fit_peak(
        sampled([](double x, double y, double s) { return -x * x - y * y - 3 * x * y - s * s; })));
    CHECK_FALSE(
        cairn::detail::fit_peak(sampled([](double x, double y, double s) { return x * x + y * y + s * s; })));
    CHECK_FALSE(cairn::detail::fit_peak(
        sampled([](double x, double y, double s) { return -x * x - y * y + s * s; })));
  }
}

}  // namespace quadratic_peak_test
