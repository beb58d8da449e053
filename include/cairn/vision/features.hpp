// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Points found in an image, the numbers that describe them, and what a pipeline may ask of whatever finds
/// them.
///
/// A pipeline that takes a FeatureExtractor runs on SURF, or on SIFT, ORB or a learned detector behind a few
/// lines of adapter; descriptors are compared by Euclidean distance (bits as numbers 0 and 1 make its square
/// the Hamming distance).
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>
#include <cairn/vision/image.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A blob in an image.
struct Keypoint {
  float x = 0;                ///< column of the centre [pixels]; the centre of a pixel has integers
  float y = 0;                ///< row of the centre [pixels], downwards
  float scale = 1;            ///< standard deviation of the matching Gaussian [pixels]
  float angle = 0;            ///< direction from +x towards +y [rad] in (-pi, pi]; 0 where upright
  float response = 0;         ///< strength; larger is more distinct
  std::int8_t laplacian = 0;  ///< -1 bright on dark, +1 dark on bright; unlike signs never match
  bool at_rim = false;        ///< the description reaches over the image's rim, so it is less certain

  friend bool operator==(const Keypoint&, const Keypoint&) = default;
};

/// Keypoints with one descriptor each: a matrix of keypoints.size() rows and `dimension` columns, row by row.
struct Features {
  std::vector<Keypoint> keypoints;
  std::vector<float> descriptors;
  int dimension = 0;

  [[nodiscard]] std::size_t size() const noexcept { return keypoints.size(); }

  /// The descriptor of keypoint i < size().
  [[nodiscard]] std::span<const float> descriptor(std::size_t i) const noexcept {
    CAIRN_ASSERT(i < size(), "descriptor: no such keypoint");
    const std::size_t columns = static_cast<std::size_t>(dimension);
    return {descriptors.data() + i * columns, columns};
  }
};

/// Finds points in an image.
template <class D>
concept Detector = requires(D& detector, ImageView image) {
  { detector.detect(image) } -> std::convertible_to<std::vector<Keypoint>>;
};

/// Describes given points of an image, in their order.
template <class D>
concept Descriptor = requires(D& descriptor, ImageView image, std::span<const Keypoint> keypoints) {
  { descriptor.describe(image, keypoints) } -> std::convertible_to<Features>;
};

/// Does both at once: extractor(image) gives Features, or a reference to them that lasts until the next call.
template <class E>
concept FeatureExtractor = requires(E& extractor, ImageView image) {
  { extractor(image) } -> std::convertible_to<const Features&>;
};

}}  // namespace cairn::CAIRN_ABI
