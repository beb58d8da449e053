// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/vision/fast_hessian.hpp>

#include "support/processors.hpp"
#include "vision/pictures.hpp"

namespace fast_hessian_test {
namespace {

std::vector<cairn::Keypoint> detect(cairn::ImageView image, const cairn::FastHessianOptions& options,
                                    unsigned threads = 1) {
  const cairn::IntegralImage sums(image);
  std::vector<cairn::Keypoint> found;
  cairn::FastHessian detector(options);
  detector(sums, found, threads);
  return found;
}

}  // namespace

TEST_SUITE("fast_hessian") {
  // Without AVX2, and off x86-64, the narrow rows are all there is: vector extensions, portable C++.
  TEST_CASE("FastHessian: the keypoints are the same bits by wide and by narrow vectors") {
    const cairn::Image image = cairn_test::texture(333, 257, 21), noise = cairn_test::noise(150, 131, 22);
    for (const cairn::ImageView view : {cairn::ImageView(image), cairn::ImageView(noise)})
      for (const int step : {1, 2, 3}) {
        const cairn::FastHessianOptions options{.initial_step = step, .threshold = 1};
        const auto by_choice = detect(view, options, 2);
        CHECK(by_choice.size() > 20);
        cairn_test::for_each_processor([&] { CHECK(detect(view, options, 2) == by_choice); });
      }
  }

  TEST_CASE("FastHessian: octaves, intervals and steps of every kind find a blob where it is") {
    constexpr double x = 120.25, y = 115.75, sigma = 5;
    const cairn::Image image = cairn_test::blob(241, 231, x, y, sigma, 100);
    for (const int octaves : {2, 3, 5})
      for (const int intervals : {3, 4, 6, 8})
        for (const int step : {1, 2, 3}) {
          CAPTURE(octaves);
          CAPTURE(intervals);
          CAPTURE(step);
          const auto found =
              detect(image, {.octaves = octaves, .intervals = intervals, .initial_step = step});
          REQUIRE_FALSE(found.empty());
          bool there = false;
          for (const cairn::Keypoint& keypoint : found)
            there = there || (std::hypot(keypoint.x - x, keypoint.y - y) < 0.1 * step &&
                              keypoint.scale > 0.6 * sigma && keypoint.scale < 0.95 * sigma);
          CHECK(there);
        }
  }

  TEST_CASE("FastHessian: a larger threshold keeps exactly the responses above it") {
    const cairn::Image image = cairn_test::texture(300, 240, 23);
    const auto all = detect(image, {.threshold = 5});
    const auto some = detect(image, {.threshold = 50});
    CHECK(some.size() < all.size());
    std::size_t above = 0;
    for (const cairn::Keypoint& keypoint : all) {
      const bool kept = std::find(some.begin(), some.end(), keypoint) != some.end();
      // The threshold is asked of the sample, the peak between samples is higher.
      if (kept) CHECK(keypoint.response >= 50);
      above += kept ? 1U : 0U;
    }
    CHECK(above == some.size());
  }
}

}  // namespace fast_hessian_test
