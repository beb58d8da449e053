// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <numbers>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/vision/surf_orientation.hpp>

#include "support/random.hpp"
#include "vision/pictures.hpp"

namespace surf_orientation_test {
namespace {

using cairn::detail::CellGrid;
using cairn::detail::Directions;

/// The longest sum by trying every window with arctangents, in doubles.
cairn::detail::PlaneVector slow_longest_sector(const Directions& vectors) {
  cairn::detail::PlaneVector best;
  for (std::size_t begin = 0; begin < Directions::count; ++begin) {
    const double from = std::atan2(double{vectors.y[begin]}, double{vectors.x[begin]});
    cairn::detail::PlaneVector sum;
    for (std::size_t i = 0; i < Directions::count; ++i) {
      double angle = std::atan2(double{vectors.y[i]}, double{vectors.x[i]}) - from;
      if (angle < 0) angle += 2 * std::numbers::pi;
      if (angle >= std::numbers::pi / 3) continue;
      sum.x += vectors.x[i];
      sum.y += vectors.y[i];
    }
    if (std::hypot(sum.x, sum.y) > std::hypot(best.x, best.y)) best = sum;
  }
  return best;
}

}  // namespace

TEST_SUITE("surf_orientation") {
  TEST_CASE("longest_sector: agrees with trying every window by arctangents") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int trial = 0; trial < 200; ++trial) {
      Directions vectors;
      const double spread = random.uniform(0.05, 3.2), middle = random.uniform(-4, 4);
      for (std::size_t i = 0; i < Directions::count; ++i) {
        const double angle = middle + random.uniform(-spread, spread), length = random.uniform(0.1, 5);
        vectors.x[i] = static_cast<float>(length * std::cos(angle));
        vectors.y[i] = static_cast<float>(length * std::sin(angle));
      }
      vectors.find_orders();
      const cairn::detail::PlaneVector fast = cairn::detail::longest_sector(vectors);
      const cairn::detail::PlaneVector slow = slow_longest_sector(vectors);
      CHECK(std::hypot(fast.x, fast.y) == doctest::Approx(std::hypot(slow.x, slow.y)).epsilon(1e-5));
      CHECK(std::hypot(fast.x - slow.x, fast.y - slow.y) < 1e-3);
    }
  }

  TEST_CASE("longest_sector: all zeros, or all the same vector") {
    Directions vectors;
    vectors.x.fill(0);
    vectors.y.fill(0);
    vectors.find_orders();
    CHECK(cairn::detail::longest_sector(vectors).x == 0);
    vectors.x.fill(-2);
    vectors.y.fill(-1);
    vectors.find_orders();
    CHECK(cairn::detail::longest_sector(vectors).x == doctest::Approx(-2.0 * Directions::count));
    CHECK(cairn::detail::longest_sector(vectors).y == doctest::Approx(-1.0 * Directions::count));
  }

  TEST_CASE("dominant_angle: points up the slope of an even ramp, and is 0 on a plain") {
    for (double angle = -3.0; angle < 3.1; angle += 0.37) {
      CellGrid<35> cells;
      for (int j = 0; j < 35; ++j)
        for (int i = 0; i < 35; ++i)
          cells.row(j)[i] = static_cast<float>(i * std::cos(angle) + j * std::sin(angle));
      CHECK(cairn::detail::dominant_angle(cells) == doctest::Approx(angle).epsilon(1e-4));
    }
    CellGrid<35> plain;
    plain.cells.fill(17.0F);
    CHECK(cairn::detail::dominant_angle(plain) == 0);
  }
}

}  // namespace surf_orientation_test
