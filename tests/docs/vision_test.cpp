// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// The examples in the headers of cairn/vision and in docs/vision.md, compiled and run: see CMakeLists.txt.
#include <cstddef>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/vision/image.hpp>
#include <cairn/vision/surf.hpp>

namespace docs_vision_test {

constexpr int width = 96, height = 72, stride = 100;

/// Grey with a bright disc about (40, 30).
std::vector<std::uint8_t> disc() {
  std::vector<std::uint8_t> grey(static_cast<std::size_t>(stride) * height, 60);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if ((x - 40) * (x - 40) + (y - 30) * (y - 30) < 36)
        grey[static_cast<std::size_t>(y * stride + x)] = 200;
  return grey;
}

TEST_CASE("docs: the example of image.hpp looks at the pixels of another library") {
  struct {
    const std::uint8_t* data;
    int cols, rows, step;
  } mat;
  const std::vector<std::uint8_t> grey = disc();
  mat = {grey.data(), width, height, stride};
#include "snippets/vision/image_1.inc"
  CHECK(view(40, 30) == 200);
  CHECK(view(4, 30) == 60);
}

TEST_CASE("docs: the example of surf.hpp finds the disc") {
  const std::vector<std::uint8_t> grey = disc();
  const cairn::ImageView image(grey.data(), width, height, stride);
#include "snippets/vision/surf_1.inc"
  REQUIRE(!features.keypoints.empty());
  CHECK(features.keypoints[0].x == doctest::Approx(40).epsilon(0.02));
}

TEST_CASE("docs: the example of docs/vision.md finds the disc") {
  const std::vector<std::uint8_t> grey = disc();
  const std::uint8_t* const pixels = grey.data();
  float x = 0;
  std::size_t numbers = 0;
  const auto use = [&](float column, const auto& descriptor) { x = column, numbers = descriptor.size(); };
#include "snippets/docs/vision_1.inc"
  CHECK(x == doctest::Approx(40).epsilon(0.02));
  CHECK(numbers == 64);
}

}  // namespace docs_vision_test
