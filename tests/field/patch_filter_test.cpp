// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/eval/consistency.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/patch_filter.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/field/random_field.hpp>

#include "field/patch_support.hpp"
#include "support/elimination.hpp"
#include "support/random.hpp"

using namespace cairn;
using namespace cairn_test;

TEST_SUITE("patch_filter") {
  TEST_CASE("patch_filter: iterating finds the minimum that one step misses") {
    Random random(5);
    const BsplineMap map = ground(5);
    const AlongTrackPlacement where{};
    Gaussian<Vector<5>> belief = prior(1.0);
    Vector<5> truth = usual_state;
    truth(0) += 2.0;
    const std::vector<double> z = frame(map, small, where, truth, 0.02, random);
    const PatchNoise noise(0.02 * 0.02);
    PatchScratch scratch;
    REQUIRE(PatchFilter{.iterations = 20, .tolerance = 1e-9}
                .update(belief, where, map, small, z, noise, scratch)
                .accepted());
    const auto cost = [&](const Vector<5>& x) {
      PatchSamples f;
      sample_patch(map, small, where.placement(x), f);
      double sum = 0;
      for (std::size_t i = 0; i < z.size(); ++i)
        sum += (z[i] - f.value[i]) * (z[i] - f.value[i]) / (0.02 * 0.02);
      const Gaussian<Vector<5>> start = prior(1.0);
      return sum + cairn_test::normalised_square(start.covariance, x - start.mean);
    };
    const double least = cost(belief.mean);
    for (int k = 0; k < 5; ++k)
      for (const double sign : {-1.0, 1.0}) {
        Vector<5> other = belief.mean;
        other(k) += sign * 0.3 * std::sqrt(belief.covariance(k, k));
        CHECK(cost(other) > least);
      }
  }

  TEST_CASE("patch_filter: errors have the covariance it gives, also against a map with correlated errors") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    const AlongTrackPlacement where{};
    const PatchShape shape{8, 9, 8};
    for (const double map_sigma : {0.0, 0.2}) {
      CAPTURE(map_sigma);
      const PatchNoise noise(0.1 * 0.1, shape, map_sigma * map_sigma, 0.1, 1.0, 1.0);
      ConsistencyTest aware(5), white(5);
      PatchScratch scratch;
      for (std::uint64_t run = 0; run < 200; ++run) {
        Random random(seed, run);
        const FieldGrid truth_grid = RandomField{1.0, 0.2}.draw(40, 32, {40, -16, 1, 1}, random);
        FieldGrid map_grid = truth_grid;
        const FieldGrid error = RandomField{map_sigma, 0.1}.draw(40, 32, {40, -16, 1, 1}, random);
        for (std::size_t i = 0; i < map_grid.values().size(); ++i) map_grid.values()[i] += error.values()[i];
        const BsplineMap map(map_grid), world(truth_grid);
        Gaussian<Vector<5>> belief = prior(0.3);
        const Gaussian<Vector<5>> start = belief;
        const Vector<5> truth = sample(belief, random);
        const std::vector<double> z = frame(world, shape, where, truth, 0.1, random);
        REQUIRE(PatchFilter{}.update(belief, where, map, shape, z, noise, scratch).accepted());
        aware.add(nees(belief, truth));
        belief = start;
        REQUIRE(
            PatchFilter{}.update(belief, where, map, shape, z, PatchNoise(0.1 * 0.1), scratch).accepted());
        white.add(nees(belief, truth));
      }
      CAPTURE(aware.mean());
      CHECK(aware.band(0.999).contains(aware.mean()));
      if (map_sigma > 0.0) CHECK(white.verdict() == Consistency::optimistic);
    }
  }

  TEST_CASE("patch_noise: weighing equals the inverse of the whole covariance") {
    Random random(8);
    const PatchShape shape{3, 4, 3};
    const double variance = 0.04, map_variance = 0.09, alpha = 0.25, along = 1.2, across = 0.8;
    const auto q = static_cast<Eigen::Index>(shape.size());
    Matrix<dynamic> C(q, q);
    for (Eigen::Index i = 0; i < q; ++i)
      for (Eigen::Index j = 0; j < q; ++j) {
        const auto si = static_cast<std::size_t>(i), sj = static_cast<std::size_t>(j);
        const double dx = along * (shape.a(si) - shape.a(sj)), dy = across * (shape.b(si) - shape.b(sj));
        C(i, j) = map_variance * std::exp(-alpha * alpha * (dx * dx + dy * dy)) + (i == j ? variance : 0.0);
      }
    Matrix<dynamic, 4> columns(q, 4);
    for (Eigen::Index i = 0; i < q; ++i)
      for (int k = 0; k < 4; ++k) columns(i, k) = random.normal();
    const PatchNoise noise(variance, shape, map_variance, alpha, along, across);
    const Matrix<4> expected = columns.transpose() * cairn_test::solved(C, columns);
    CHECK((noise.weigh<4>(columns) - expected).cwiseAbs().maxCoeff() < 1e-4 * expected.cwiseAbs().maxCoeff());
    // With missing samples the information may only be lower: expected - result is positive definite.
    const Matrix<4> lower = noise.weigh<4>(columns, false);
    CHECK(cairn_test::lower_root(Matrix<4>(expected - lower)).allFinite());
  }

  TEST_CASE("patch_filter: an unknown gain and bias change nothing but what they must") {
    Random random(6);
    const BsplineMap map = ground(6);
    const AlongTrackPlacement where{};
    Vector<5> truth = usual_state;
    truth(0) += 0.4;
    const std::vector<double> z = frame(map, small, where, truth, 0.02, random);
    std::vector<double> changed = z;
    for (double& value : changed) value = 1.3 * value - 5.0;
    const PatchNoise noise(0.02 * 0.02);
    PatchScratch scratch;
    const PatchFilter plain{.iterations = 10}, free{.iterations = 10, .free_bias = true, .free_gain = true};
    Gaussian<Vector<5>> known = prior(1.0), unknown = prior(1.0), same = prior(1.0);
    REQUIRE(plain.update(known, where, map, small, z, noise, scratch).accepted());
    REQUIRE(free.update(unknown, where, map, small, changed, PatchNoise(1.3 * 1.3 * 0.02 * 0.02), scratch)
                .accepted());
    REQUIRE(free.update(same, where, map, small, z, noise, scratch).accepted());
    CHECK(std::abs(unknown.mean(0) - truth(0)) < 5 * std::sqrt(unknown.covariance(0, 0)));
    CHECK(std::abs(unknown.mean(0) - truth(0)) < 0.1);
    CHECK(same.covariance(0, 0) >= known.covariance(0, 0));  // freedom costs information
    // Bias alone: the same estimate as a filter that carries the bias as a state with a wide prior.
    Gaussian<Vector<5>> bias = prior(1e-3);
    std::vector<double> shifted = z;
    for (double& value : shifted) value += 100.0;
    Gaussian<Vector<5>> unbiased = bias;
    REQUIRE(
        PatchFilter{.free_bias = true}.update(bias, where, map, small, shifted, noise, scratch).accepted());
    REQUIRE(PatchFilter{.free_bias = true}.update(unbiased, where, map, small, z, noise, scratch).accepted());
    CHECK(distance(bias, unbiased) < 1e-6);
  }

  TEST_CASE("patch_filter: bad frames leave the belief as it was, bit for bit") {
    Random random(7);
    const BsplineMap map = ground(7);
    const AlongTrackPlacement where{};
    const std::vector<double> z = frame(map, small, where, usual_state, 0.02, random);
    const PatchNoise noise(0.02 * 0.02);
    PatchScratch scratch;
    const auto verdict = [&](const BsplineMap& on, const std::vector<double>& seen, const PatchFilter& filter,
                             Gaussian<Vector<5>> belief) {
      const Gaussian<Vector<5>> before = belief;
      const PatchVerdict result = filter.update(belief, where, on, small, seen, noise, scratch).verdict;
      if (result != PatchVerdict::accepted) {
        CHECK((belief.mean == before.mean || !before.mean.allFinite()));
        CHECK((belief.covariance == before.covariance));
      }
      return result;
    };
    CHECK(verdict(map, z, {}, prior(1)) == PatchVerdict::accepted);
    CHECK(verdict(BsplineMap(FieldGrid(140, 80, {0, -40, 1, 1}, 3.0)), z, {}, prior(1)) ==
          PatchVerdict::flat);
    CHECK(verdict(BsplineMap(FieldGrid(140, 80, {0, -40, 1, 1}, 3.0)), z, {.free_gain = true}, prior(1)) ==
          PatchVerdict::flat);
    Gaussian<Vector<5>> far = prior(1);
    far.mean(0) = 1e5;
    CHECK(verdict(map, z, {}, far) == PatchVerdict::outside);
    far.mean(0) = 140.0;  // less than half of the frame is on the map
    CHECK(verdict(map, z, {}, far) == PatchVerdict::outside);
    std::vector<double> bad = z;
    bad[3] = std::nan("");
    CHECK(verdict(map, bad, {}, prior(1)) == PatchVerdict::not_finite);
    for (const double size : {1e200, 1e305, 1.7e308})  // finite, and their squares are not
      for (const bool free : {false, true}) {
        CAPTURE(size);
        bad = z;
        for (std::size_t i = 0; i < bad.size(); i += 3) bad[i] = size;
        CHECK(verdict(map, bad, {.free_bias = free}, prior(1)) == PatchVerdict::not_finite);
        FieldGrid steep(140, 80, {0, -40, 1, 1});
        for (double& value : steep.values()) value = 0.1 * size * random.uniform();
        const BsplineMap cliffs(std::move(steep));
        CHECK(verdict(cliffs, z, {.free_bias = free}, prior(1)) == PatchVerdict::not_finite);
        CHECK(!PatchFilter{}.information(usual_state, where, cliffs, small, noise, scratch));
      }
    Gaussian<Vector<5>> vague = prior(1);
    vague.covariance *= 1e307;  // what the frame says beside it is not finite
    CHECK(verdict(map, z, {}, vague) == PatchVerdict::not_finite);
    Gaussian<Vector<5>> lost = prior(1);
    lost.mean(2) = INFINITY;
    CHECK(verdict(map, z, {}, lost) == PatchVerdict::not_finite);
    Gaussian<Vector<5>> broken = prior(1);
    broken.covariance(1, 1) = -1;
    CHECK(verdict(map, z, {}, broken) == PatchVerdict::not_positive_definite);
    std::vector<double> noisy = z;
    for (double& value : noisy) value += random.normal();
    CHECK(verdict(map, noisy, {.gate = 2.0}, prior(1)) == PatchVerdict::gated);
  }

  TEST_CASE("patch_filter: correlated noise of another shape than the frame's is a broken promise") {
    const auto previous =
        set_violation_handler([](const Violation& violation) { throw std::logic_error(violation.sentence); });
    const BsplineMap map = ground(7);
    const std::vector<double> z(small.size(), 0.0);
    PatchScratch scratch;
    Gaussian<Vector<5>> belief = prior(1);
    const PatchNoise of_more(0.01, PatchShape{6, 7, 6}, 0.01, 0.15, 1.0, 1.0);
    CHECK_THROWS_AS(static_cast<void>(
                        PatchFilter{}.update(belief, AlongTrackPlacement{}, map, small, z, of_more, scratch)),
                    std::logic_error);
    set_violation_handler(previous);
  }

  TEST_CASE("patch_filter: a frame that partly leaves the map, or meets voids, uses what it has") {
    Random random(9);
    Random drawing(7);
    FieldGrid grid = RandomField{1.0, 0.15}.draw(140, 80, {0, -40, 1, 1}, drawing);
    const BsplineMap whole(grid);
    const AlongTrackPlacement where{};
    const std::vector<double> z = frame(whole, small, where, usual_state, 0.02, random);
    grid(60, 40) = cairn::void_value;
    const PatchNoise noise(0.02 * 0.02);
    PatchScratch scratch;
    Gaussian<Vector<5>> all = prior(1), holed = prior(1);
    REQUIRE(PatchFilter{}.update(all, where, whole, small, z, noise, scratch).accepted());
    const PatchUpdate result = PatchFilter{}.update(holed, where, BsplineMap(grid), small, z, noise, scratch);
    CHECK(result.accepted());
    CHECK(result.samples < small.size());
    CHECK(holed.covariance(0, 0) > all.covariance(0, 0));
    CHECK(std::abs(holed.mean(0) - usual_state(0)) < 5 * std::sqrt(holed.covariance(0, 0)));
  }
}
