// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/vision/detail/surf_orientation.hpp>

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

/// The definition, by loops over cells in doubles: Haar responses of side 4 at distances of 1 inside the
/// radius 6, each weighted by a Gaussian of 2.5, and their sums over a sixth of the circle from each of them
/// on.
std::vector<cairn::detail::PlaneVector> sector_sums(const CellGrid<35>& grid) {
  const auto cell = [&](int column, int row) {  // centred on whole numbers about the middle
    return double{grid.row(row + 17)[column + 17]};
  };
  std::vector<cairn::detail::PlaneVector> responses;
  for (double y = -5.5; y < 6; ++y)
    for (double x = -5.5; x < 6; ++x) {
      if (x * x + y * y >= 36) continue;
      cairn::detail::PlaneVector response;
      for (int row = -10; row <= 10; ++row)
        for (int column = -10; column <= 10; ++column) {
          if (std::abs(row - y) > 2 || std::abs(column - x) > 2) continue;
          response.x += column > x ? cell(column, row) : -cell(column, row);
          response.y += row > y ? cell(column, row) : -cell(column, row);
        }
      const double weight = std::exp(-0.5 * (x * x + y * y) / (2.5 * 2.5));
      responses.push_back({weight * response.x, weight * response.y});
    }
  std::vector<cairn::detail::PlaneVector> sums;
  for (const auto& first : responses) {
    cairn::detail::PlaneVector sum;
    for (const auto& other : responses) {
      double turn = std::atan2(other.y, other.x) - std::atan2(first.y, first.x);
      if (turn < 0) turn += 2 * std::numbers::pi;
      if (turn >= std::numbers::pi / 3) continue;
      sum.x += other.x;
      sum.y += other.y;
    }
    sums.push_back(sum);
  }
  return sums;
}

/// How far an angle is from that of a longest sum; of sums equally long to 1e-5 the nearest counts.
double turned_from_longest(double angle, const std::vector<cairn::detail::PlaneVector>& sums) {
  double longest = 0;
  for (const auto& sum : sums) longest = std::max(longest, std::hypot(sum.x, sum.y));
  double least = 10;
  for (const auto& sum : sums)
    if (std::hypot(sum.x, sum.y) > (1 - 1e-5) * longest)
      least =
          std::min(least, std::abs(std::remainder(std::atan2(sum.y, sum.x) - angle, 2 * std::numbers::pi)));
  return least;
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

  TEST_CASE("dominant_angle: is that of the definition computed slowly in doubles, to 1e-4") {
    const std::uint64_t seed = cairn_test::seed(2);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int trial = 0; trial < 100; ++trial) {
      CellGrid<35> cells;
      const double slope = random.uniform(-3, 3), slant = random.uniform(-3, 3);
      for (int j = 0; j < 35; ++j)
        for (int i = 0; i < 35; ++i)
          cells.row(j)[i] = static_cast<float>(slope * i + slant * j + 20 * random.normal());
      CAPTURE(trial);
      const double angle = double{cairn::detail::dominant_angle(cells)};
      REQUIRE(turned_from_longest(angle, sector_sums(cells)) < 1e-4);
    }
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
