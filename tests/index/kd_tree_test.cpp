// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/axis_metrics.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/kd_tree.hpp>

#include "index/generators.hpp"
#include "support/data.hpp"
#include "support/folder.hpp"
#include "support/processors.hpp"
#include "support/random.hpp"
#include "support/violation.hpp"

namespace kd_tree_test {
namespace {

constexpr std::array<std::size_t, 13> sizes{0, 1, 2, 15, 16, 17, 31, 33, 100, 256, 257, 700, 4500};

/// Same distances, in the same order; ids may differ between equally near points.
template <class Hits>
void check_same_distances(const Hits& found, const Hits& expected) {
  REQUIRE(found.size() == expected.size());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    wrong += std::abs(found[i].distance - expected[i].distance) > 1e-5F * std::abs(expected[i].distance);
  REQUIRE(wrong == 0);
}

/// One comparison of every kind of question with brute force.
template <class Scalar, std::size_t Dim, class M>
void compare(const std::vector<Scalar>& numbers, std::size_t dim, cairn::Random& random) {
  using Tree = cairn::KdTree<Scalar, Dim, M>;
  using Real = typename Tree::Real;
  const cairn::Rows<Scalar> points(numbers, dim);
  const Tree tree(points);
  const cairn::BruteForce<Scalar, Dim, M> brute(points);
  REQUIRE(tree.size() == points.size());
  for (int round = 0; round < 12; ++round) {
    std::vector<Real> query(dim);
    const bool on_point = !tree.empty() && round % 2 == 0;
    const std::size_t at = tree.empty() ? 0 : random.below(points.size());
    for (std::size_t a = 0; a < dim; ++a)
      query[a] = on_point ? static_cast<Real>(points[at][a]) : static_cast<Real>(random.uniform(-0.5, 2.0));
    for (const std::size_t k :
         {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{10}, points.size() + 3})
      check_same_distances(tree.nearest(query, k), brute.nearest(query, k));
    REQUIRE(tree.nearest(query).has_value() == !tree.empty());
    for (const Real radius : {Real{0}, Real(0.25), Real{3}})
      check_same_distances(tree.within(query, radius), brute.within(query, radius));
  }
}

/// The corpus of shapes and sizes for one kind of tree.
template <class Scalar, std::size_t Dim, class M>
void compare_all(std::size_t dim) {
  const std::uint64_t seed = cairn_test::seed(11);
  CAPTURE(seed);
  cairn::Random random(seed, dim);
  for (const std::string& shape : cairn_test::shapes())
    for (const std::size_t size : sizes) {
      CAPTURE(shape);
      CAPTURE(size);
      if (size > 1000 && (dim > 8 || shape == "clusters")) continue;
      compare<Scalar, Dim, M>(cairn_test::make_points<Scalar>(shape, size, dim, random), dim, random);
    }
}

/// A metric as a user writes it first: one number at a time, no templates.
struct Taxi {
  void accumulate(float& sum, float difference, std::size_t) const { sum += std::abs(difference); }
  float restore(float reduced) const noexcept { return reduced; }
  float reduce(float distance) const noexcept { return distance; }
};

struct Foreign {
  float x, y;
  float operator[](int axis) const { return axis == 0 ? x : y; }
};

}  // namespace

TEST_SUITE("kd_tree") {
  TEST_CASE("kd_tree: answers like brute force in three dimensions, whatever the points") {
    compare_all<float, 3, cairn::L2>(3);
    compare_all<double, 3, cairn::L2>(3);
  }

  TEST_CASE("kd_tree: answers like brute force in other dimensions, fixed and known at run time") {
    compare_all<float, 1, cairn::L2>(1);
    compare_all<double, cairn::dynamic_dim, cairn::L2>(2);
    compare_all<float, cairn::dynamic_dim, cairn::L2>(8);
    compare_all<float, 9, cairn::L2>(9);
    compare_all<double, cairn::dynamic_dim, cairn::L2>(24);
  }

  TEST_CASE("kd_tree: answers like brute force in every metric, above and below eight dimensions") {
    compare_all<float, 3, cairn::L1>(3);
    compare_all<float, 3, cairn::LInfinity>(3);
    compare_all<float, 3, Taxi>(3);
    compare_all<float, 12, cairn::L1>(12);
    compare_all<float, 12, cairn::LInfinity>(12);
  }

  TEST_CASE("kd_tree: bytes are points too") {
    cairn::Random random(cairn_test::seed(2));
    for (const std::size_t dim : {std::size_t{2}, std::size_t{32}}) {
      std::vector<std::uint8_t> numbers(700 * dim);
      for (std::uint8_t& number : numbers) number = static_cast<std::uint8_t>(random.below(256));
      compare<std::uint8_t, cairn::dynamic_dim, cairn::L2>(numbers, dim, random);
    }
  }

  TEST_CASE("kd_tree: weights scale the axes, and angles are angles") {
    const std::vector<std::array<float, 2>> points{{1, 0}, {0, 1}, {-1, 0}};
    const cairn::KdTree<float, 2, cairn::WeightedL2<2>> weighted(points, cairn::WeightedL2<2>{{1.0F, 0.25F}});
    CHECK(weighted.nearest(std::array{0.0F, -2.0F})->distance == doctest::Approx(0.75));
    const cairn::KdTree<float, 2, cairn::Angular> angular(points);
    const auto hits = angular.nearest(std::array{std::sqrt(0.75F), 0.5F}, 3);
    REQUIRE(hits.size() == 3);
    CHECK(hits[0].distance == doctest::Approx(M_PI / 6));
    CHECK(hits[1].distance == doctest::Approx(M_PI / 3));
    CHECK(hits[2].distance == doctest::Approx(M_PI * 5 / 6));
    CHECK(angular.within(std::array{1.0F, 0.0F}, 4.0F).size() == 3);
  }

  TEST_CASE("kd_tree: narrow and wide vectors find the same") {
    cairn::Random random(cairn_test::seed(4));
    const auto numbers = cairn_test::make_points<float>("uniform", 3000, 3, random);
    const cairn::KdTree<float, 3> tree(cairn::Rows<float>(numbers, 3));
    for (int i = 0; i < 200; ++i) {
      const std::array query{static_cast<float>(random.uniform()), static_cast<float>(random.uniform()),
                             0.5F};
      const auto expected = tree.nearest(query, 7);
      cairn_test::for_each_processor([&] { check_same_distances(tree.nearest(query, 7), expected); });
    }
  }

  TEST_CASE("kd_tree: depth is logarithmic and leaves are full, also when all points are equal") {
    for (const char* shape : {"uniform", "equal", "line"}) {
      cairn::Random random(1);
      const auto numbers = cairn_test::make_points<float>(shape, 40000, 3, random);
      const cairn::KdTree<float, 3> tree(cairn::Rows<float>(numbers, 3));
      CHECK(tree.leaves() == 2500);
      CHECK(tree.depth() == 12);
      CHECK(tree.bytes() < 40000 * (12 + 10));
    }
  }

  TEST_CASE("kd_tree: the work of a query grows like log n") {
    double nodes[3];
    for (int i = 0; i < 3; ++i) {
      cairn::Random random(9);
      const std::size_t size = std::size_t{2000} << (4 * i);
      const auto numbers = cairn_test::make_points<float>("uniform", size, 3, random);
      const cairn::KdTree<float, 3> tree(cairn::Rows<float>(numbers, 3));
      cairn::Work work;
      for (int q = 0; q < 500; ++q) {
        cairn::Nearest<float> nearest;
        tree.search(cairn::Rows<float>(numbers, 3)[random.below(size)], nearest, &work);
      }
      nodes[i] = static_cast<double>(work.nodes + work.leaves) / 500;
    }
    CHECK(nodes[2] - nodes[1] < 4);  // sixteen times the points: one level more
    CHECK(nodes[2] < 16);
  }

  TEST_CASE("kd_tree: ids are the caller's where given, and every point comes back once") {
    cairn::Random random(6);
    const auto numbers = cairn_test::make_points<float>("uniform", 333, 3, random);
    std::vector<cairn::PointId> ids;
    for (cairn::PointId i = 0; i < 333; ++i) ids.push_back(1000 + 3 * i);
    const cairn::KdTree<float, 3> tree(cairn::Rows<float>(numbers, 3), ids);
    std::vector<int> seen(333, 0);
    tree.for_each([&](cairn::PointId id, std::span<const float> row) {
      const std::size_t i = (id - 1000) / 3;
      ++seen[i];
      CHECK(std::memcmp(row.data(), &numbers[3 * i], 12) == 0);
    });
    CHECK(seen == std::vector<int>(333, 1));
    CHECK(tree.nearest(cairn::Rows<float>(numbers, 3)[7])->id == 1021);
  }

  TEST_CASE("kd_tree: ids that are none, repeated or too few are refused before anything is read by them") {
    using cairn_test::violation_of;
    const std::vector<std::array<float, 2>> points(40, {1, 2});
    std::vector<cairn::PointId> ids(40);
    for (cairn::PointId i = 0; i < 40; ++i) ids[i] = 7 * i;
    const auto build = [&] { cairn::KdTree<float, 2> tree(points, ids); };
    CHECK(violation_of(build).empty());
    ids[39] = 14;
    CHECK(violation_of(build).find("an id can be given only once") != std::string::npos);
    ids[39] = cairn::no_point;
    CHECK(violation_of(build).find("no_point is none") != std::string::npos);
    ids[39] = 4294967294U;  // the largest there is
    CHECK(violation_of(build).empty());
    ids[3] = 4294967294U;
    CHECK(violation_of(build).find("an id can be given only once") != std::string::npos);
    ids.resize(3);
    CHECK(violation_of(build).find("one id a point") != std::string::npos);
    ids.clear();
    CHECK(violation_of(build).find("one id a point") != std::string::npos);
    CHECK(violation_of([] {
            static_cast<void>(cairn::KdTree<float>::from_rows({1, 2, 3}, 2));
          }).find("whole rows") != std::string::npos);
    CHECK(violation_of([] {
            static_cast<void>(cairn::KdTree<float>::from_rows({1, 2, 3}, 0));
          }).find("whole rows") != std::string::npos);
  }

  TEST_CASE("kd_tree: takes the containers people have") {
    const std::vector<Foreign> foreign{{0, 0}, {3, 4}};
    CHECK(cairn::KdTree<float, 2>(foreign).nearest(Foreign{3, 5})->distance == doctest::Approx(1));
    const std::vector<std::vector<double>> nested{{0, 0, 0}, {1, 1, 1}};
    CHECK(cairn::KdTree<double>(nested).nearest(nested[1])->id == 1);
    CHECK(cairn::KdTree<float>().nearest(nested[0]) == std::nullopt);
  }

  TEST_CASE("kd_tree: bad points and queries are refused by number and axis") {
    using cairn_test::message_of;
    std::vector<std::array<float, 3>> points(20, {1, 2, 3});
    points[13][2] = std::numeric_limits<float>::infinity();
    CHECK(message_of([&] { cairn::KdTree<float, 3> tree(points); }).find("point 13, coordinate 2") !=
          std::string::npos);
    points[13][2] = 1e30F;  // its square is no float
    CHECK(message_of([&] { cairn::KdTree<float, 3> tree(points); }).find("stay finite") != std::string::npos);
    points[13][2] = 0;
    const cairn::KdTree<float, 3> tree(points);
    const std::array query{0.0F, std::numeric_limits<float>::quiet_NaN(), 0.0F};
    CHECK(message_of([&] { static_cast<void>(tree.nearest(query)); }).find("coordinate 1 is nan") !=
          std::string::npos);
    const std::vector<std::vector<float>> ragged{{1, 2}, {1, 2, 3}};
    CHECK(message_of([&] { cairn::KdTree<float> other(ragged); }).find("3 coordinates, expected 2") !=
          std::string::npos);
    const std::vector<float> numbers(7);
    CHECK_THROWS_AS(cairn::Rows<float>(numbers, 3), cairn::Error);
    CHECK_THROWS_AS(cairn::Rows<float>(numbers, 0), cairn::Error);
  }

  TEST_CASE("kd_tree: finds the published nearest neighbours of a real cloud") {
    const auto folder = cairn_test::real_data("cloud_177k");
    if (!folder) return;
    const auto read = [](const std::filesystem::path& path) {
      std::ifstream file(path, std::ios::binary);
      std::vector<std::vector<float>> rows;
      std::int32_t dim = 0;
      while (file.read(reinterpret_cast<char*>(&dim), 4)) {
        rows.emplace_back(static_cast<std::size_t>(dim));
        file.read(reinterpret_cast<char*>(rows.back().data()), 4 * dim);
      }
      return rows;
    };
    std::vector<std::vector<float>> base;
    std::vector<std::vector<float>> queries;
    std::vector<std::vector<float>> truth;  // ints in disguise
    for (const auto& entry : std::filesystem::directory_iterator(*folder)) {
      const std::string name = entry.path().filename().string();
      if (name.find("base") != std::string::npos) base = read(entry.path());
      if (name.find("query") != std::string::npos) queries = read(entry.path());
      if (name.find("ivecs") != std::string::npos) truth = read(entry.path());
    }
    REQUIRE(base.size() == 177264);
    REQUIRE(truth.size() == queries.size());
    const cairn::KdTree<float, 3> tree(base);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < queries.size(); ++i) {
      const auto hits = tree.nearest(queries[i], truth[i].size());
      for (std::size_t k = 0; k < hits.size(); ++k) {
        std::uint32_t id = 0;
        std::memcpy(&id, &truth[i][k], 4);
        double squared = 0;
        for (std::size_t a = 0; a < 3; ++a)
          squared += std::pow(double{base[id][a]} - double{queries[i][a]}, 2);
        wrong += std::abs(std::sqrt(squared) - double{hits[k].distance}) > 1e-4 * (1 + std::sqrt(squared));
      }
    }
    CHECK(wrong == 0);
  }
}

}  // namespace kd_tree_test
