// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/field/correlation.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/random_field.hpp>

#include "support/elimination.hpp"
#include "support/random.hpp"

using cairn::BsplineMap;
using cairn::FieldGrid;
using cairn::Fix;
using cairn::FixVerdict;
using cairn::PatchPlacement;
using cairn::PatchSamples;
using cairn::PatchShape;
using cairn::detail::Plane;

namespace correlation_test {
namespace {

Plane noise_plane(int columns, int rows, cairn::Random& random) {
  Plane plane(columns, rows);
  for (double& value : plane.values) value = random.normal();
  return plane;
}

FieldGrid ground(std::uint64_t seed, int size = 220) {
  cairn::Random random(seed);
  return cairn::RandomField{1.0, 0.15}.draw(size, size, {0, 0, 1, 1}, random);
}

std::vector<double> frame(const BsplineMap& map, const PatchShape& shape, const PatchPlacement& at,
                          double noise, cairn::Random& random) {
  PatchSamples samples;
  cairn::sample_patch(map, shape, at, samples);
  for (double& value : samples.value) value += noise * random.normal();
  return samples.value;
}

}  // namespace

TEST_SUITE("correlation") {
  TEST_CASE("sliding_products: equals the sums by definition for every size") {
    cairn::Random random(cairn_test::seed());
    for (const auto& [w, h, sw, sh] :
         {std::array{7, 5, 3, 2}, std::array{16, 16, 16, 1}, std::array{31, 17, 5, 17},
          std::array{1, 1, 1, 1}, std::array{64, 3, 2, 3}, std::array{9, 60, 3, 4},
          std::array{2, 25, 1, 7}}) {
      const Plane big = noise_plane(w, h, random), small = noise_plane(sw, sh, random);
      const Plane result = cairn::detail::sliding_products(big, small);
      REQUIRE(result.columns == w - sw + 1);
      REQUIRE(result.rows == h - sh + 1);
      for (int t = 0; t < result.rows; ++t)
        for (int s = 0; s < result.columns; ++s) {
          double sum = 0;
          for (int r = 0; r < sh; ++r)
            for (int c = 0; c < sw; ++c) sum += big(s + c, t + r) * small(c, r);
          CHECK(std::abs(result(s, t) - sum) < 1e-11);
        }
    }
  }

  TEST_CASE("correlation: the surface equals its definition, with and without voids") {
    cairn::Random random(cairn_test::seed());
    for (const bool holed : {false, true}) {
      CAPTURE(holed);
      FieldGrid grid = ground(3, 40);
      if (holed)
        for (int k = 0; k < 3; ++k) grid(8 + 2 * k, 15) = cairn::void_value;
      const cairn::BilinearMap map(grid);
      const PatchShape shape{4, 5, 4};
      const PatchPlacement at = PatchPlacement::of(19.0, 20.0, 1.0, 1.0, 0.0);
      Plane patch = noise_plane(shape.along(), shape.across(), random);
      patch = cairn::detail::centred_patch(shape, patch.values);
      const auto window = cairn::detail::map_window(map, shape, at, 10, 10);
      const Plane surface = cairn::detail::correlation_surface(window, patch, 0.5);
      for (int t = 0; t < surface.rows; t += 3)
        for (int s = 0; s < surface.columns; s += 3) {
          double n = 0, sf = 0, sz = 0, sff = 0, szz = 0, sfz = 0;
          for (int r = 0; r < patch.rows; ++r)
            for (int c = 0; c < patch.columns; ++c) {
              szz += patch(c, r) * patch(c, r);  // of all samples: what the map does not know is unexplained
              const auto f = map.at(19.0 + s - 10 + c - 4, 20.0 - (t - 10 + r - 4));
              if (!f) continue;
              n += 1;
              sf += f->value;
              sz += patch(c, r);
              sff += f->value * f->value;
              sfz += f->value * patch(c, r);
            }
          const double expected = (sfz - sf * sz / n) / std::sqrt((sff - sf * sf / n) * szz);
          CHECK(std::abs(surface(s, t) - expected) < 1e-9);
        }
    }
  }

  TEST_CASE(
      "correlation: finds the place below the spacing of the samples, whatever gain, bias and heading") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const BsplineMap map(ground(seed));
    const PatchShape shape{10, 11, 10};
    for (int k = 0; k < 10; ++k) {
      const double heading = random.uniform(-3.0, 3.0);
      const cairn::Vector<2> place{110 + random.uniform(-30, 30), 110 + random.uniform(-30, 30)};
      const PatchPlacement truth = PatchPlacement::of(place(0), place(1), 1, 1, heading);
      std::vector<double> z = frame(map, shape, truth, 0.1, random);
      for (double& value : z) value = 3.0 * value - 40.0;
      const PatchPlacement guess = PatchPlacement::of(110, 110, 1, 1, heading);
      const Fix fix = cairn::correlation_search(map, shape, z, guess, {.radius = 45});
      CHECK(fix.verdict == FixVerdict::accepted);
      const cairn::Vector<2> error{fix.placement.x - truth.x, fix.placement.y - truth.y};
      CHECK(error.norm() < 6.0 * std::sqrt(fix.covariance.trace()));
      CHECK(error.norm() < 0.15);
      CHECK(fix.peak > 0.95);
    }
  }

