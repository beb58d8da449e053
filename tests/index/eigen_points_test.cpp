// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Eigen's matrices as points and queries, whichever way they lie in memory. The headers of index know
// nothing of Eigen.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/batch_search.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/kd_forest.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/points.hpp>

#ifdef EIGEN_CORE_H
#error "a header of index includes Eigen"
#endif
#ifdef EIGEN_WORLD_VERSION
#error "a header of index includes Eigen"
#endif
#include <Eigen/Core>

#include "support/random.hpp"

namespace eigen_points_test {
namespace {

using ByRows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
using ByColumns = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::ColMajor>;
constexpr std::ptrdiff_t count = 200;

ByRows some_points(std::uint64_t stream) {
  cairn::Random random(cairn_test::seed(5), stream);
  ByRows points(count, 3);
  for (std::ptrdiff_t i = 0; i < count; ++i)
    for (std::ptrdiff_t a = 0; a < 3; ++a) points(i, a) = static_cast<float>(random.uniform());
  return points;
}

/// The nearest row, by a loop over the matrix itself.
std::ptrdiff_t nearest_row(const ByRows& points, const Eigen::Vector3f& query) {
  std::ptrdiff_t best = 0;
  long double least = 1e9L;
  for (std::ptrdiff_t i = 0; i < points.rows(); ++i) {
    long double sum = 0;
    for (std::ptrdiff_t a = 0; a < 3; ++a) {
      const long double difference =
          static_cast<long double>(points(i, a)) - static_cast<long double>(query(a));
      sum += difference * difference;
    }
    if (sum < least) least = sum, best = i;
  }
  return best;
}

/// The set, whose i-th point is row i of `points`, in every index.
template <class Points>
void check_set(const Points& set, const ByRows& points) {
  REQUIRE(set.size() == count);
  const cairn::BruteForce<float, 3> brute(set);
  const cairn::KdTree<float, 3> fixed(set);
  const cairn::KdTree dynamic(set);
  const cairn::KdForest<3> forest(set, {.trees = 2});
  const cairn::DescriptorIndex cells(set);
  cairn::MultiKdTree<float, 3> growing;
  growing.insert(set);
  CHECK(dynamic.dimension() == 3);
  const ByRows queries = some_points(2);
  for (std::ptrdiff_t i = 0; i < queries.rows(); ++i) {
    const Eigen::Vector3f query = queries.row(i).transpose();
    const auto expected = static_cast<cairn::PointId>(nearest_row(points, query));
    REQUIRE(brute.nearest(query)->id == expected);
    REQUIRE(fixed.nearest(query)->id == expected);
    REQUIRE(dynamic.nearest(query)->id == expected);
    REQUIRE(forest.nearest(query)->id == expected);
    REQUIRE(cells.nearest(query)->id == expected);
    REQUIRE(growing.nearest(query)->id == expected);
    REQUIRE(fixed.nearest(queries.row(i))->id == expected);  // a row of a matrix is a query as it is
  }
}

}  // namespace

TEST_SUITE("eigen_points") {
  TEST_CASE("eigen_points: the rows of a matrix are points in either layout") {
    const ByRows points = some_points(1);
    const ByColumns other = points;
    check_set(cairn::rows_of(points), points);
    check_set(cairn::rows_of(other), points);
    const Eigen::MatrixXf dynamic = points;
    check_set(cairn::rows_of(dynamic), points);
  }

  TEST_CASE("eigen_points: the columns of a matrix are points in either layout") {
    const ByRows points = some_points(1);
    const Eigen::Matrix<float, 3, Eigen::Dynamic> columns = points.transpose();
    const Eigen::Matrix<float, 3, Eigen::Dynamic, Eigen::RowMajor> other = columns;
    check_set(cairn::columns_of(columns), points);
    check_set(cairn::columns_of(other), points);
    check_set(cairn::columns_of(points.transpose()), points);  // a view of points, which stay
  }

  TEST_CASE("eigen_points: maps, with steps of their own, and blocks are points where they lie") {
    const ByRows points = some_points(1);
    check_set(cairn::rows_of(Eigen::Map<const ByRows>(points.data(), count, 3)), points);
    // Records of five numbers, a point in the middle of each.
    std::vector<float> records(5 * static_cast<std::size_t>(count), -1.0F);
    using Steps = Eigen::OuterStride<5>;
    Eigen::Map<ByRows, 0, Steps> inside(records.data() + 1, count, 3, Steps());
    inside = points;
    check_set(cairn::rows_of(inside), points);
    Eigen::MatrixXf wide = Eigen::MatrixXf::Constant(count + 2, 7, 99.0F);
    wide.block(1, 2, count, 3) = points;
    check_set(cairn::rows_of(wide.block(1, 2, count, 3)), points);
  }

  TEST_CASE("eigen_points: a batch of queries is a matrix too") {
    const ByRows points = some_points(1);
    const ByColumns queries = some_points(2);
    const cairn::KdTree<float, 3> tree(cairn::rows_of(points));
    const auto hits = cairn::nearest_batch(tree, cairn::rows_of(queries), 1, {.threads = 2});
    REQUIRE(hits.size() == count);
    for (std::ptrdiff_t i = 0; i < count; ++i)
      CHECK(hits[static_cast<std::size_t>(i)].id ==
            static_cast<cairn::PointId>(nearest_row(points, queries.row(i).transpose())));
  }

  TEST_CASE("eigen_points: vectors of Eigen's vectors are points as they are") {
    const ByRows points = some_points(1);
    std::vector<Eigen::Vector3f> vectors;
    for (std::ptrdiff_t i = 0; i < count; ++i) vectors.emplace_back(points.row(i).transpose());
    check_set(vectors, points);
    const Eigen::MatrixXd doubles = points.cast<double>();
    const cairn::KdTree tree(cairn::rows_of(doubles));
    CHECK(std::is_same_v<decltype(tree)::Coordinate, double>);
    CHECK(tree.nearest(Eigen::Vector3d(doubles.row(3).transpose()))->distance == 0);
  }
}

}  // namespace eigen_points_test
