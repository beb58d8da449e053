// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The examples in the headers of cairn/index, compiled and run: each is cut out of its header by
// CMakeLists.txt.
#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <sstream>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/index/axis_metrics.hpp>
#include <cairn/index/batch_search.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/descriptor_file.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/index.hpp>
#include <cairn/index/inner_product.hpp>
#include <cairn/index/kd_forest.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/landmark_store.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/nearest_first.hpp>
#include <cairn/index/packed_points.hpp>
#include <cairn/index/points.hpp>

namespace docs_index_test {

using Descriptors = std::vector<std::array<float, 64>>;

Descriptors some_descriptors() {
  cairn::Random random(14);
  Descriptors descriptors(100);
  for (auto& descriptor : descriptors)
    for (float& number : descriptor) number = static_cast<float>(random.uniform());
  return descriptors;
}

const std::vector<std::array<float, 3>> three_points{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}};

/// The nearest point of a collector's own making.
struct Closest {
  float best = std::numeric_limits<float>::infinity();
  cairn::PointId id = cairn::no_point;
  [[nodiscard]] float limit() const noexcept { return best; }
  void offer(cairn::PointId point, float reduced) noexcept {
    if (reduced < best) best = reduced, id = point;
  }
};

TEST_CASE("docs: the example of kd_tree.hpp finds the nearest point and all within a radius") {
  const auto& points = three_points;
  const std::array query{0.9F, 0.1F, 0.0F};
  std::vector<cairn::PointId> used;
  const auto use = [&](cairn::PointId id, float distance) {
    CHECK(distance >= 0);
    used.push_back(id);
  };
  Closest my_collector;
#include "snippets/index/kd_tree_1.inc"
  CHECK(used == std::vector<cairn::PointId>{1, 1, 0, 2, 1});
  CHECK(my_collector.id == 1);
}

using Scan = std::vector<std::array<float, 3>>;
#include "snippets/index/index_1.inc"

TEST_CASE("docs: the example of index.hpp counts in any index what was seen before") {
  const Scan scan{{0, 0, 0.01F}, {1, 0.5F, 0}, {0, 2, 0}};
  CHECK(seen_before(cairn::BruteForce<float, 3>(three_points), scan) == 2);
  CHECK(seen_before(cairn::KdTree<float, 3>(three_points), scan) == 2);
  CHECK(seen_before(cairn::DescriptorIndex(three_points), scan) == 2);
}

TEST_CASE("docs: the example of batch_search.hpp answers every query") {
  const auto& queries = three_points;
  const cairn::KdTree<float, 3> tree(three_points);
  const cairn::DescriptorIndex index(three_points);
#include "snippets/index/batch_search_1.inc"
  REQUIRE(hits.size() == 30);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(hits[10 * i].id == i);
    CHECK(hits[10 * i + 3].id == cairn::no_point);
    CHECK(two[i].id() == i);
  }
}

TEST_CASE("docs: the example of multi_kd_tree.hpp finds what was not erased") {
  const auto& points = three_points;
  const std::array query{0.9F, 0.1F, 0.0F};
  const std::array low{-1.0F, -1.0F, -1.0F}, high{9.0F, 9.0F, 9.0F};
  std::vector<cairn::PointId> used;
  const auto use = [&](cairn::PointId id) { used.push_back(id); };
  Closest collector;
#include "snippets/index/multi_kd_tree_1.inc"
  CHECK(collector.id == 1);
  std::sort(used.begin(), used.end());
  CHECK(used == std::vector<cairn::PointId>{1, 2});
}

TEST_CASE("docs: the example of axis_metrics.hpp takes the shorter way round") {
  const std::vector<std::array<float, 3>> poses{{0, 0, 3}, {0, 0, 1}};
#include "snippets/index/axis_metrics_1.inc"
  const auto hit = tree.nearest(std::array{0.0F, 0.0F, -3.0F});
  REQUIRE(hit);
  CHECK(hit->id == 0);
  CHECK(hit->distance == doctest::Approx(2 * (2 * std::numbers::pi - 6)).epsilon(1e-5));
}

