// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/scan/independence.hpp>

#include "support/random.hpp"

namespace independence_test {
namespace {

using namespace cairn;

/// Residuals of which each keeps a share of the one before.
std::vector<std::vector<double>> chains(Random& random, double share, std::size_t scans, std::size_t beams) {
  std::vector<std::vector<double>> all(scans);
  for (auto& scan : all) {
    double at = random.normal();
    for (std::size_t i = 0; i < beams; ++i) {
      scan.push_back(0.03 * at);
      at = share * at + std::sqrt(1 - share * share) * random.normal();
    }
  }
  return all;
}

}  // namespace

TEST_SUITE("scan/independence") {
  TEST_CASE("independence: of a chain of correlation r it is (1 - r) / (1 + r), whatever the noise") {
    const std::uint64_t seed = cairn_test::seed(5);
    CAPTURE(seed);
    Random random(seed);
    for (const double r : {0.0, 0.3, 0.6, 0.8}) {
      CAPTURE(r);
      const auto found = independence_of(chains(random, r, 200, 181));
      REQUIRE(found);
      CHECK(*found == doctest::Approx((1 - r) / (1 + r)).epsilon(0.15).scale(0));
    }
  }

  TEST_CASE("independence: beams that are all the same are worth one, and nothing is said of nothing") {
    const std::vector<std::vector<double>> same(3, std::vector<double>(50, 0.02));
    const auto found = independence_of(same);
    REQUIRE(found);
    CHECK(*found < 2.0 / 50);
    using Scans = std::vector<std::vector<double>>;
    CHECK_FALSE(independence_of(Scans{}));
    CHECK_FALSE(independence_of(Scans{{0.1}, {0.2}}));
    CHECK_FALSE(independence_of(Scans{{0, 0, 0}}));
    CHECK_FALSE(independence_of(Scans{{0.1, std::numeric_limits<double>::quiet_NaN()}}));
  }
}

}  // namespace independence_test
