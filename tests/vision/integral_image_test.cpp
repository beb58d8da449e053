// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstdint>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/vision/integral_image.hpp>

#include "support/random.hpp"
#include "vision/pictures.hpp"

namespace integral_image_test {
namespace {

std::uint32_t pixel_by_pixel(const cairn::Image& image, int x0, int y0, int x1, int y1) {
  std::uint32_t sum = 0;
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) sum += image(x, y);
  return sum;
}

}  // namespace

TEST_SUITE("integral_image") {
  TEST_CASE("IntegralImage: a box sums what pixel by pixel sums, in images of any shape") {
    const std::uint64_t seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const auto up_to = [&](int most) {
      return static_cast<int>(random.below(static_cast<std::uint64_t>(most) + 1));
    };
    for (int trial = 0; trial < 200; ++trial) {
      const int width = 1 + up_to(39), height = 1 + up_to(39);
      const cairn::Image image = cairn_test::noise(width, height, random());
      const cairn::IntegralImage sums(image);
      const int x0 = up_to(width), y0 = up_to(height);
      const int x1 = x0 + up_to(width - x0), y1 = y0 + up_to(height - y0);
      CHECK(sums.box(x0, y0, x1, y1) == pixel_by_pixel(image, x0, y0, x1, y1));
    }
  }

  TEST_CASE("IntegralImage: boxes stay exact where the sums have passed 2^32") {
    const cairn::Image white(4200, 4200, 255);  // 4.5e9 in all
    const cairn::IntegralImage sums(white);
    CHECK(sums.box(4100, 4100, 4200, 4200) == 100U * 100U * 255U);
    CHECK(sums.row(4200)[4200] == static_cast<std::uint32_t>(4200ULL * 4200ULL * 255ULL));
  }

  TEST_CASE("IntegralImage: an object assigned a smaller image knows nothing of the larger one") {
    cairn::IntegralImage reused(cairn_test::noise(50, 40, 1));
    const cairn::Image small = cairn_test::noise(17, 23, 2);
    reused.assign(small);
    const cairn::IntegralImage fresh(small);
    for (int y = 0; y <= 23; ++y)
      for (int x = 0; x <= 17; ++x) CHECK(reused.row(y)[x] == fresh.row(y)[x]);
  }

  TEST_CASE("IntegralImage: an image without pixels has no sums") {
    const cairn::IntegralImage sums{cairn::Image()};
    CHECK(sums.width() == 0);
    CHECK(sums.box(0, 0, 0, 0) == 0);
  }
}

}  // namespace integral_image_test
