// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Where the detector says that an edge is, against where it was drawn.
#include "segment_detector.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/vision/image.hpp>

namespace segment_detector_test {
namespace {

using cairn::Vector;

constexpr int size = 128;
const Vector<2> middle(64, 64);

/// A dark and a bright half plane: bright where normal . (p - middle) > offset. A pixel has the mean over its
/// square, which lies about its whole-numbered place.
cairn::Image half_planes(const Vector<2>& normal, double offset) {
  constexpr int samples = 16;
  cairn::Image image(size, size);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      int bright = 0;
      for (int i = 0; i < samples * samples; ++i) {
        const Vector<2> inside((i / samples + 0.5) / samples - 0.5, (i % samples + 0.5) / samples - 0.5);
        bright += normal.dot(Vector<2>(x, y) + inside - middle) > offset;
      }
      image(x, y) = static_cast<std::uint8_t>(50 + 150 * bright / (samples * samples));
    }
  return image;
}

}  // namespace

TEST_SUITE("line_slam/segment_detector") {
  TEST_CASE(
      "line_slam: whole numbers of a detected segment are the middles of pixels, whichever way it lies") {
    if (!line_slam::has_segment_detector()) {
      MESSAGE("skipped: OpenCV's line segment detector, without OpenCV");
      return;
    }
    for (const double degrees : {0.0, 90.0, 180.0, 270.0, 20.0, 45.0, 110.0, 200.0, 290.0}) {
      CAPTURE(degrees);
      const double angle = degrees * std::numbers::pi / 180;
      const Vector<2> normal(std::cos(angle), std::sin(angle));
      cairn::RunningMoments off;
      for (int tenth = 0; tenth < 10; ++tenth) {
        const double offset = 0.1 * tenth;
        std::vector<cairn::LineSegment> found;
        try {
          found = line_slam::segments_of(half_planes(normal, offset), 60);
        } catch (const cairn::Error& error) {
          MESSAGE("skipped: ", error.what());
          return;
        }
        REQUIRE(found.size() == 1);
        for (const Vector<2>& end : {found[0].from, found[0].to}) off.add(normal.dot(end - middle) - offset);
      }
      MESSAGE(degrees, " degrees: ", off.mean(), " pixels");
      CHECK(std::abs(off.mean()) < 0.06);
    }
  }
}

}  // namespace segment_detector_test
