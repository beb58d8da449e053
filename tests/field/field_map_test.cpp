// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/field/field_map.hpp>
#include <cairn/field/random_field.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

using cairn::BilinearMap;
using cairn::BsplineMap;
using cairn::FieldGrid;
using cairn::GridFrame;
using cairn_test::message_of;

namespace field_map_test {
namespace {

const GridFrame frame{-3.0, 7.0, 0.5, 2.0};

template <class F>
FieldGrid grid_of(int columns, int rows, F&& f) {
  FieldGrid grid(columns, rows, frame);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) grid(c, r) = f(grid.x(c), grid.y(r));
  return grid;
}

FieldGrid noise_grid(int columns, int rows, cairn::Random& random) {
  return grid_of(columns, rows, [&](double, double) { return random.normal(); });
}

}  // namespace

TEST_SUITE("field_map") {
  TEST_CASE_TEMPLATE("field_map: passes through every node, rim included", Map, BilinearMap, BsplineMap) {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const int size : {2, 3, 5, 40}) {
      const FieldGrid grid = noise_grid(size, size + 1, random);
      const Map map(grid);
      for (int r = 0; r < grid.rows(); ++r)
        for (int c = 0; c < grid.columns(); ++c) {
          const auto f = map.at(grid.x(c), grid.y(r));
          REQUIRE(f.has_value());
          CHECK(std::abs(f->value - grid(c, r)) < 1e-12);
        }
    }
  }

  TEST_CASE_TEMPLATE("field_map: the gradient is that of the interpolant", Map, BilinearMap, BsplineMap) {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const FieldGrid grid = noise_grid(12, 9, random);
    const Map map(grid);
    const double h = 1e-6;
    for (int k = 0; k < 300; ++k) {
      const int c = static_cast<int>(random.below(11)), r = static_cast<int>(random.below(8));
      const double x = grid.x(c + random.uniform(0.01, 0.99)), y = grid.y(r + random.uniform(0.01, 0.99));
      const auto f = map.at(x, y);
      CHECK(f->dx ==
            doctest::Approx((map.at(x + h, y)->value - map.at(x - h, y)->value) / (2 * h)).epsilon(1e-6));
      CHECK(f->dy ==
            doctest::Approx((map.at(x, y + h)->value - map.at(x, y - h)->value) / (2 * h)).epsilon(1e-6));
    }
  }

  TEST_CASE("field_map: a plane is exact, value and gradient") {
    const auto plane = [](double x, double y) { return 3.0 - 2.0 * x + 0.25 * y; };
    const FieldGrid grid = grid_of(40, 40, plane);
    const BilinearMap bilinear(grid);
    const BsplineMap spline(grid);
    const double x = 4.321, y = 31.234;  // far from the rim, where the mirrored spline must bend
    for (const auto& f : {bilinear.at(x, y), spline.at(x, y)}) {
      CHECK(f->value == doctest::Approx(plane(x, y)).epsilon(1e-7));
      CHECK(f->dx == doctest::Approx(-2.0).epsilon(1e-6));
      CHECK(f->dy == doctest::Approx(0.25).epsilon(1e-6));
    }
  }

  TEST_CASE("field_map: the spline and its gradient are continuous across cells") {
    cairn::Random random(5);
    const FieldGrid grid = noise_grid(10, 10, random);
    const BsplineMap map(grid);
    for (int c = 1; c < 9; ++c) {
      const double x = grid.x(c), y = grid.y(4.3), h = 1e-9;
      CHECK(std::abs(map.at(x - h, y)->value - map.at(x + h, y)->value) < 1e-7);
      CHECK(std::abs(map.at(x - h, y)->dx - map.at(x + h, y)->dx) < 1e-6);
    }
  }

  TEST_CASE("field_map: the spline is a hundred times closer to a smooth field than straight lines") {
    const auto wave = [](double x, double y) { return std::sin(1.3 * x) * std::cos(0.3 * y); };
    const FieldGrid grid = grid_of(60, 60, wave);
    const BilinearMap bilinear(grid);
    const BsplineMap spline(grid);
    double worst_bilinear = 0, worst_spline = 0;
    cairn::Random random(2);
    for (int k = 0; k < 500; ++k) {
      const double x = grid.x(random.uniform(10, 49)), y = grid.y(random.uniform(10, 49));
      worst_bilinear = std::max(worst_bilinear, std::abs(bilinear.at(x, y)->value - wave(x, y)));
      worst_spline = std::max(worst_spline, std::abs(spline.at(x, y)->value - wave(x, y)));
    }
    CHECK(worst_spline * 50 < worst_bilinear);
  }

  TEST_CASE_TEMPLATE("field_map: outside is an answer", Map, BilinearMap, BsplineMap) {
    cairn::Random random(3);
    const FieldGrid grid = noise_grid(6, 5, random);
    const Map map(grid);
    const double inf = std::numeric_limits<double>::infinity(), nan = std::nan("");
    CHECK(map.at(grid.x(0), grid.y(0)).has_value());
    CHECK(map.at(grid.x_end(), grid.y_end()).has_value());
    for (const double x : {grid.x(0) - 1e-9, grid.x_end() + 1e-9, 1e300, -1e300, inf, -inf, nan})
      CHECK_FALSE(map.at(x, grid.y(2)).has_value());
    for (const double y : {grid.y(0) - 1e-9, grid.y_end() + 1e-9, inf, nan})
      CHECK_FALSE(map.at(grid.x(2), y).has_value());
  }

  TEST_CASE_TEMPLATE("field_map: a void answers with nothing and does not spoil what is far from it", Map,
                     BilinearMap, BsplineMap) {
    cairn::Random random(4);
    FieldGrid grid = noise_grid(40, 40, random);
    const Map whole(grid);
    grid(20, 20) = cairn::void_value;
    const Map holed(grid);
    CHECK_FALSE(holed.at(grid.x(20), grid.y(20)).has_value());
    CHECK_FALSE(holed.at(grid.x(19.5), grid.y(20.5)).has_value());
    CHECK(holed.at(grid.x(22.5), grid.y(20)).has_value());
    CHECK(std::abs(holed.at(grid.x(36.5), grid.y(20.5))->value -
                   whole.at(grid.x(36.5), grid.y(20.5))->value) < 1e-7);
    int answered = 0;
    for (int k = 0; k < 2000; ++k) {
      const auto f = holed.at(grid.x(random.uniform(0, 39)), grid.y(random.uniform(0, 39)));
      if (!f) continue;
      ++answered;
      CHECK(std::isfinite(f->value + f->dx + f->dy));
    }
    CHECK(answered > 1900);
  }

  TEST_CASE("field_map: bad grids are refused") {
    CHECK(message_of([] { FieldGrid(1, 5); }).find("at least 2 columns") != std::string::npos);
    CHECK(message_of([] { FieldGrid(2, 2, {}, {1, 2, 3}); }).find("expected 4 values, found 3") !=
          std::string::npos);
    CHECK(message_of([] { FieldGrid(2, 2, {}, {1, 2, INFINITY, 4}); }).find("value 2 is infinite") !=
          std::string::npos);
    CHECK(message_of([] { FieldGrid(2, 2, {0, 0, -1, 1}); }).find("spacings above zero") !=
          std::string::npos);
    CHECK(message_of([] { FieldGrid(2, 2, {0, std::nan(""), 1, 1}); }).find("finite origin") !=
          std::string::npos);
    CHECK(message_of([] { BsplineMap(FieldGrid(3, 3, {}, cairn::void_value)); }).find("every node is void") !=
          std::string::npos);
  }
}

}  // namespace field_map_test
