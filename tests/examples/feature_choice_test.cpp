// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "feature_choice.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "landmark_store.hpp"
#include "support/folder.hpp"
#include "vision/pictures.hpp"

namespace feature_choice_test {
namespace {

using stereo_slam::FeatureKind;

std::vector<FeatureKind> kinds() {
  std::vector<FeatureKind> all{FeatureKind::surf};
  if (stereo_slam::built_with_opencv())
    all.insert(all.end(), {FeatureKind::sift, FeatureKind::orb});
  else
    MESSAGE("SIFT and ORB are not tried: built without OpenCV");
  return all;
}

float squared_distance(std::span<const float> a, std::span<const float> b) {
  float sum = 0;
  for (std::size_t n = 0; n < a.size(); ++n) sum += (a[n] - b[n]) * (a[n] - b[n]);
  return sum;
}

struct Count {
  std::size_t found = 0, right = 0;
};

/// Ratio-test matches of a picture with itself shifted by (dx, dy), by anybody's features.
template <cairn::FeatureExtractor Extractor>
Count match_shifted(Extractor& extract, cairn::ImageView first, cairn::ImageView second, float dx, float dy) {
  const cairn::Features before = extract(first);
  const cairn::Features& after = extract(second);
  Count count;
  for (std::size_t i = 0; i < before.size(); ++i) {
    float best = INFINITY, next = INFINITY;
    std::size_t partner = 0;
    for (std::size_t j = 0; j < after.size(); ++j) {
      if (before.keypoints[i].laplacian != after.keypoints[j].laplacian) continue;
      const float distance = squared_distance(before.descriptor(i), after.descriptor(j));
      if (distance < best) partner = j;
      next = std::min(next, std::max(distance, best));
      best = std::min(best, distance);
    }
    if (!(best < 0.64F * next)) continue;
    ++count.found;
    const cairn::Keypoint &a = before.keypoints[i], &b = after.keypoints[partner];
    // ORB's coarse corners stand on the pixels of a coarse picture.
    count.right += std::hypot(a.x - dx - b.x, a.y - dy - b.y) < 1 + a.scale ? 1U : 0U;
  }
  return count;
}

}  // namespace

TEST_SUITE("feature_choice") {
  TEST_CASE("make_extractor: a shifted, darker picture is matched by every kind of points") {
    const cairn::Image whole = cairn_test::texture(460, 340, 3);
    const auto window = [&](int left, int top, double gain) {
      return cairn_test::picture(
          430, 320, [&](int x, int y) { return cairn_test::grey(gain * whole(x + left, y + top)); });
    };
    for (const FeatureKind kind : kinds()) {
      CAPTURE(dimension_of(kind));
      stereo_slam::Extractor extract = stereo_slam::make_extractor({.kind = kind, .points = 400});
      const cairn::Image first = window(0, 0, 1), second = window(13, 7, 0.8);
      const Count count = match_shifted(extract, first, second, 13, 7);
      CHECK(count.found > 100);
      CHECK(static_cast<double>(count.right) > 0.9 * static_cast<double>(count.found));
      const cairn::Features once = extract(first);
      CHECK(once.dimension == dimension_of(kind));
      CHECK(once.descriptors.size() == once.size() * static_cast<std::size_t>(once.dimension));
      CHECK(extract(first).keypoints == once.keypoints);
      CHECK(extract(first).descriptors == once.descriptors);
    }
  }

  TEST_CASE("make_extractor: evenly there are points beside what has the strongest, and no fewer in all") {
    const cairn::Image whole = cairn_test::texture(480, 320, 4);
    const cairn::Image image = cairn_test::picture(480, 320, [&](int x, int y) {
      return cairn_test::grey(x < 240 ? whole(x, y) : 120 + 0.4 * (whole(x, y) - 120));
    });
    const auto beside = [&](bool evenly) {
      stereo_slam::Extractor extract = stereo_slam::make_extractor({.points = 400, .evenly = evenly});
      const cairn::Features& points = extract(image);
      CHECK(points.size() == 400);
      return std::ranges::count_if(points.keypoints, [](const cairn::Keypoint& p) { return p.x > 250; });
    };
    const auto strongest = beside(false), evenly = beside(true);
    CAPTURE(strongest);
    CHECK(2 * strongest < evenly);
    CHECK(evenly > 120);
  }

  TEST_CASE("make_extractor: empty, plain and tiny pictures have no points") {
    for (const FeatureKind kind : kinds()) {
      stereo_slam::Extractor extract = stereo_slam::make_extractor({.kind = kind});
      for (const cairn::Image& image : {cairn::Image(), cairn::Image(120, 90, 99), cairn::Image(3, 2, 7)})
        CHECK(extract(image).size() == 0);
    }
  }

  TEST_CASE("make_extractor and make_landmark_store: what was not built is refused by name") {
    if (!stereo_slam::built_with_opencv()) {
      const std::string message =
          cairn_test::message_of([] { (void)stereo_slam::make_extractor({.kind = FeatureKind::sift}); });
      CHECK(message.find("libopencv-dev") != std::string::npos);
    }
    const std::string message =
        cairn_test::message_of([] { (void)stereo_slam::make_landmark_store({.dimension = 65}); });
    CHECK(message.find("65 numbers") != std::string::npos);
    CHECK(stereo_slam::make_landmark_store({.dimension = 64}) != nullptr);
  }
}

}  // namespace feature_choice_test
