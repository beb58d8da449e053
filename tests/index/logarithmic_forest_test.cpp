// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/index/multi_kd_tree.hpp>

#include "support/random.hpp"

namespace logarithmic_forest_test {

TEST_SUITE("logarithmic_forest") {
  TEST_CASE("logarithmic_forest: gives the memory of erased points back once they are more than the others") {
    cairn::Random random(cairn_test::seed());
    std::vector<std::array<float, 3>> points(4000);
    for (auto& point : points)
      for (float& number : point) number = static_cast<float>(random.uniform());
    for (const cairn::Merging merging : {cairn::Merging::at_once, cairn::Merging::spread}) {
      cairn::MultiKdTree<float, 3> index({.first_size = 64, .merging = merging});
      index.insert(points);
      index.finish_merges();
      const std::size_t full = index.bytes();
      for (cairn::PointId id = 0; id < 3900; ++id) REQUIRE(index.erase(id));
      index.finish_merges();
      CHECK(index.size() == 100);
      CHECK(index.bytes() < full / 4);
    }
  }
}

}  // namespace logarithmic_forest_test
