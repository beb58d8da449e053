// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// What was moved from is empty, and serves again like one that is new.
#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <sstream>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/shared_array.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/brute_force.hpp>
#include <cairn/index/descriptor_file.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/kd_forest.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/landmark_ledger.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/multi_tree_file.hpp>
#include <cairn/index/nearest_first.hpp>
#include <cairn/index/packed_points.hpp>
#include <cairn/index/shared_kd_tree.hpp>
#include <cairn/index/tree_file.hpp>

namespace moved_from_test {
namespace {

constexpr std::size_t wide = 20;  // more than boxes have

template <std::size_t Dim>
std::vector<std::array<float, Dim>> grid_of(std::size_t count) {
  std::vector<std::array<float, Dim>> points(count);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t a = 0; a < Dim; ++a) points[i][a] = static_cast<float>((i * (2 * a + 3)) % 101);
  return points;
}

/// Every search comes back empty, under a budget too.
template <class I, class Query>
void check_empty(const I& index, const Query& query) {
  CHECK(index.size() == 0);
  CHECK(index.empty());
  CHECK_FALSE(index.nearest(query).has_value());
  CHECK(index.nearest(query, 3).empty());
  CHECK(index.nearest(query, 3, cairn::Budget{2}).empty());
  CHECK(index.within(query, std::numeric_limits<float>::infinity()).empty());
  std::size_t visited = 0;
  index.for_each([&](cairn::PointId, std::span<const float>) { ++visited; });
  CHECK(visited == 0);
}

/// By a constructor, by an assignment, and to itself, which leaves it as empty; `index` is used up.
template <class I, class Query>
void check_moved(I index, const Query& query) {
  const std::size_t size = index.size();
  REQUIRE(size > 0);
  I first(std::move(index));
  CHECK(first.size() == size);
  check_empty(index, query);  // NOLINT(bugprone-use-after-move)
  I second = first;
  second = std::move(first);
  CHECK(second.size() == size);
  CHECK(second.nearest(query).has_value());
  check_empty(first, query);  // NOLINT(bugprone-use-after-move)
  I& itself = second;
  second = std::move(itself);
  check_empty(second, query);  // NOLINT(bugprone-use-after-move)
}

TEST_SUITE("index") {
  TEST_CASE("moved from: trees of few and of many dimensions are empty") {
    const auto narrow = grid_of<3>(500);
    const auto points = grid_of<wide>(500);
    check_moved(cairn::KdTree<float, 3>(narrow), narrow[7]);
    check_moved(cairn::KdTree<float>(narrow), narrow[7]);
    check_moved(cairn::KdTree<float>(points), points[7]);
    check_moved(cairn::BruteForce<float>(points), points[7]);
    check_moved(cairn::KdForest<wide>(points), points[7]);

    cairn::KdTree<float, 3> tree(narrow);
    const cairn::KdTree<float, 3> other(std::move(tree));
    CHECK(cairn::inside(tree, std::array{-1.0F, -1.0F, -1.0F}, std::array{9.0F, 9.0F, 9.0F}).empty());
    CHECK_FALSE(cairn::NearestFirst(tree, narrow[0]).next().has_value());
    std::stringstream file;
    cairn::save_tree(file, tree);
    CHECK(cairn::load_tree<cairn::KdTree<float, 3>>(file, "file").empty());
  }

  TEST_CASE("moved from: a growing tree grows from nothing, of any dimension, whoever merges") {
    const auto points = grid_of<3>(30);
    for (const auto merging : {cairn::Merging::at_once, cairn::Merging::spread, cairn::Merging::background}) {
      cairn::MultiKdTree<float> index({.first_size = 16, .growth = 2, .merging = merging});
      for (int i = 0; i < 10; ++i) index.insert(points);
      for (cairn::PointId id = 0; id < 60; id += 2) index.erase(id);
      check_moved(index, points[3]);
      const cairn::MultiKdTree<float> taken(std::move(index));
      CHECK(taken.size() == 270);
      CHECK_FALSE(index.contains(1));
      CHECK_FALSE(index.erase(1));
      CHECK(index.points_moved() == 0);
      CHECK(index.insert(grid_of<5>(40)) == 0);
      CHECK(index.size() == 40);
      CHECK(index.dimension() == 5);
      for (cairn::PointId id = 0; id < 30; ++id) CHECK(index.erase(id));
      CHECK(index.size() == 10);
      CHECK(index.nearest(grid_of<5>(1)[0], 100).size() == 10);
      std::stringstream file;
      cairn::save_tree(file, index);
      CHECK(cairn::load_tree<cairn::MultiKdTree<float>>(file, "file").size() == 10);
    }
  }

  TEST_CASE("moved from: an index of descriptors is empty, and takes points again") {
    const auto points = grid_of<wide>(600);
    using Cells = cairn::DescriptorIndex<std::vector<std::array<float, wide>>>;
    for (const auto codes : {cairn::DescriptorCodes::off, cairn::DescriptorCodes::on}) {
      Cells index(points, {.codes = codes});
      check_moved(index, points[7]);
      const Cells taken(std::move(index));
      CHECK_FALSE(index.coded());
      CHECK_FALSE(index.erase(7));
      std::stringstream file;
      cairn::save_tree(file, index);
      CHECK(cairn::load_tree<Cells>(file, "file", points).empty());
      index.insert(100, 50);
      CHECK(index.size() == 50);
      CHECK(index.coded() == taken.coded());
      CHECK(index.nearest(points[120])->id == 120);
    }
  }

  TEST_CASE("moved from: packed points, landmarks, and what shares its nodes") {
    const auto points = grid_of<3>(40);
    cairn::PackedPoints packed(points);
    const cairn::PackedPoints all(std::move(packed));
    CHECK(packed.empty());
    CHECK(packed.size() == 0);
    CHECK(all.size() == 40);

    cairn::LandmarkLedger ledger;
    for (int i = 0; i < 5; ++i) ledger.add();
    ledger.trust(2);
    ledger.advance();
    const cairn::LandmarkLedger landmarks(std::move(ledger));
    CHECK(landmarks.size() == 5);
    CHECK(landmarks.base_size() == 1);
    CHECK(ledger.size() == 0);
    CHECK(ledger.base_size() == 0);
    CHECK(ledger.step() == 0);
    CHECK(ledger.add() == 0);
    CHECK(ledger.size() == 1);

    cairn::SharedArray<int> array;
    array.write(5000) = 7;
    cairn::SharedArray<int> kept(std::move(array));
    CHECK(array.size() == 0);
    CHECK(array[5000] == 0);
    array.write(3) = 1;
    CHECK(array[3] == 1);
    CHECK(array[5000] == 0);
    CHECK(kept[5000] == 7);

    cairn::SharedKdTree<2> tree;
    for (unsigned i = 0; i < 100; ++i) tree.insert({1.0 * i, 2.0}, i);
    cairn::SharedKdTree<2> copy = tree;
    copy.insert({0.5, 0.5}, 100);
    const cairn::SharedKdTree<2> grown(std::move(copy));
    CHECK(grown.size() == 101);
    CHECK(grown.node_copies() > 0);
    CHECK(copy.size() == 0);
    CHECK(copy.node_copies() == 0);
    copy.insert({3.0, 4.0}, 5);
    CHECK(copy.size() == 1);
    CHECK(grown.size() == 101);
  }
}

}  // namespace
}  // namespace moved_from_test