  TEST_CASE("correlation: the fix's covariance is that of its errors, at low and at high noise") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    const PatchShape shape{10, 11, 10};
    for (const double noise : {0.01, 0.1, 0.5}) {
      CAPTURE(noise);
      cairn::Random random(seed);
      const int runs = 60;
      double nees = 0;
      for (int k = 0; k < runs; ++k) {
        const BsplineMap map(ground(100 * seed + static_cast<std::uint64_t>(k), 64));
        const cairn::Vector<2> place{32 + random.uniform(-4, 4), 32 + random.uniform(-4, 4)};
        const PatchPlacement truth = PatchPlacement::of(place(0), place(1), 1, 1, random.uniform(-0.1, 0.1));
        PatchPlacement guess = truth;
        guess.x = guess.y = 32;
        const Fix fix = cairn::correlation_search(map, shape, frame(map, shape, truth, noise, random), guess,
                                                  {.radius = 10});
        REQUIRE(fix.accepted());
        const cairn::Vector<2> e(fix.placement.x - truth.x, fix.placement.y - truth.y);
        nees += cairn_test::normalised_square(fix.covariance, e) / runs;
      }
      CAPTURE(nees);
      CHECK(cairn::chi_square_mean_band(2, runs, 0.9999).contains(nees));
    }
  }

  TEST_CASE(
      "correlation: errors of scale and heading are in the covariance when the search is told of them") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const PatchShape shape{10, 11, 10};
    const int runs = 60;
    double told = 0, untold = 0;
    for (int k = 0; k < runs; ++k) {
      const BsplineMap map(ground(100 * seed + static_cast<std::uint64_t>(k), 64));
      const double along = 1.0 + 0.02 * random.normal(), across = 1.0 + 0.02 * random.normal();
      const double heading = 0.02 * random.normal();
      const PatchPlacement truth = PatchPlacement::of(31.3, 33.8, along, across, heading);
      const std::vector<double> z = frame(map, shape, truth, 0.1, random);
      const PatchPlacement guess = PatchPlacement::of(32, 32, 1, 1, 0);
      const auto nees = [&](double scale_sigma, double heading_sigma) {
        const Fix fix = cairn::correlation_search(
            map, shape, z, guess, {.radius = 10, .scale_sigma = scale_sigma, .heading_sigma = heading_sigma});
        REQUIRE(fix.accepted());
        const cairn::Vector<2> e(fix.placement.x - truth.x, fix.placement.y - truth.y);
        return cairn_test::normalised_square(fix.covariance, e) / runs;
      };
      told += nees(0.02, 0.02);
      untold += nees(0.0, 0.0);
    }
    CAPTURE(told);
    CAPTURE(untold);
    CHECK(cairn::chi_square_mean_band(2, runs, 0.9999).contains(told));
    CHECK(untold > 1.5 * told);
  }

  TEST_CASE("correlation: a map with smooth errors makes the covariance larger") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const PatchShape shape{10, 11, 10};
    const int runs = 40;
    double nees = 0, white = 0;
    for (int k = 0; k < runs; ++k) {
      const FieldGrid world = ground(100 * seed + static_cast<std::uint64_t>(k), 64);
      FieldGrid known = world;
      const FieldGrid error = cairn::RandomField{0.15, 0.3}.draw(64, 64, {0, 0, 1, 1}, random);
      for (std::size_t i = 0; i < known.values().size(); ++i) known.values()[i] += error.values()[i];
      const PatchPlacement truth = PatchPlacement::of(31.3, 33.8, 1, 1, 0);
      const std::vector<double> z = frame(BsplineMap(world), shape, truth, 0.1, random);
      const Fix fix =
          cairn::correlation_search(BsplineMap(known), shape, z, PatchPlacement::of(32, 32, 1, 1, 0),
                                    {.radius = 16, .white_below = 0.8});
      REQUIRE(fix.accepted());
      CHECK(fix.residual_correlation > 0.3);
      const cairn::Vector<2> e(fix.placement.x - truth.x, fix.placement.y - truth.y);
      const double normalised = cairn_test::normalised_square(fix.covariance, e) / runs;
      const double rho = fix.residual_correlation;
      nees += normalised;
      white += normalised * std::pow((1 + rho) / (1 - rho), 2);  // about what independent samples would claim
    }
    CAPTURE(nees);
    CAPTURE(white);
    CHECK(nees < 8.0);  // 2 is right; correlations that reach further than a neighbour count for too little
    CHECK(white > 20.0);
  }

  TEST_CASE("correlation: a bank of headings and scales finds the right one") {
    cairn::Random random(3);
    const BsplineMap map(ground(5));
    const PatchShape shape{10, 11, 10};
    const PatchPlacement truth = PatchPlacement::of(105, 98, 1.1, 1.1, 0.3);
    const Fix fix = cairn::correlation_search(
        map, shape, frame(map, shape, truth, 0.05, random), PatchPlacement::of(110, 110, 1, 1, 0.0),
        {.radius = 30, .headings = {-0.3, 0.0, 0.3}, .scales = {0.9, 1.0, 1.1}});
    CHECK(fix.accepted());
    CHECK(fix.heading == 2);
    CHECK(fix.scale == 2);
    CHECK(std::hypot(fix.placement.x - 105, fix.placement.y - 98) < 0.1);
  }

  TEST_CASE("correlation: nothing is accepted that should not be") {
    cairn::Random random(4);
    const FieldGrid grid = ground(6);
    const BsplineMap map(grid);
    const PatchShape shape{10, 11, 10};
    const PatchPlacement guess = PatchPlacement::of(110, 110, 1, 1, 0);
    const std::vector<double> seen = frame(map, shape, guess, 0.1, random);
    const auto verdict = [&](const BsplineMap& where, const std::vector<double>& z,
                             const PatchPlacement& at) {
      return cairn::correlation_search(where, shape, z, at, {.radius = 30}).verdict;
    };
    CHECK(verdict(map, seen, guess) == FixVerdict::accepted);
    CHECK(verdict(map, std::vector<double>(shape.size(), 7.25), guess) == FixVerdict::flat_patch);
    CHECK(verdict(BsplineMap(FieldGrid(220, 220, {}, 7.25)), seen, guess) == FixVerdict::flat_map);
    CHECK(verdict(map, seen, PatchPlacement::of(1e6, 0, 1, 1, 0)) == FixVerdict::flat_map);   // off the map
    CHECK(verdict(map, seen, PatchPlacement::of(75, 110, 1, 1, 0)) != FixVerdict::accepted);  // out of reach
    std::vector<double> noise(shape.size());
    for (double& value : noise) value = random.normal();
    CHECK(verdict(map, noise, guess) == FixVerdict::weak);
    FieldGrid striped(220, 220);
    for (int r = 0; r < 220; ++r)
      for (int c = 0; c < 220; ++c) striped(c, r) = std::sin(0.4 * c) + std::sin(0.3 * r);
    const BsplineMap periodic(striped);
    CHECK(verdict(periodic, frame(periodic, shape, guess, 0.1, random), guess) == FixVerdict::ambiguous);
  }

  TEST_CASE("correlation: ground that repeats itself between the samples is ambiguous, seen sharply too") {
    cairn::Random random(cairn_test::seed());
    CAPTURE(cairn_test::seed());
    // Hills every 20.94 and 23.27 nodes: repeats lie up to half a node beside the lattice, which is a larger
    // difference than the noise, and the scale is not quite what is believed.
    FieldGrid hills(260, 260);
    for (int r = 0; r < 260; ++r)
      for (int c = 0; c < 260; ++c) hills(c, r) = std::sin(0.3 * c) + std::sin(0.27 * r);
    const BsplineMap map(hills);
    const PatchShape shape{12, 13, 12};
    int accepted = 0;
    for (int k = 0; k < 12; ++k) {
      const double scale = 1 + 0.005 * random.normal();
      const auto at =
          PatchPlacement::of(130 + random.uniform(-5, 5), 130 + random.uniform(-5, 5), scale, scale, 0);
      const PatchPlacement guess = PatchPlacement::of(130, 130, 1, 1, 0);
      const std::vector<double> z = frame(map, shape, at, 0.02, random);
      const Fix fix = cairn::correlation_search(map, shape, z, guess, {.radius = 40, .scale_sigma = 0.005});
      accepted += fix.accepted() ? 1 : 0;
      CHECK(fix.second > 0.9995);  // refined, as the best place is
    }
    CHECK(accepted == 0);
  }
}

}  // namespace correlation_test