TEST_CASE("docs: the example of points.hpp shows foreign points as points") {
  struct Foreign {
    float x, y, z;
  };
  const std::vector<Foreign> cloud{{1, 2, 3}};
#include "snippets/index/points_1.inc"
  CHECK(points[0][0] == 1);
  CHECK(points[0][1] == 2);
  CHECK(points[0][2] == 3);
}

TEST_CASE("docs: the example of nearest_first.hpp stops at the first point that suits") {
  const cairn::KdTree<float, 3> tree(three_points);
  const std::array query{0.9F, 0.1F, 0.0F};
  std::vector<cairn::PointId> asked;
  const auto suits = [&](cairn::PointId id) {
    asked.push_back(id);
    return id == 0;
  };
#include "snippets/index/nearest_first_1.inc"
  CHECK(asked == std::vector<cairn::PointId>{1, 0});
}

TEST_CASE("docs: the example of packed_points.hpp finds each descriptor") {
  const Descriptors descriptors = some_descriptors();
  const Descriptors queries(descriptors.begin(), descriptors.begin() + 5);
  std::size_t looked = 0;
  const auto look_at = [&](const auto&) { ++looked; };
#include "snippets/index/packed_points_1.inc"
  CHECK(looked == 10);
}

TEST_CASE("docs: the example of descriptor_index.hpp finds a descriptor") {
  const Descriptors descriptors = some_descriptors();
  const auto& query = descriptors[42];
  std::vector<cairn::PointId> used;
  const auto use = [&](cairn::PointId id, float distance) {
    CHECK(distance == 0);
    used.push_back(id);
  };
#include "snippets/index/descriptor_index_1.inc"
  CHECK(two.id() == 42);
  CHECK(used == std::vector<cairn::PointId>{42});
}

TEST_CASE("docs: the example of inner_product.hpp finds the largest products") {
  const Descriptors descriptors = some_descriptors();
  const auto& query = descriptors[42];
  std::vector<float> products;
  const auto use = [&](cairn::PointId id, float product) {
    float sum = 0;
    for (std::size_t a = 0; a < 64; ++a) sum += query[a] * descriptors[id][a];
    CHECK(product == doctest::Approx(sum));
    products.push_back(product);
  };
#include "snippets/index/inner_product_1.inc"
  CHECK(products.size() == 5);
}

TEST_CASE("docs: the example of descriptor_file.hpp brings an index back") {
  const Descriptors descriptors = some_descriptors();
  cairn::DescriptorIndex index(descriptors);
  std::stringstream in;
  auto& out = in;
#include "snippets/index/descriptor_file_1.inc"
  CHECK(again.nearest(descriptors[42])->id == 42);
}

TEST_CASE("docs: the example of kd_forest.hpp finds a descriptor") {
  const Descriptors descriptors = some_descriptors();
  const auto& query = descriptors[42];
#include "snippets/index/kd_forest_1.inc"
  CHECK(two.id() == 42);
}

TEST_CASE("docs: the example of landmark_store.hpp sees again what it added") {
  struct Frame {
    std::vector<float> descriptors;
    std::vector<unsigned> labels;
    [[nodiscard]] std::span<const float> descriptor(std::size_t i) const {
      return std::span(descriptors).subspan(64 * i, 64);
    }
  };
  Frame same;
  for (const auto& descriptor : some_descriptors()) {
    same.descriptors.insert(same.descriptors.end(), descriptor.begin(), descriptor.end());
    same.labels.push_back(static_cast<unsigned>(same.labels.size() % 2));
  }
  const std::vector<Frame> frames{same, same, same};
  const cairn::RatioTest test{.ratio = 1.25F};
  const cairn::Budget budget;
#include "snippets/index/landmark_store_1.inc"
  CHECK(store.size() == 100);
  CHECK(store.base_size() == 100);
}

}  // namespace docs_index_test
