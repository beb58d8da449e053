// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/grid/height_cell.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace height_cell_test {
namespace {

using namespace cairn;
using Visits = std::vector<std::vector<double>>;

HeightSums sums_of(const std::vector<double>& heights) {
  HeightSums sums;
  for (const double h : heights) sums.add(h);
  return sums;
}

double normal_density(double x, double mean, double variance) {
  return std::exp(-0.5 * (x - mean) * (x - mean) / variance) / std::sqrt(2 * std::numbers::pi * variance);
}

/// The integral over the mean of f(m), an even grid about where it is large.
template <class F>
double over_mean(double middle, double width, const F& f) {
  constexpr int half = 60;
  double sum = 0;
  for (int k = -half; k <= half; ++k) sum += f(middle + width * k / 6.0);
  return sum * width / 6.0;
}

/// The integral over tau with its Gamma(nu/2, nu sigma^2/2) density, by t = log tau: f(tau) is what is
/// averaged. The trapezium rule: exact to rounding for functions that vanish so fast at both ends.
template <class F>
double over_tau(const HeightPrior& prior, const F& f) {
  const double shape = 0.5 * prior.nu, rate = 0.5 * prior.nu * prior.sigma * prior.sigma;
  constexpr double step = 0.02;
  double sum = 0;
  for (double t = -100; t < 60; t += step) {
    const double tau = std::exp(t);
    const double density = std::exp(shape * std::log(rate * tau) - rate * tau - std::lgamma(shape));
    if (density > 0) sum += density * f(tau);
  }
  return sum * step;
}

/// The heights of all visits with a mean of each visit's own that may be anything.
double forgotten_means(const HeightPrior& prior, const Visits& visits) {
  return over_tau(prior, [&](double tau) {
    double product = 1;
    for (const auto& heights : visits) {
      double middle = 0;
      for (const double h : heights) middle += h / static_cast<double>(heights.size());
      product *= over_mean(middle, 1 / std::sqrt(tau * static_cast<double>(heights.size())), [&](double m) {
        double all = 1;
        for (const double h : heights) all *= normal_density(h, m, 1 / tau);
        return all;
      });
    }
    return product;
  });
}

/// The heights of all visits about one mean.
double kept_mean(const HeightPrior& prior, const Visits& visits) {
  double count = prior.kappa, middle = prior.kappa * prior.mean;
  for (const auto& heights : visits)
    for (const double h : heights) {
      count += 1;
      middle += h;
    }
  return over_tau(prior, [&](double tau) {
    return over_mean(middle / count, 1 / std::sqrt(tau * count), [&](double m) {
      double all = normal_density(m, prior.mean, 1 / (prior.kappa * tau));
      for (const auto& heights : visits)
        for (const double h : heights) all *= normal_density(h, m, 1 / tau);
      return all;
    });
  });
}

/// The evidence of visits, one after the other.
template <class Cell>
double log_evidence_of(const HeightPrior& prior, const Visits& visits, Cell* last = nullptr) {
  const HeightModel model(prior);
  Cell cell;
  double sum = 0;
  for (const auto& heights : visits) {
    sum += cell.log_evidence(sums_of(heights), model);
    cell.insert(sums_of(heights));
  }
  if (last != nullptr) *last = cell;
  return sum;
}

Visits drawn_visits(Random& random) {
  Visits visits(1 + random.below(3));
  for (auto& heights : visits) {
    heights.resize(1 + random.below(4));
    for (double& h : heights) h = random.normal(0.1, 0.2);
  }
  return visits;
}

}  // namespace

