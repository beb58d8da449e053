// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/vision/features.hpp>

namespace features_test {
namespace {

/// A detector and a descriptor of somebody else's, in the fewest lines.
struct CornerOfTheImage {
  std::vector<cairn::Keypoint> detect(cairn::ImageView) { return {cairn::Keypoint{}}; }
};
struct GreyLevel {
  cairn::Features describe(cairn::ImageView image, std::span<const cairn::Keypoint> keypoints) {
    cairn::Features features;
    features.dimension = 1;
    for (const cairn::Keypoint& keypoint : keypoints) {
      features.keypoints.push_back(keypoint);
      features.descriptors.push_back(image(static_cast<int>(keypoint.x), static_cast<int>(keypoint.y)));
    }
    return features;
  }
};
static_assert(cairn::Detector<CornerOfTheImage> && !cairn::Descriptor<CornerOfTheImage>);
static_assert(cairn::Descriptor<GreyLevel> && !cairn::Detector<GreyLevel>);

template <cairn::Detector D, cairn::Descriptor E>
cairn::Features features_of(cairn::ImageView image, D detector, E descriptor) {
  return descriptor.describe(image, detector.detect(image));
}

constexpr auto lambda = [](cairn::ImageView) { return cairn::Features{}; };
static_assert(cairn::FeatureExtractor<decltype(lambda)>);
static_assert(!cairn::FeatureExtractor<GreyLevel>);

}  // namespace

TEST_SUITE("features") {
  TEST_CASE("Features: a pipeline written for the concepts takes anybody's detector and descriptor") {
    const cairn::Features features = features_of(cairn::Image(4, 4, 9), CornerOfTheImage{}, GreyLevel{});
    REQUIRE(features.size() == 1);
    CHECK(features.descriptor(0)[0] == 9);
  }

  TEST_CASE("Features: descriptor i is row i of the matrix") {
    cairn::Features features;
    features.keypoints.resize(2);
    features.dimension = 3;
    features.descriptors = {1, 2, 3, 4, 5, 6};
    CHECK(features.descriptor(1).size() == 3);
    CHECK(features.descriptor(1)[0] == 4);
  }
}

}  // namespace features_test
