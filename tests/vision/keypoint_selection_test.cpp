// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/vision/keypoint_selection.hpp>

#include "support/random.hpp"

namespace keypoint_selection_test {
namespace {

std::vector<cairn::Keypoint> scattered(std::size_t count, std::uint64_t seed) {
  cairn::Random random(seed);
  std::vector<cairn::Keypoint> keypoints(count);
  for (cairn::Keypoint& keypoint : keypoints) {
    keypoint.x = static_cast<float>(99 * random.uniform() * random.uniform());  // crowded at the left
    keypoint.y = static_cast<float>(random.uniform(0, 79));
    keypoint.scale = static_cast<float>(random.uniform(1, 8));
    keypoint.response = static_cast<float>(random.below(50));  // many ties
  }
  return keypoints;
}

}  // namespace

TEST_SUITE("keypoint_selection") {
  TEST_CASE("keep_strongest: keeps what a full sort keeps, whatever the order of arrival") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    std::vector<cairn::Keypoint> sorted = scattered(500, seed);
    std::sort(sorted.begin(), sorted.end(), cairn::stronger);
    for (const std::size_t count : {0UL, 1UL, 77UL, 500UL, 900UL}) {
      std::vector<cairn::Keypoint> kept = scattered(500, seed);
      std::reverse(kept.begin(), kept.end());
      cairn::keep_strongest(kept, count);
      CHECK(kept ==
            std::vector<cairn::Keypoint>(
                sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(std::min(count, 500UL))));
    }
  }

  TEST_CASE("stronger: of equal responses the smaller scale wins, and no keypoint beats itself") {
    cairn::Keypoint small, large;
    small.response = large.response = 10;
    small.scale = 1;
    large.scale = 2;
    CHECK(cairn::stronger(small, large));
    CHECK_FALSE(cairn::stronger(large, small));
    CHECK_FALSE(cairn::stronger(small, small));
  }

  TEST_CASE("stronger: responses are told per scale") {
    cairn::Keypoint small, large;
    small.response = 10;
    large.response = 30;
    small.scale = 1;
    large.scale = 4;
    CHECK(cairn::stronger(small, large));
    CHECK_FALSE(cairn::stronger(large, small));
    large.response = 50;
    CHECK(cairn::stronger(large, small));
  }

  TEST_CASE("keep_strongest_spread: gives every cell its share, and the whole number in the end") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    std::vector<cairn::Keypoint> kept = scattered(2000, seed);
    cairn::keep_strongest_spread(kept, 400, 100, 80, 4, 2);
    CHECK(kept.size() == 400);
    CHECK(std::is_sorted(kept.begin(), kept.end(), cairn::stronger));
    std::vector<int> in_cell(8, 0);
    for (const cairn::Keypoint& keypoint : kept) {
      const int column = static_cast<int>((keypoint.x + 0.5F) / 25), row = keypoint.y < 39.5F ? 0 : 1;
      ++in_cell[static_cast<std::size_t>(row * 4 + column)];
    }
    const std::vector<cairn::Keypoint> all = scattered(2000, seed);
    for (int column = 0; column < 4; ++column)
      for (int row = 0; row < 2; ++row) {
        const auto available = std::count_if(all.begin(), all.end(), [&](const cairn::Keypoint& keypoint) {
          return static_cast<int>((keypoint.x + 0.5F) / 25) == column && (keypoint.y < 39.5F ? 0 : 1) == row;
        });
        CHECK(in_cell[static_cast<std::size_t>(row * 4 + column)] >= std::min<std::ptrdiff_t>(50, available));
      }
  }

  TEST_CASE(
      "keep_strongest_spread: what a cell has is its strongest, and what is left over the strongest of all") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    const auto cell = [](const cairn::Keypoint& keypoint) {
      return static_cast<int>((keypoint.x + 0.5F) / 25) + (keypoint.y < 39.5F ? 0 : 4);
    };
    const std::vector<cairn::Keypoint> all = scattered(2000, seed);
    // Taken are those that fewer than 50 of their own cell beat, then the best of the others.
    std::vector<cairn::Keypoint> expected, others;
    for (const cairn::Keypoint& keypoint : all) {
      const auto better = std::count_if(all.begin(), all.end(), [&](const cairn::Keypoint& other) {
        return cell(other) == cell(keypoint) && cairn::stronger(other, keypoint);
      });
      (better < 50 ? expected : others).push_back(keypoint);
    }
    std::sort(others.begin(), others.end(), cairn::stronger);
    REQUIRE(expected.size() < 400);
    expected.insert(expected.end(), others.begin(),
                    others.begin() + static_cast<std::ptrdiff_t>(400 - expected.size()));
    std::sort(expected.begin(), expected.end(), cairn::stronger);
    std::vector<cairn::Keypoint> kept = all;
    cairn::keep_strongest_spread(kept, 400, 100, 80, 4, 2);
    CHECK(kept == expected);
  }

  TEST_CASE("keep_strongest_spread: of more cells than are kept none has a share, however many there are") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    std::vector<cairn::Keypoint> strongest = scattered(500, seed);
    cairn::keep_strongest(strongest, 60);
    const int most = std::numeric_limits<int>::max();
    for (const auto& grid : {std::pair{61, 1}, {8, 8}, {65536, 65536}, {most, most}, {most, 2}}) {
      const int columns = grid.first, rows = grid.second;
      CAPTURE(columns);
      std::vector<cairn::Keypoint> kept = scattered(500, seed);
      cairn::keep_strongest_spread(kept, 60, 100, 80, columns, rows);
      CHECK(kept == strongest);
    }
  }

  TEST_CASE("AdaptiveThreshold: settles within its tolerance where the number falls with the threshold") {
    cairn::AdaptiveThreshold threshold;
    threshold.value = 500;
    threshold.target = 1000;
    std::size_t found = 0;
    for (int frame = 0; frame < 40; ++frame) {
      found = static_cast<std::size_t>(60000.0F / threshold.value);
      const float before = threshold.value;
      const float after = threshold.observe(found);
      CHECK(after <= 1.2001F * before);
      CHECK(after >= 0.7999F * before);
    }
    CHECK(found > 900);
    CHECK(found < 1100);
    for (int frame = 0; frame < 100; ++frame) threshold.observe(0);
    CHECK(threshold.value == threshold.lowest);
  }
}

}  // namespace keypoint_selection_test
