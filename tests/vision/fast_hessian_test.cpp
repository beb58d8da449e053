// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
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

using Place = std::array<float, 3>;  // x, y, response

/// Every sample of every octave computed by itself, and the 26 around it compared one by one.
std::vector<Place> maxima(const cairn::IntegralImage& sums, const cairn::FastHessianOptions& options) {
  std::vector<Place> found;
  for (int index = 0; index < options.octaves; ++index) {
    const cairn::detail::Octave octave(index, options.intervals, options.initial_step);
    const int columns = (sums.width() + octave.step - 1) / octave.step,
              rows = (sums.height() + octave.step - 1) / octave.step;
    cairn::detail::ColumnPhases phases;
    phases.assign(sums, octave.step);
    std::vector<std::uint32_t> scratch(static_cast<std::size_t>(3 * phases.line()));
    const auto at = [&](int layer, int y, int x) {
      return static_cast<std::size_t>((layer * rows + y) * columns + x);
    };
    std::vector<float> responses(at(octave.count, 0, 0), std::numeric_limits<float>::quiet_NaN());
    for (int layer = 0; layer < octave.count; ++layer) {
      const cairn::detail::BoxFilter box = octave.filters[static_cast<std::size_t>(layer)];
      const auto fits = [&](int i, int length) {
        return i * octave.step >= box.border() && i * octave.step + box.border() < length;
      };
      for (int y = 0; y < rows; ++y)
        for (int x = 0; x < columns; ++x)
          if (fits(y, sums.height()) && fits(x, sums.width()))
            cairn::detail::hessian_row(
                cairn::detail::HessianTaps(phases, box, x * octave.step, y * octave.step), box.weight(), 1,
                &responses[at(layer, y, x)], scratch.data());
    }
    const auto consider = [&](int layer, int y, int x) {
      cairn::detail::Neighbourhood around;
      bool before = true, largest = true;
      for (int l = 0; l < 3; ++l)
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i) {
            const float one = responses[at(layer - 1 + l, y - 1 + j, x - 1 + i)];
            around[static_cast<std::size_t>(l)][static_cast<std::size_t>(j)][static_cast<std::size_t>(i)] =
                one;
            const bool middle = l == 1 && j == 1 && i == 1;
            before = before && !middle;
            const float centre = responses[at(layer, y, x)];
            largest = largest && (middle || (before ? centre > one : centre >= one));  // not of NaN
          }
      const auto peak = cairn::detail::fit_peak(around);
      if (largest && around[1][1][1] >= options.threshold && peak && std::abs(peak->x) <= 1 &&
          std::abs(peak->y) <= 1 && std::abs(peak->layer) <= 1)
        found.push_back({static_cast<float>((x + peak->x) * octave.step),
                         static_cast<float>((y + peak->y) * octave.step), static_cast<float>(peak->height)});
    };
    for (int y = 1; y + 1 < rows; ++y)
      for (int layer = 1; layer + 1 < octave.count; ++layer)
        for (int x = 1; x + 1 < columns; ++x) consider(layer, y, x);
  }
  return found;
}

}  // namespace

TEST_SUITE("fast_hessian") {
  TEST_CASE("FastHessian: finds the maxima of every octave as if it had no other, in the same order") {
    const cairn::Image image = cairn_test::texture(131, 197, 31);
    const cairn::IntegralImage sums(image);
    for (const cairn::FastHessianOptions& options :
         {cairn::FastHessianOptions{.threshold = 1},
          cairn::FastHessianOptions{.octaves = 3, .intervals = 3, .threshold = 1},
          cairn::FastHessianOptions{.octaves = 3, .intervals = 6, .initial_step = 2, .threshold = 0}})
      for (const unsigned threads : {1U, 3U}) {
        std::vector<Place> found;
        for (const cairn::Keypoint& one : detect(image, options, threads))
          found.push_back({one.x, one.y, one.response});
        CHECK(found.size() > 20);
        CHECK(found == maxima(sums, options));
      }
  }

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
