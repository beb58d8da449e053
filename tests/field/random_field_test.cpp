// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/gaussian_blur.hpp>
#include <cairn/field/random_field.hpp>

#include "support/random.hpp"

using cairn::FieldGrid;
using cairn::RandomField;

TEST_SUITE("random_field") {
  TEST_CASE("random_field: the correlation of the draws is the one asked for") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    const RandomField law{2.0, 0.2};
    cairn::Random random(seed);
    const int lags[] = {0, 2, 4, 6, 10};
    double sums[5] = {}, count = 0;
    for (int draw = 0; draw < 6; ++draw) {
      const FieldGrid field = law.draw(400, 300, {0, 0, 1, 1}, random);
      for (int r = 0; r + 10 < 300; r += 3)
        for (int c = 0; c + 10 < 400; c += 3, count += 1.0)
          for (int k = 0; k < 5; ++k)
            sums[k] += field(c, r) * 0.5 * (field(c + lags[k], r) + field(c, r + lags[k]));
    }
    for (int k = 0; k < 5; ++k) {
      CAPTURE(lags[k]);
      CHECK(std::abs(sums[k] / count - law.correlation(lags[k])) < 0.03 * law.correlation(0));
    }
  }

  TEST_CASE("random_field: the spectrum of the draws is the one of the formula") {
    const RandomField law{1.5, 0.3};
    cairn::Random random(cairn_test::seed());
    const int size = 96;
    for (const int mode : {1, 5, 9}) {
      CAPTURE(mode);
      // Periodogram at (mode, 0), averaged; a Hann window keeps leakage away. Its expectation is S(k) times
      // the energy of the window.
      cairn::RunningMoments power;
      double window_energy = 0;
      std::vector<double> hann(size);
      for (int i = 0; i < size; ++i)
        hann[static_cast<std::size_t>(i)] = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * (i + 0.5) / size);
      for (const double a : hann)
        for (const double b : hann) window_energy += a * a * b * b;
      const double k = 2 * std::numbers::pi * (2 * mode) / size;
      for (int draw = 0; draw < 150; ++draw) {
        const FieldGrid field = law.draw(size, size, {0, 0, 1, 1}, random);
        std::complex<double> sum = 0;
        for (int r = 0; r < size; ++r)
          for (int c = 0; c < size; ++c)
            sum += field(c, r) * hann[static_cast<std::size_t>(c)] * hann[static_cast<std::size_t>(r)] *
                   std::polar(1.0, -k * c);
        power.add(std::norm(sum) / window_energy);
      }
      // The window smears the Gaussian spectrum a little; the mean of 150 exponentials varies by 8 %.
      CHECK(power.mean() == doctest::Approx(law.spectrum(k)).epsilon(0.35).scale(0));
    }
  }

  TEST_CASE(
      "random_field: slopes have the variance of the formula, and R(0) is the integral of the spectrum") {
    const RandomField law{2.0, 0.1};
    cairn::Random random(cairn_test::seed());
    const cairn::BsplineMap map(law.draw(500, 500, {0, 0, 1, 1}, random));
    cairn::RunningMoments dx, dy;
    for (int r = 5; r < 495; r += 3)
      for (int c = 5; c < 495; c += 3) {
        const auto f = map.at(c + 0.3, r + 0.7);
        dx.add(f->dx);
        dy.add(f->dy);
      }
    CHECK(dx.variance() == doctest::Approx(law.slope_variance()).epsilon(0.1).scale(0));
    CHECK(dy.variance() == doctest::Approx(law.slope_variance()).epsilon(0.1).scale(0));
    double integral = 0;  // of S(k) 2 pi k dk / (2 pi)^2
    for (double k = 0.0005; k < 2.0; k += 0.001)
      integral += law.spectrum(k) * k * 0.001 / (2 * std::numbers::pi);
    CHECK(integral == doctest::Approx(law.correlation(0)).epsilon(1e-4).scale(0));
    double radius = 0;
    for (double d = -100; d < 100; d += 0.01) radius += law.correlation(d) / law.correlation(0) * 0.01;
    CHECK(radius == doctest::Approx(law.correlation_radius()).epsilon(1e-3).scale(0));
  }

  TEST_CASE("random_field: the same seed gives the same field") {
    const RandomField law{1.0, 0.4};
    cairn::Random one(9), two(9), three(10);
    const FieldGrid a = law.draw(20, 30, {0, 0, 1, 2}, one), b = law.draw(20, 30, {0, 0, 1, 2}, two);
    CHECK(a.values() == b.values());
    CHECK(a.values() != law.draw(20, 30, {0, 0, 1, 2}, three).values());
  }

  TEST_CASE("gaussian_blur: equals the weighted mean by definition, around voids as well") {
    cairn::Random random(11);
    FieldGrid grid(15, 12, {0, 0, 1.0, 0.5});
    for (double& value : grid.values()) value = random.normal();
    grid(7, 6) = grid(8, 6) = cairn::void_value;
    const FieldGrid blurred = cairn::gaussian_blur(grid, 1.2);
    CHECK(std::isnan(blurred(7, 6)));
    for (const auto& [c, r] : {std::pair(0, 0), std::pair(6, 6), std::pair(14, 11), std::pair(3, 9)}) {
      double sum = 0, weights = 0;
      for (int y = 0; y < 12; ++y)
        for (int x = 0; x < 15; ++x) {
          if (std::isnan(grid(x, y))) continue;
          const double dx = x - c, dy = 0.5 * (y - r);
          const double weight = std::exp(-0.5 * (dx * dx + dy * dy) / (1.2 * 1.2));
          sum += weight * grid(x, y);
          weights += weight;
        }
      CHECK(blurred(c, r) == doctest::Approx(sum / weights).epsilon(1e-9));
    }
    grid(7, 6) = grid(8, 6) = 0.0;
    CHECK(cairn::gaussian_blur(grid, 0.0).values() == grid.values());
    double sum = 0;  // as wide as may be: the mean, and no more work than the grid has nodes
    for (const double value : grid.values()) sum += value / static_cast<double>(grid.values().size());
    for (const double wide : {1e9, 1e300})
      CHECK(cairn::gaussian_blur(grid, wide)(3, 4) == doctest::Approx(sum).epsilon(1e-9));
  }

  TEST_CASE("random_field: a correlation that no memory holds is refused") {
    cairn::Random random(1);
    for (const double alpha : {1e-9, 1e-300}) {
      CAPTURE(alpha);
      CHECK_THROWS_AS(static_cast<void>(RandomField{1.0, alpha}.draw(5, 5, {}, random)), cairn::Error);
    }
  }
}