TEST_SUITE("grid/height_cell") {
  TEST_CASE("height_cell: the evidence is the integral over mean and spread") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 20; ++trial) {
      const HeightPrior prior{random.uniform(1, 4), random.uniform(0.05, 0.3), random.uniform(0.01, 1),
                              random.normal()};
      const Visits visits = drawn_visits(random);
      CAPTURE(trial);
      CHECK(std::exp(log_evidence_of<VarianceCell>(prior, visits)) ==
            doctest::Approx(forgotten_means(prior, visits)).epsilon(1e-9));
      CHECK(std::exp(log_evidence_of<HeightCell>(prior, visits)) ==
            doctest::Approx(kept_mean(prior, visits)).epsilon(1e-9));
    }
  }

  TEST_CASE("height_cell: the order of visits changes neither evidence nor belief") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    Random random(seed);
    const HeightPrior prior{1.5, 0.08, 0.002, 0.3};
    for (int trial = 0; trial < 50; ++trial) {
      Visits visits = drawn_visits(random), turned = visits;
      std::ranges::reverse(turned);
      VarianceCell a, b;
      CHECK(log_evidence_of(prior, visits, &a) ==
            doctest::Approx(log_evidence_of(prior, turned, &b)).epsilon(1e-9));
      CHECK(a.squares == doctest::Approx(b.squares).epsilon(1e-12));
      HeightCell c, d;
      CHECK(log_evidence_of(prior, visits, &c) ==
            doctest::Approx(log_evidence_of(prior, turned, &d)).epsilon(1e-9));
      CHECK(c.mean(prior) == doctest::Approx(d.mean(prior)).epsilon(1e-12));
      CHECK(c.spread(prior).squares == doctest::Approx(d.spread(prior).squares).epsilon(1e-9));
    }
  }

  TEST_CASE(
      "height_cell: n visits of one height are one of n where the mean is kept, and are not where it is "
      "not") {
    const HeightPrior prior{2, 0.05, 1e-3, 0};
    const std::vector<double> heights{0.12, 0.2, 0.15, 0.05, 0.11};
    Visits each;
    for (const double h : heights) each.push_back({h});
    CHECK(log_evidence_of<HeightCell>(prior, each) ==
          doctest::Approx(log_evidence_of<HeightCell>(prior, {heights})).epsilon(1e-11));
    CHECK(log_evidence_of<VarianceCell>(prior, each) == 0);
    CHECK(std::abs(log_evidence_of<VarianceCell>(prior, {heights})) > 1);
  }

  TEST_CASE("height_cell: counts of wholes, of fractions and beyond the table go on from each other") {
    const HeightModel model({1.5, 0.1, 0.01, 0});
    for (const double n : {1.0, 7.0, 4094.0, 4095.0, 5000.0}) {
      const auto evidence = [&](double seen) { return model.log_spread_evidence(seen, 3, 2.0, 0.1); };
      const double here = evidence(n), beside = evidence(n + 1e-7);
      CHECK(here == doctest::Approx(beside).epsilon(1e-6));
    }
  }

  TEST_CASE("height_cell: four visits of which each height is worth a quarter are one visit") {
    HeightSums visit;
    for (const double h : {0.3, 0.5, 0.35, 0.42}) visit.add(h);
    HeightCell whole, shared;
    VarianceCell whole_variance, shared_variance;
    whole.insert(visit);
    whole_variance.insert(visit);
    for (int k = 0; k < 4; ++k) {
      shared.insert(visit, 0.25);
      shared_variance.insert(visit, 0.25);
    }
    CHECK(shared.seen.count == whole.seen.count);
    CHECK(shared.seen.mean == doctest::Approx(whole.seen.mean).epsilon(1e-14));
    CHECK(shared.seen.squares == doctest::Approx(whole.seen.squares).epsilon(1e-13));
    CHECK(shared_variance.nu == whole_variance.nu);
    CHECK(shared_variance.squares == doctest::Approx(whole_variance.squares).epsilon(1e-14));
  }

  TEST_CASE("height_cell: sums put together are the sums of all, and of nothing nothing") {
    Random random(3);
    std::vector<double> all;
    HeightSums together;
    for (int part = 0; part < 5; ++part) {
      HeightSums some;
      for (int k = 0; k < 3 * part; ++k) {
        all.push_back(random.normal(1e3, 0.1));
        some.add(all.back());
      }
      together.add(some);
    }
    double mean = 0, squares = 0;
    for (const double h : all) mean += h / static_cast<double>(all.size());
    for (const double h : all) squares += (h - mean) * (h - mean);
    CHECK(together.count == static_cast<double>(all.size()));
    CHECK(together.mean == doctest::Approx(mean).epsilon(1e-14));
    CHECK(together.squares == doctest::Approx(squares).epsilon(1e-8));
    CHECK(HeightCell{}.log_evidence(HeightSums{}, HeightModel()) == 0);
    CHECK(VarianceCell{}.log_evidence(HeightSums{}, HeightModel()) == 0);
  }

  TEST_CASE("height_cell: intervals of sigma hold the sigma that was drawn as often as they say") {
    const std::uint64_t seed = cairn_test::seed(4);
    CAPTURE(seed);
    Random random(seed);
    const HeightPrior prior{3, 0.1, 0.01, 0};
    constexpr int trials = 4000;
    int inside = 0;
    double sigma_error = 0;
    for (int trial = 0; trial < trials; ++trial) {
      double chi_square = 0;  // of 3 degrees of freedom: tau is drawn from the prior
      for (int k = 0; k < 3; ++k) {
        const double z = random.normal();
        chi_square += z * z;
      }
      const double sigma = std::sqrt(prior.squares() / chi_square);
      const double m = random.normal(0, sigma / std::sqrt(prior.kappa));
      HeightCell cell;
      HeightSums visit;
      for (int k = 0; k < 6; ++k) visit.add(random.normal(m, sigma));
      cell.insert(visit);
      const HeightSpread spread = cell.spread(prior);
      inside += spread.sigma_quantile(0.05) < sigma && sigma < spread.sigma_quantile(0.95);
      sigma_error += (sigma - spread.expected_sigma()) / spread.expected_sigma() / trials;
    }
    // 90 % of 4000 with four standard deviations; the mean of sigma given the heights is what it says.
    CHECK(std::abs(inside - 0.9 * trials) < 4 * std::sqrt(0.09 * trials));
    CHECK(std::abs(sigma_error) < 4 * 0.3 / std::sqrt(trials));
  }

  TEST_CASE("height_cell: priors that are none say so") {
    CHECK(HeightPrior{}.valid());
    CHECK_FALSE(HeightPrior{.nu = 0}.valid());
    CHECK_FALSE(HeightPrior{.sigma = -1}.valid());
    CHECK_FALSE(HeightPrior{.sigma = NAN}.valid());
    CHECK_FALSE(HeightPrior{.kappa = 0}.valid());
    CHECK_FALSE(HeightPrior{.mean = INFINITY}.valid());
    CHECK(cairn_test::message_of([] { HeightModel({.sigma = 0}); }).find("above zero") != std::string::npos);
  }
}

}  // namespace height_cell_test
