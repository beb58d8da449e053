// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "riding_cells.hpp"

#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>

namespace riding_cells_test {
namespace {

using stereo_slam::RidingCells;
using Pixels = std::vector<cairn::Vector<2>>;

cairn::Features points_like(std::uint64_t seed) {
  cairn::Random random(seed);
  cairn::Features points;
  points.dimension = 4;
  for (int i = 0; i < 6; ++i) {
    cairn::Keypoint point;
    point.x = static_cast<float>(random.uniform(121, 139));
    point.y = static_cast<float>(random.uniform(121, 139));
    points.keypoints.push_back(point);
    for (int k = 0; k < 4; ++k) points.descriptors.push_back(k == i % 4 ? 1.0F : 0.0F);
  }
  return points;
}

}  // namespace

TEST_SUITE("riding cells") {
  TEST_CASE("riding cells: a cell is left out after three frames, and not where most of it moves") {
    RidingCells image(240, 240);
    const Pixels still(5, {130, 130}), moved(5, {30, 30}), few(2, {30, 30});
    for (int frame = 0; frame < 2; ++frame) image.judge(still, moved);
    CHECK(image.share() == 0);
    CHECK(image.suspects({130, 130}));
    image.judge(still, moved);
    CHECK(image.hidden().hides(125, 135));
    CHECK_FALSE(image.hidden().hides(145, 130));
    CHECK(image.hidden().count() == 1);
    for (int frame = 0; frame < 9; ++frame) image.judge(few, moved);
    for (int frame = 0; frame < 9; ++frame)
      image.judge(frame % 2 == 0 ? moved : Pixels(), frame % 2 == 1 ? moved : Pixels());
    CHECK_FALSE(image.hidden().hides(30, 30));
  }

  TEST_CASE(
      "riding cells: a cell is given back when it shows something else, and not for one frame that does") {
    RidingCells image(240, 240);
    for (int frame = 0; frame < 3; ++frame) image.judge(Pixels(5, {130, 130}), {});
    for (int frame = 0; frame < 200; ++frame) {
      image.watch(frame % 7 == 6 ? points_like(50) : points_like(1));
      REQUIRE(image.hidden().count() == 1);
    }
    for (std::uint64_t frame = 0; frame < 7; ++frame) image.watch(points_like(60 + frame));
    CHECK(image.hidden().count() == 1);
    image.watch(points_like(70));
    CHECK(image.hidden().count() == 0);
  }
}

}  // namespace riding_cells_test
