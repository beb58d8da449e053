// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/index/kd_tree.hpp>

#include "index/generators.hpp"
#include "support/random.hpp"

namespace kd_builder_test {
namespace {

/// Everything that tells two trees apart: ids and coordinates in leaf order, then the splits.
template <class Tree>
std::vector<double> fingerprint(const Tree& tree) {
  std::vector<double> numbers;
  tree.for_each([&](cairn::PointId id, auto row) {
    numbers.push_back(id);
    numbers.insert(numbers.end(), row.begin(), row.end());
  });
  for (unsigned depth = 0; depth < tree.depth(); ++depth)
    for (std::size_t slot = 0; slot < std::size_t{1} << depth; ++slot) {
      if (cairn::detail::TreeAccess::layout(tree).leaves_below(depth, slot).size() < 2) continue;
      numbers.push_back(static_cast<double>(cairn::detail::TreeAccess::split(tree, depth, slot).value));
      numbers.push_back(cairn::detail::TreeAccess::split(tree, depth, slot).axis);
    }
  return numbers;
}

template <std::size_t Dim>
void check_threads(std::size_t count, const char* shape) {
  cairn::Random random(cairn_test::seed(71));
  const auto rows = cairn_test::make_points<float>(shape, count, Dim, random);
  const cairn::Rows<float> points(rows, Dim);
  const cairn::KdTree<float, Dim> alone(points);
  const auto expected = fingerprint(alone);
  const std::vector<float> query(Dim, 0.25F);
  for (const unsigned threads : {0U, 2U, 3U, 5U, 8U}) {
    CAPTURE(threads);
    CAPTURE(count);
    const cairn::KdTree<float, Dim> tree(points, {}, cairn::BuildOptions{.threads = threads});
    REQUIRE(fingerprint(tree) == expected);
    cairn::Work work;
    cairn::Work work_alone;
    cairn::Nearest<float> nearest;
    cairn::Nearest<float> nearest_alone;
    tree.search(query, nearest, &work);
    alone.search(query, nearest_alone, &work_alone);
    REQUIRE(nearest.id() == nearest_alone.id());
    REQUIRE(work == work_alone);  // the boxes are the same as well
  }
}

}  // namespace

TEST_SUITE("kd_builder") {
  TEST_CASE("kd_builder: the tree is the same for any number of threads") {
    for (const std::size_t count : {0U, 1U, 16U, 17U, 63U, 64U, 65U, 130U, 5000U, 30000U})
      check_threads<3>(count, "uniform");
    check_threads<3>(20000, "equal");
    check_threads<3>(20000, "line");
    for (const std::size_t count : {0U, 1U, 33U, 3000U}) check_threads<12>(count, "uniform");
  }

  TEST_CASE("kd_builder: a tree built piece by piece is the tree built at once") {
    for (const std::size_t count : {0U, 1U, 16U, 17U, 4097U, 9000U, 200000U}) {
      CAPTURE(count);
      cairn::Random random(cairn_test::seed(72));
      const auto rows = cairn_test::make_points<float>("uniform", count, 3, random);
      cairn::detail::KdBuilder<float, 3> builder(3);
      for (std::size_t i = 0; i < count; ++i) builder.add(static_cast<cairn::PointId>(i), &rows[3 * i]);
      std::size_t done = 0;
      std::size_t largest = 0;
      while (const std::size_t piece = builder.advance()) {
        done += piece;
        largest = std::max(largest, piece);
      }
      const auto tree =
          cairn::detail::TreeAccess::from_parts<cairn::KdTree<float, 3>>(builder.finish(), 3, {});
      CHECK(fingerprint(tree) == fingerprint(cairn::KdTree<float, 3>(cairn::Rows<float>(rows, 3))));
      CHECK(largest <= std::max<std::size_t>(count, 65536));  // a split of all, or a subtree of 4096 points
      const auto promised = static_cast<double>(builder.work(count));
      CHECK(static_cast<double>(done) <= 1.35 * promised);
      CHECK(static_cast<double>(done) >= 0.5 * promised);
    }
  }
}

}  // namespace kd_builder_test
