// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <doctest/doctest.h>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/nearest_first.hpp>
#include <cairn/index/points.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace points_test {
namespace {

using Tree = cairn::KdTree<float, 3>;

/// Four corners: what is near (1, 0.9, 0) is point 2.
constexpr std::array<std::array<float, 3>, 4> corners{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 1}}};

template <class Points, class Query>
void check_finds(const Points& points, const Query& query) {
  const Tree tree(points);
  REQUIRE(tree.size() == 4);
  const auto hit = tree.nearest(query);
  REQUIRE(hit.has_value());
  CHECK(hit->id == 2);
  CHECK(hit->distance == doctest::Approx(0.1));
}

struct Foreign {
  double x, y, z;
  int colour;
};

/// As many points as there are numbers, or more; none of them must be read.
struct Endless {
  std::size_t count;
  [[nodiscard]] std::size_t size() const { return count; }
  [[nodiscard]] std::array<float, 3> operator[](std::size_t) const { throw std::string("read"); }
};

/// What a tree of whole numbers says when built from one point that it cannot hold.
template <class Scalar, class Number>
std::string refusal(Number number) {
  const std::vector<std::array<Number, 2>> points{{Number{1}, Number{2}}, {Number{3}, number}};
  const std::string of_tree = cairn_test::message_of([&] { cairn::KdTree<Scalar, 2> tree(points); });
  const std::string of_brute = cairn_test::message_of([&] { cairn::BruteForce<Scalar, 2> brute(points); });
  cairn::MultiKdTree<Scalar, 2> forest;
  const std::string of_forest = cairn_test::message_of([&] { forest.insert(points); });
  CHECK(forest.empty() == !of_forest.empty());
  const auto words = [](const std::string& of) { return of.substr(std::min(of.find(':'), of.size())); };
  CHECK(words(of_tree) == words(of_brute));
  CHECK(words(of_tree) == words(of_forest));
  return of_tree;
}

/// All searches of a tree of bytes for a query that no byte is, against a plain loop.
template <class Query>
void check_byte_searches(const std::vector<std::array<std::uint8_t, 2>>& points,
                         const std::array<Query, 2>& query) {
  std::vector<long double> expected;
  for (const auto& point : points)
    expected.push_back(std::hypot(static_cast<long double>(query[0]) - point[0],
                                  static_cast<long double>(query[1]) - point[1]));
  std::sort(expected.begin(), expected.end());
  const cairn::KdTree<std::uint8_t, 2> tree(points);
  const auto near = [](float found, long double right) {
    return std::abs(static_cast<long double>(found) - right) <= 1e-6L * right;
  };
  const auto hits = tree.nearest(query, points.size());
  REQUIRE(hits.size() == points.size());
  cairn::NearestFirst order(tree, query);
  cairn::BestBinFirst<cairn::KdTree<std::uint8_t, 2>> search;
  cairn::NearestTwo<float> two;
  REQUIRE(search.search(tree, query, two));
  CHECK(near(two.first(), expected[0]));
  CHECK(near(two.second(), expected[1]));
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    wrong += !near(hits[i].distance, expected[i]);
    wrong += !near(order.next()->distance, expected[i]);
  }
  CHECK(wrong == 0);
}

/// A matrix of Eigen's may be given so.
template <class Matrix>
concept HasRowsOf = requires(Matrix&& matrix) { cairn::rows_of(std::forward<Matrix>(matrix)); };
static_assert(HasRowsOf<Eigen::MatrixX3d&> && HasRowsOf<const Eigen::MatrixX3d&>);
static_assert(!HasRowsOf<Eigen::MatrixX3d>, "its numbers would be gone");
static_assert(HasRowsOf<Eigen::Map<const Eigen::MatrixX3d>>, "those of a map stay");
static_assert(HasRowsOf<Eigen::Transpose<Eigen::Matrix3Xd>>);
static_assert(!HasRowsOf<std::vector<double>&>);
static_assert(!std::is_constructible_v<cairn::Rows<double>, const Eigen::MatrixX3d&, std::size_t>);
static_assert(!std::is_constructible_v<cairn::Rows<double>, const Eigen::MatrixX3d&>);

static_assert(std::is_constructible_v<cairn::Rows<float>, const std::vector<float>&, std::size_t>);
static_assert(std::is_constructible_v<cairn::Rows<float>, std::span<const float>, std::size_t>);
static_assert(!std::is_constructible_v<cairn::Rows<float>, std::vector<float>, std::size_t>, "would be gone");
static_assert(!std::is_constructible_v<cairn::Rows<float>, std::array<float, 3>, std::size_t>);

