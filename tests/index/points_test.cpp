// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cstddef>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <doctest/doctest.h>

#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/points.hpp>

#include "support/folder.hpp"

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
