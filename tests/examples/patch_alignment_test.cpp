// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "patch_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <doctest/doctest.h>

namespace patch_alignment_test {
namespace {

constexpr int width = 64, height = 48;

/// A smooth texture with a known grey level everywhere, so that a shifted picture is exact and not resampled.
double texture(double x, double y) {
  return 120 + 40 * std::sin(0.55 * x + 0.2 * y) + 30 * std::cos(0.31 * x - 0.47 * y) +
         15 * std::sin(0.9 * y);
}

/// Grey level at (x, y) = gain * texture(x + d + a (x - 32) + b (y - 24), y) + offset.
cairn::Image picture(double d, double a = 0, double b = 0, double gain = 1, double offset = 0) {
  cairn::Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double grey = gain * texture(x + d + a * (x - 32) + b * (y - 24), y) + offset;
      image(x, y) = static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L));
    }
  return image;
}

}  // namespace

TEST_SUITE("patch_alignment") {
  TEST_CASE("align_patch: finds a shift to a fiftieth of a pixel") {
    const cairn::Image left = picture(0);
    for (const double shift : {-1.3, -0.5, 0.0, 0.25, 0.8, 1.6}) {
      CAPTURE(shift);
      const auto found = stereo_slam::align_patch(left, 32, 24, picture(shift), 32, 24);
      REQUIRE(found);
      CHECK(found->x == doctest::Approx(32 - shift).epsilon(0.02 / 32));
      CHECK(found->y == doctest::Approx(24).epsilon(0.02 / 24));
      CHECK(found->correlation > 0.99F);
      CHECK(found->sigma < 0.05F);
    }
  }

  TEST_CASE("align_patch: is not misled by a slanted surface or another exposure") {
    const auto slanted = stereo_slam::align_patch(picture(0), 32, 24, picture(0.6, 0.05, 0.15), 32, 24);
    REQUIRE(slanted);
    CHECK(std::abs(slanted->x - (32 - 0.6 / 1.05)) < 0.05);
    const auto darker = stereo_slam::align_patch(picture(0), 32, 24, picture(0.4, 0, 0, 0.7, 20), 32, 24);
    REQUIRE(darker);
    CHECK(std::abs(darker->x - 31.6) < 0.03);
  }

  TEST_CASE("align_patch: has no answer where the picture has none") {
    const cairn::Image left = picture(0);
    const cairn::Image flat(width, height, 90);
    CHECK_FALSE(stereo_slam::align_patch(flat, 32, 24, left, 32, 24));
    CHECK_FALSE(stereo_slam::align_patch(left, 32, 24, flat, 32, 24));
    CHECK_FALSE(stereo_slam::align_patch(left, 2, 24, left, 2, 24));
    CHECK_FALSE(stereo_slam::align_patch(left, 32, 24, left, 62, 24));
    CHECK_FALSE(stereo_slam::align_patch(cairn::Image(3, 3), 1, 1, cairn::Image(3, 3), 1, 1));
  }
}

}  // namespace patch_alignment_test