struct FirstAndLast {
  double operator()(const Foreign& point, std::size_t axis) const { return axis == 0 ? point.x : point.z; }
};
using Cloud = std::vector<Foreign>;
using Seen = cairn::Through<Cloud, FirstAndLast>;
static_assert(std::is_constructible_v<Seen, const Cloud&, std::size_t, FirstAndLast>);
static_assert(!std::is_constructible_v<Seen, Cloud, std::size_t, FirstAndLast>);
template <class Set>
concept GivesPoints = requires(Set&& set) { std::forward<Set>(set)[0]; };
static_assert(GivesPoints<const Seen&> && !GivesPoints<Seen>);
static_assert(!std::is_constructible_v<cairn::NearestFirst<Tree>, Tree, std::array<float, 3>>);
static_assert(!std::is_constructible_v<cairn::NearestFirst<cairn::MultiKdTree<float, 3>>,
                                       cairn::MultiKdTree<float, 3>, std::array<float, 3>>);

}  // namespace

TEST_SUITE("points") {
  TEST_CASE("points: standard containers, spans and C arrays are points as they are") {
    const std::array<double, 3> query{1, 0.9, 0};
    check_finds(corners, query);
    check_finds(std::vector(corners.begin(), corners.end()), std::span(query));
    check_finds(std::deque(corners.begin(), corners.end()), std::vector<float>{1, 0.9F, 0});
    check_finds(std::span(corners), query.data());
    const float raw[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 1}};
    const float raw_query[3] = {1, 0.9F, 0};
    check_finds(std::span(raw), raw_query);
    const std::vector<const double*> none;
    CHECK(Tree(none).empty());
  }

  TEST_CASE("points: flat memory says its own scalar") {
    const std::vector<float> numbers{1, 2, 3, 4, 5, 6};
    const cairn::Rows rows(numbers, 3);
    static_assert(std::same_as<decltype(rows), const cairn::Rows<float>>);
    CHECK(rows.size() == 2);
    CHECK(rows[1][0] == 4);
    const std::array<double, 4> others{1, 2, 3, 4};
    static_assert(std::same_as<decltype(cairn::Rows(std::span(others), 2)), cairn::Rows<double>>);
    static_assert(std::same_as<decltype(cairn::Rows(others, 2)), cairn::Rows<double>>);
  }

  TEST_CASE("points: Eigen vectors, and the columns of a matrix without a copy") {
    std::vector<Eigen::Vector3d> vectors;
    Eigen::Matrix3Xf matrix(3, 4);
    for (Eigen::Index i = 0; i < 4; ++i) {
      const auto& corner = corners[static_cast<std::size_t>(i)];
      vectors.emplace_back(corner[0], corner[1], corner[2]);
      matrix.col(i) << corner[0], corner[1], corner[2];
    }
    const Eigen::Vector3d query(1, 0.9, 0);
    check_finds(vectors, query);
    const cairn::Rows<float> columns({matrix.data(), static_cast<std::size_t>(matrix.size())}, 3);
    check_finds(columns, query.cast<float>());
    Eigen::Matrix3Xf queries(3, 2);
    queries.col(1) << 1, 0.9F, 0;
    check_finds(columns, queries.col(1));
    const cairn::KdTree<double> dynamic(vectors);
    CHECK(dynamic.dimension() == 3);
    CHECK(dynamic.nearest(query)->id == 2);
  }

  TEST_CASE("points: the rows and the columns of a matrix are points in either layout, and parts of it too") {
    Eigen::MatrixX3d by_columns(4, 3);
    Eigen::Matrix<float, 4, 3, Eigen::RowMajor> by_rows;
    for (Eigen::Index i = 0; i < 4; ++i)
      for (Eigen::Index a = 0; a < 3; ++a) {
        by_columns(i, a) = double{corners[static_cast<std::size_t>(i)][static_cast<std::size_t>(a)]};
        by_rows(i, a) = corners[static_cast<std::size_t>(i)][static_cast<std::size_t>(a)];
      }
    const Eigen::Vector3d query(1, 0.9, 0);
    check_finds(cairn::rows_of(by_columns), query);
    check_finds(cairn::rows_of(by_rows), query);
    const Eigen::Matrix3Xd wide = by_columns.transpose();
    check_finds(cairn::columns_of(wide), query);
    check_finds(cairn::rows_of(wide.transpose()), query);
    Eigen::MatrixXd large = Eigen::MatrixXd::Constant(9, 11, 7);
    large.block(2, 5, 4, 3) = by_columns;
    check_finds(cairn::rows_of(large.block(2, 5, 4, 3)), query);
    const Eigen::Map<const Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, 2>> every_other(
        large.data(), 4, 3, Eigen::Stride<Eigen::Dynamic, 2>(9, 2));
    const auto seen = cairn::rows_of(every_other);
    CHECK(seen[1][2] == large(2, 2));
    CHECK(cairn::KdTree(cairn::rows_of(by_columns)).dimension() == 3);
    check_finds(cairn::Strided(&by_rows(3, 0), 4, 3, -3, 1), std::array{1.0, 0.1, 0.0});  // backwards
    CHECK(cairn_test::message_of([&] {
            cairn::Strided<float> bad(nullptr, 0, 0, 1, 1);
          }).find("dimension 0") != std::string::npos);
  }

  TEST_CASE("points: a tree keeps coordinates as the points have them where nobody says otherwise") {
    // Two marks 2 cm apart in the coordinates of a surveyor; floats are half a metre apart there.
    const std::vector<std::array<double, 2>> marks{{691607.00, 5334762.00}, {691607.02, 5334762.00}};
    const cairn::KdTree tree(marks);
    static_assert(std::is_same_v<decltype(tree)::Coordinate, double>);
    CHECK(tree.nearest(marks[1])->id == 1);
    CHECK(tree.nearest(marks[0], 2)[1].distance == doctest::Approx(0.02));
    const std::vector<cairn::PointId> ids{70, 80};
    CHECK(cairn::KdTree(marks, ids).nearest(marks[1])->id == 80);
    CHECK(cairn::KdTree(marks, cairn::L1{}).nearest(marks[1])->id == 1);
    CHECK(cairn::BruteForce(marks).nearest(marks[1])->id == 1);
    const std::vector<std::array<std::uint8_t, 2>> bytes{{1, 2}, {3, 4}};
    CHECK(std::is_same_v<decltype(cairn::KdTree(bytes))::Coordinate, std::uint8_t>);
    const std::vector<std::array<std::int64_t, 2>> wide{{1, 2}, {3, 4}};
    CHECK(std::is_same_v<decltype(cairn::KdTree(wide))::Coordinate, double>);
  }

  TEST_CASE("points: whole coordinates are refused where they are none of the type's") {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::string byte = ", expected a whole number from 0 to 255";
    CHECK(refusal<std::uint8_t>(300.7) == "KdTree: point 1, coordinate 1 is 300.700000" + byte);
    CHECK(refusal<std::uint8_t>(nan).find("coordinate 1 is nan" + byte) != std::string::npos);
    CHECK(refusal<std::uint8_t>(-5).find("coordinate 1 is -5.000000" + byte) != std::string::npos);
    CHECK(refusal<std::uint8_t>(256U).find("is 256.000000" + byte) != std::string::npos);
    CHECK(refusal<std::uint8_t>(254.5F).find("is 254.500000" + byte) != std::string::npos);
    CHECK(refusal<std::uint8_t>(static_cast<std::int8_t>(-1)).find("is -1.000000" + byte) !=
          std::string::npos);
    CHECK(refusal<std::uint8_t>(1e300L).find(byte) != std::string::npos);
    CHECK(refusal<std::int16_t>(-32769).find("from -32768 to 32767") != std::string::npos);
    CHECK(refusal<std::int16_t>(std::uint64_t{1} << 63).find("from -32768 to 32767") != std::string::npos);
    CHECK(refusal<std::uint32_t>(-1.0).find("from 0 to 4294967295") != std::string::npos);
    CHECK(refusal<std::int32_t>(2147483648.0F).find("to 2147483647") != std::string::npos);
    CHECK(refusal<std::uint8_t>(255.0).empty());
    CHECK(refusal<std::uint8_t>(std::int64_t{0}).empty());
    CHECK(refusal<std::int16_t>(-32768.0F).empty());
    CHECK(refusal<std::int32_t>(2147483647U).empty());
    CHECK(refusal<std::uint32_t>(4294967295.0).empty());
  }

  TEST_CASE("points: a query of bytes is taken as it is, with fractions and out of their range") {
    const std::uint64_t seed = cairn_test::seed(206);
    CAPTURE(seed);
    cairn::Random random(seed);
    std::vector<std::array<std::uint8_t, 2>> points(300);
    for (auto& point : points)
      for (std::uint8_t& number : point) number = static_cast<std::uint8_t>(random.below(256));
    check_byte_searches(points, std::array{300.7, -5.0});
    check_byte_searches(points, std::array{-5, 1000});
    for (int round = 0; round < 30; ++round)
      check_byte_searches(points, std::array{static_cast<float>(random.uniform(-50, 300)),
                                             static_cast<float>(random.uniform(-50, 300))});
    const cairn::KdTree<std::uint8_t, 2> tree(points);
    CHECK(inside(tree, std::array{-5.0, -5.0}, std::array{300.7, 300.7}).size() == points.size());
    CHECK(inside(tree, std::array{-5.0, -5.0}, std::array{-0.5, 300.7}).empty());
    CHECK(cairn_test::message_of([&] {
            static_cast<void>(tree.nearest(std::array{1.0, std::numeric_limits<double>::quiet_NaN()}));
          }).find("coordinate 1 is nan, expected a finite number") != std::string::npos);
  }

  TEST_CASE_TEMPLATE("points: coordinates of every whole type are searched like those of a loop", Scalar,
                     std::int8_t, std::int16_t, std::uint16_t, std::int32_t, std::uint32_t) {
    const std::uint64_t seed = cairn_test::seed(207);
    CAPTURE(seed);
    cairn::Random random(seed);
    constexpr auto low = static_cast<double>(std::numeric_limits<Scalar>::min());
    constexpr auto high = static_cast<double>(std::numeric_limits<Scalar>::max());
    std::vector<std::array<Scalar, 3>> points(700);
    for (auto& point : points)
      for (Scalar& number : point) number = static_cast<Scalar>(random.uniform(low, high));
    const cairn::KdTree<Scalar, 3> fixed(points);
    const cairn::KdTree<Scalar> dynamic(points);
    std::size_t wrong = 0;
    for (int round = 0; round < 40; ++round) {
      std::array<double, 3> query{};
      for (double& number : query) number = random.uniform(1.2 * low - 5, 1.2 * high);
      long double nearest = std::numeric_limits<long double>::infinity();
      for (const auto& point : points)
        nearest = std::min(
            nearest, std::hypot(static_cast<long double>(query[0]) - static_cast<long double>(point[0]),
                                static_cast<long double>(query[1]) - static_cast<long double>(point[1]),
                                static_cast<long double>(query[2]) - static_cast<long double>(point[2])));
      for (const auto found : {fixed.nearest(query)->distance, dynamic.nearest(query)->distance})
        wrong += std::abs(static_cast<long double>(found) - nearest) > 1e-5L * nearest + 1e-6L * high;
    }
    CHECK(wrong == 0);
  }

  TEST_CASE("points: foreign points are seen through a function") {
    std::vector<Foreign> cloud;
    for (const auto& corner : corners)
      cloud.push_back({double{corner[0]}, double{corner[1]}, double{corner[2]}, 7});
    const cairn::Through points(cloud, 3, [](const Foreign& point, std::size_t axis) {
      return axis == 0 ? point.x : axis == 1 ? point.y : point.z;
    });
    check_finds(points, std::array{1.0, 0.9, 0.0});
    CHECK(Tree(points).nearest(points[3])->id == 3);
    CHECK(cairn::KdTree<double>(points).dimension() == 3);
    CHECK(cairn_test::message_of([&] {
            const cairn::Through bad(cloud, 0, [](const Foreign&, std::size_t) { return 0.0; });
          }).find("dimension 0") != std::string::npos);
  }

  TEST_CASE("points: nobody asks a foreign point for more coordinates than it has") {
    using cairn_test::message_of;
    struct Flat {
      double x, y;
    };
    const std::vector<Flat> cloud(20, {1, 2});
    std::size_t beyond = 0;
    const cairn::Through points(cloud, 2, [&](const Flat& point, std::size_t axis) {
      beyond += axis > 1;
      return axis == 0 ? point.x : point.y;
    });
    const Tree tree(corners);
    cairn::MultiKdTree<float> growing;
    growing.insert(corners);
    const std::string words = "has 2 coordinates, expected 3";
    CHECK(message_of([&] { Tree bad(points); }).find(words) != std::string::npos);
    CHECK(message_of([&] { cairn::BruteForce<float, 3> bad(points); }).find(words) != std::string::npos);
    CHECK(message_of([&] { growing.insert(points); }).find(words) != std::string::npos);
    CHECK(message_of([&] { static_cast<void>(tree.nearest(points[0])); }).find(words) != std::string::npos);
    CHECK(beyond == 0);
    CHECK(growing.size() == 4);
  }

  TEST_CASE("points: more than can be numbered are refused before anything is read or taken") {
    using cairn_test::message_of;
    const Endless endless{std::size_t{1} << 32};
    const std::string words = "at most 2^32 - 2 points can be numbered, got 4294967296";
    CHECK(message_of([&] { Tree tree(endless); }).find(words) != std::string::npos);
    CHECK(message_of([&] { cairn::DescriptorIndex index(endless); }).find(words) != std::string::npos);
    cairn::MultiKdTree<float, 3> forest;
    CHECK(message_of([&] { forest.insert(endless); }).find("4294967296 points after 0 ids") !=
          std::string::npos);
    forest.insert(corners);
    CHECK(message_of([&] { forest.insert(Endless{0xfffffffcU}); }).find("after 4 ids") != std::string::npos);
    CHECK(forest.insert(corners) == 4);
  }
}

}  // namespace points_test
