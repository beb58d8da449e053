// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>

TEST_SUITE("random") {
  TEST_CASE("random: the same seed replays, another seed or stream does not") {
    cairn::Random a(42);
    cairn::Random b(42);
    cairn::Random c(43);
    cairn::Random d(42, 1);
    int same_as_c = 0;
    int same_as_d = 0;
    for (int i = 0; i < 1000; ++i) {
      const auto draw = a();
      CHECK(draw == b());
      same_as_c += draw == c() ? 1 : 0;
      same_as_d += draw == d() ? 1 : 0;
    }
    CHECK(same_as_c == 0);
    CHECK(same_as_d == 0);
  }

  TEST_CASE("random: below() is uniform within the chi-square band") {
    cairn::Random random(5);
    std::array<int, 7> counts{};
    constexpr int draws = 70000;
    for (int i = 0; i < draws; ++i) ++counts[random.below(7)];
    double chi_square = 0;
    for (const int count : counts)
      chi_square += (count - draws / 7.0) * (count - draws / 7.0) / (draws / 7.0);
    CHECK(chi_square < cairn::chi_square_quantile(0.9999, 6));
    CHECK(random.below(0) == 0);
    CHECK(random.below(1) == 0);
  }

  TEST_CASE("random: below() has no bias where the draws are not a multiple of the count") {
    // Remainders of 2^64 draws by 3 * 2^62 would fall into the first third half of the time.
    cairn::Random random(7);
    int first_third = 0;
    constexpr int draws = 9000;
    for (int i = 0; i < draws; ++i) first_third += random.below(3ULL << 62U) < 1ULL << 62U ? 1 : 0;
    CHECK(std::abs(first_third - draws / 3) < 4 * std::sqrt(draws * 2.0 / 9.0));
  }

  TEST_CASE("random: normal() has the moments of a normal") {
    cairn::Random random(6);
    cairn::RunningMoments moments;
    double fourth = 0;
    constexpr int draws = 200000;
    for (int i = 0; i < draws; ++i) {
      const double draw = random.normal(2.0, 3.0);
      moments.add(draw);
      fourth += std::pow((draw - 2.0) / 3.0, 4);
    }
    CHECK(moments.mean() == doctest::Approx(2.0).epsilon(0.02));
    CHECK(moments.standard_deviation() == doctest::Approx(3.0).epsilon(0.01));
    CHECK(fourth / draws == doctest::Approx(3.0).epsilon(0.03));
  }
}
