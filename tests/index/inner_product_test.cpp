// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/inner_product.hpp>
#include <cairn/index/kd_tree.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace inner_product_test {
namespace {

using Points = cairn::Rows<float>;

/// Like learned features: few directions that matter, norms that differ by a factor of `ratio`.
std::vector<float> features(std::size_t count, std::size_t dim, double ratio, cairn::Random& random) {
  std::vector<float> numbers(count * dim);
  for (std::size_t i = 0; i < count; ++i) {
    double hidden[16];
    for (double& number : hidden) number = random.normal();
    double square = 0;
    std::vector<double> row(dim);
    for (std::size_t a = 0; a < dim; ++a) {
      row[a] = hidden[a % 16] * hidden[(a * a + 3) % 16] + 0.1 * random.normal();
      square += row[a] * row[a];
    }
    const double norm = std::pow(ratio, random.uniform());
    for (std::size_t a = 0; a < dim; ++a)
      numbers[i * dim + a] = static_cast<float>(row[a] * norm / std::sqrt(square));
  }
  return numbers;
}

/// All products, by a loop, largest first.
std::vector<double> products(const std::vector<float>& numbers, const std::vector<float>& query) {
  std::vector<double> sums(numbers.size() / query.size(), 0.0);
  for (std::size_t i = 0; i < numbers.size(); ++i)
    sums[i / query.size()] += double{numbers[i]} * double{query[i % query.size()]};
  std::sort(sums.begin(), sums.end(), [](double a, double b) { return a > b; });
  return sums;
}

}  // namespace

TEST_SUITE("inner_product") {
  TEST_CASE(
      "inner_product: float features of 64 to 768 numbers give the largest products, with codes and "
      "without") {
    cairn::Random random(cairn_test::seed(95));
    for (const std::size_t dim : {64U, 200U, 256U, 768U})
      for (const double ratio : {1.0, 3.0})
        for (const auto codes : {cairn::DescriptorCodes::off, cairn::DescriptorCodes::on}) {
          CAPTURE(dim);
          CAPTURE(ratio);
          const auto numbers = features(1200, dim, ratio, random);
          const Points points(numbers, dim);
          const cairn::InnerProductPoints lifted(points);
          const cairn::DescriptorIndex index(lifted, {.codes = codes});
          REQUIRE(index.dimension() == dim + 1);
          std::size_t right = 0;
          for (std::size_t i = 0; i < 20; ++i) {
            std::vector<float> query(&numbers[i * 50 * dim], &numbers[i * 50 * dim] + dim);
            for (float& number : query)
              number = (i % 2 == 0 ? 1.0F : -20.0F) * (number + 0.02F * static_cast<float>(random.normal()));
            const auto expected = products(numbers, query);
            const auto found = cairn::largest_products(index, lifted, query, 5);
            REQUIRE(found.size() == 5);
            const double scale = expected[0] - expected.back();
            for (std::size_t k = 0; k < 5; ++k)
              CHECK(std::abs(double{found[k].product} - expected[k]) < 1e-5 * scale);
            const auto budgeted = cairn::largest_products(index, lifted, query, 1, {.leaves = 20});
            REQUIRE(budgeted.size() == 1);
            CHECK(double{budgeted[0].product} <= expected[0] + 1e-5 * scale);
            right += budgeted[0] == found[0];
          }
          CHECK(right > 10);
        }
  }

  TEST_CASE("inner_product: any index of distances will do, and the set may grow") {
    cairn::Random random(cairn_test::seed(96));
    std::vector<std::array<float, 3>> points;
    const auto add = [&](std::size_t count) {
      for (std::size_t i = 0; i < count; ++i) {
        std::array<float, 3> point;
        for (float& number : point) number = static_cast<float>(random.uniform(-1, 1));
        points.push_back(point);
      }
    };
    add(300);
    cairn::InnerProductPoints lifted(points, 2.0F);
    cairn::DescriptorIndex cells(lifted);
    add(200);
    lifted.extend();
    cells.insert(300, 200);
    const cairn::KdTree<float> tree(lifted);
    std::vector<float> numbers;
    for (const auto& point : points) numbers.insert(numbers.end(), point.begin(), point.end());
    for (int i = 0; i < 100; ++i) {
      std::vector<float> query(3);
      for (float& number : query) number = static_cast<float>(random.normal());
      const auto expected = products(numbers, query);
      const auto by_tree = cairn::largest_products(tree, lifted, query, 4);
      const auto by_cells = cairn::largest_products(cells, lifted, query, 4);
      for (std::size_t k = 0; k < 4; ++k) {
        CHECK(by_tree[k].product == doctest::Approx(expected[k]).epsilon(1e-5));
        CHECK(by_cells[k].product == doctest::Approx(expected[k]).epsilon(1e-5));
      }
    }
  }

  TEST_CASE("inner_product: points too long, not finite or none, and queries of another dimension") {
    using cairn_test::message_of;
    std::vector<std::array<float, 2>> points{{3, 4}, {1, 0}};
    cairn::InnerProductPoints lifted(points);
    CHECK(lifted.longest() == 5.0F);
    CHECK(lifted[0][2] == 0.0F);
    points.push_back({6, 0});
    CHECK(message_of([&] { lifted.extend(); }).find("point 2 is 6") != std::string::npos);
    CHECK(lifted.size() == 2);
    points[2] = {0, std::numeric_limits<float>::quiet_NaN()};
    CHECK(message_of([&] { lifted.extend(); }).find("point 2, coordinate 1 is nan") != std::string::npos);
    CHECK(message_of([&] {
            static_cast<void>(lifted.lifted(std::array{1.0F, 2.0F, 3.0F}));
          }).find("expected 2") != std::string::npos);
    CHECK(message_of([&] { cairn::InnerProductPoints bad(points, std::nanf("")); }).find("nan long") !=
          std::string::npos);
    CHECK(message_of([&] { cairn::InnerProductPoints bad(points, -1); }).find("not negative") !=
          std::string::npos);
    CHECK(message_of([&] {
            cairn::InnerProductPoints bad(points, std::numeric_limits<float>::infinity());
          }).find("inf long") != std::string::npos);
    const std::vector<const float*> pointers(5, points[0].data());  // which do not say how many numbers
    CHECK(message_of([&] { cairn::InnerProductPoints bad(pointers); }).find("at least one coordinate") !=
          std::string::npos);
    std::vector<std::vector<float>> growing;
    cairn::InnerProductPoints open(growing, 100);
    growing = {{1, 2, std::nanf("")}};
    CHECK(message_of([&] { open.extend(); }).find("coordinate 2 is nan") != std::string::npos);
    growing = {{1, 2}};
    open.extend();
    CHECK(open.dimension() == 3);
    const std::vector<std::array<float, 2>> none;
    const cairn::InnerProductPoints nothing(none);
    const cairn::DescriptorIndex empty(nothing);
    CHECK(cairn::largest_products(empty, nothing, std::array{1.0F, 2.0F}, 3).empty());
  }
}

}  // namespace inner_product_test
