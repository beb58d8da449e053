// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/principal_axes.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

TEST_SUITE("principal_axes") {
  TEST_CASE("principal_axes: distances stay, coordinates are uncorrelated, and the first vary most") {
    const std::uint64_t seed = cairn_test::seed(8);
    CAPTURE(seed);
    cairn::Random random(seed);
    constexpr std::size_t dim = 12;
    constexpr std::size_t count = 3000;
    std::vector<float> rows;
    for (std::size_t i = 0; i < count; ++i) {
      const double common = random.normal(0, 3);
      for (std::size_t a = 0; a < dim; ++a)
        rows.push_back(static_cast<float>(5 + common * static_cast<double>(a % 3) +
                                          random.normal(0, 0.1 + 0.2 * static_cast<double>(a))));
    }
    const cairn::PrincipalAxes axes(cairn::Rows<float>(rows, dim));
    std::vector<float> turned(rows.size());
    for (std::size_t i = 0; i < count; ++i) axes.turn(&rows[i * dim], &turned[i * dim]);

    const auto squared = [&](const std::vector<float>& of, std::size_t i, std::size_t j) {
      double sum = 0;
      for (std::size_t a = 0; a < dim; ++a)
        sum += std::pow(double{of[i * dim + a]} - double{of[j * dim + a]}, 2);
      return sum;
    };
    for (std::size_t i = 1; i < 200; ++i)
      CHECK(squared(turned, 0, i) == doctest::Approx(squared(rows, 0, i)).epsilon(1e-4));

    std::array<double, dim> mean{};
    for (std::size_t i = 0; i < turned.size(); ++i) mean[i % dim] += double{turned[i]} / count;
    const auto covariance = [&](std::size_t a, std::size_t b) {
      double sum = 0;
      for (std::size_t i = 0; i < count; ++i)
        sum += (double{turned[i * dim + a]} - mean[a]) * (double{turned[i * dim + b]} - mean[b]);
      return sum / count;
    };
    for (std::size_t a = 0; a + 1 < dim; ++a) {
      CHECK(covariance(a, a) >= covariance(a + 1, a + 1) * 0.999);
      for (std::size_t b = a + 1; b < dim; ++b)
        CHECK(std::abs(covariance(a, b)) < 1e-3 * std::sqrt(covariance(a, a) * covariance(b, b)));
    }
  }

  TEST_CASE("principal_axes: turns every number of points of any dimension, and writes no further") {
    cairn::Random random(cairn_test::seed(9));
    for (const unsigned dim : {1U, 2U, 15U, 16U, 17U, 48U, 63U, 64U, 65U, 80U, 127U, 128U, 130U}) {
      CAPTURE(dim);
      std::vector<float> rows(3 * dim);
      for (float& number : rows) number = static_cast<float>(random.normal());
      const cairn::PrincipalAxes axes(cairn::Rows<float>(rows, dim));
      std::vector<double> turned;
      for (std::size_t i = 0; i < 3; ++i) {
        std::vector<float> row(dim + 1, 77.0F);
        axes.turn(&rows[i * dim], row.data());
        CHECK(row[dim] == 77.0F);
        turned.insert(turned.end(), row.begin(), row.end() - 1);
      }
      const auto product = [dim](const auto& of, std::size_t i, std::size_t j) {
        double sum = 0;
        for (std::size_t a = 0; a < dim; ++a) sum += double{of[i * dim + a]} * double{of[j * dim + a]};
        return sum;
      };
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
          CHECK(product(turned, i, j) ==
                doctest::Approx(product(rows, i, j)).epsilon(1e-5).scale(static_cast<double>(dim)));
    }
  }

  TEST_CASE("principal_axes: one point, equal points and bad points") {
    const std::vector<float> equal(40, 2.0F);
    const cairn::PrincipalAxes axes(cairn::Rows<float>(equal, 4));
    const std::array point{1.0F, 2.0F, 3.0F, 4.0F};
    std::array<float, 4> turned{};
    axes.turn(point.data(), turned.data());
    double norm = 0;
    for (const float number : turned) norm += double{number} * double{number};
    CHECK(norm == doctest::Approx(30.0));
    const std::vector<float> bad{1, 2, std::numeric_limits<float>::quiet_NaN(), 4};
    CHECK(cairn_test::message_of([&] {
            cairn::PrincipalAxes none(cairn::Rows<float>(bad, 2));
          }).find("point 1, coordinate 0") != std::string::npos);
  }
}
