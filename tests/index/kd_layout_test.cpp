// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include <doctest/doctest.h>

#include <cairn/index/detail/kd_layout.hpp>
#include <cairn/index/kd_tree.hpp>

#include "support/folder.hpp"
#include "support/random.hpp"

namespace kd_layout_test {
namespace {

/// What the definition says: floor(a b / c). No product here has more than 61 bits.
std::uint64_t ratio(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  return a * b / c;
}

/// The layout of so many points by its definition, at some of its slots and leaves.
template <class Size>
void check_layout(std::uint64_t points, cairn::Random& random) {
  const cairn::detail::LayoutOf<Size> layout(static_cast<Size>(points));
  const std::uint64_t leaves = ratio(points + 15, 1, 16);
  REQUIRE(layout.leaves() == leaves);
  REQUIRE((std::uint64_t{1} << layout.depth()) >= leaves);
  REQUIRE((layout.depth() == 0 || (std::uint64_t{1} << (layout.depth() - 1)) < leaves));
  for (int round = 0; round < 40; ++round) {
    const std::uint64_t leaf = round == 0 ? leaves - 1 : random.below(leaves);
    const std::uint64_t first = layout.first_point(static_cast<Size>(leaf));
    const std::uint64_t end = layout.first_point(static_cast<Size>(leaf + 1));
    REQUIRE(first == ratio(leaf, points, leaves));
    REQUIRE(end == ratio(leaf + 1, points, leaves));
    REQUIRE(end > first);
    REQUIRE(end - first <= 16);
    const auto depth = static_cast<unsigned>(random.below(layout.depth() + 1U));
    const std::uint64_t slots = std::uint64_t{1} << depth;
    const std::uint64_t slot = round == 0 ? slots - 1 : random.below(slots);
    const auto below = layout.leaves_below(depth, static_cast<Size>(slot));
    REQUIRE(below.begin == ratio(slot, leaves, slots));
    REQUIRE(below.end == ratio(slot + 1, leaves, slots));
  }
  REQUIRE(layout.first_point(static_cast<Size>(leaves)) == points);
}

/// Points that are made when asked for: many of many coordinates cost nothing.
struct Made {
  std::size_t count;
  std::size_t dim;
  struct Point {
    std::size_t dim;
    using size_type = std::size_t;
    [[nodiscard]] std::size_t size() const { return dim; }
    [[nodiscard]] float operator[](std::size_t axis) const { return static_cast<float>(axis % 7); }
  };
  [[nodiscard]] std::size_t size() const { return count; }
  [[nodiscard]] Point operator[](std::size_t) const { return {dim}; }
};

}  // namespace

TEST_SUITE("kd_layout") {
  TEST_CASE("kd_layout: sizes of 32 bits hold every tree that ids of 32 bits can number") {
    const std::uint64_t seed = cairn_test::seed(203);
    CAPTURE(seed);
    cairn::Random random(seed);
    for (std::uint64_t points : {1ULL, 16ULL, 17ULL, 262144ULL, 262145ULL, 1048577ULL, 16777217ULL,
                                 0x7fffffffULL, 0x80000001ULL, 0xfffffffeULL}) {
      CAPTURE(points);
      check_layout<std::uint32_t>(points, random);
      check_layout<std::uint64_t>(points, random);
    }
    for (int round = 0; round < 300; ++round) {
      const std::uint64_t points = 1 + random.below(std::uint64_t{1} << (1 + random.below(32)));
      CAPTURE(points);
      if (points < 0xffffffffULL) check_layout<std::uint32_t>(points, random);
    }
  }

  TEST_CASE("kd_layout: more coordinates than memory has addresses are refused, not wrapped around") {
    const std::size_t half = std::size_t{1} << (4 * sizeof(std::size_t));
    const Made points{half / 2, 4 * half};  // the product is 2 once more than there are numbers
    CHECK(cairn_test::message_of([&] { cairn::KdTree<float> tree(points); }).find("KdTree: point: ") == 0);
  }
}

}  // namespace kd_layout_test
