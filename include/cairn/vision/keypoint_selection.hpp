// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Keeping a wanted number of keypoints: the strongest, spread over the image by choice, and a threshold that
/// follows the scene.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>
#include <cairn/vision/features.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Total order by falling response / scale; place and scale settle ties, so that the outcome does not depend
/// on the order of arrival. The scale counts because a blob is located with an error that grows with it:
/// among equally clear blobs the smaller one is worth more (measured: docs/vision.md).
[[nodiscard]] inline bool stronger(const Keypoint& a, const Keypoint& b) noexcept {
  const float of_a = a.response / a.scale;
  const float of_b = b.response / b.scale;
  if (of_a != of_b) return of_a > of_b;
  if (a.y != b.y) return a.y < b.y;
  if (a.x != b.x) return a.x < b.x;
  return a.scale < b.scale;
}

namespace detail {

/// stronger() as a sort can inline it, which a pointer to a function it cannot.
inline void sort_by_strength(std::vector<Keypoint>& keypoints) {
  std::sort(keypoints.begin(), keypoints.end(),
            [](const Keypoint& a, const Keypoint& b) { return stronger(a, b); });
}

}  // namespace detail

/// Sorts by strength and keeps the first `count`. O(n log n).
inline void keep_strongest(std::vector<Keypoint>& keypoints, std::size_t count) {
  if (count < keypoints.size()) {
    const auto end = keypoints.begin() + static_cast<std::ptrdiff_t>(count);
    std::nth_element(keypoints.begin(), end, keypoints.end(),
                     [](const Keypoint& a, const Keypoint& b) { return stronger(a, b); });
    keypoints.erase(end, keypoints.end());
  }
  detail::sort_by_strength(keypoints);
}

/// As keep_strongest, but each of columns x rows equal cells of the width x height image first gets an equal
/// share of `count` for its own strongest; what cells leave unused goes to the strongest of the rest. Of more
/// cells than `count` none has a share, so the strongest of all are kept.
inline void keep_strongest_spread(std::vector<Keypoint>& keypoints, std::size_t count, int width, int height,
                                  int columns, int rows) {
  CAIRN_EXPECTS(width > 0 && height > 0 && columns > 0 && rows > 0, "a grid has at least one cell");
  const auto grid = static_cast<std::uint64_t>(columns) * static_cast<std::uint64_t>(rows);
  if (grid > count) return keep_strongest(keypoints, count);
  detail::sort_by_strength(keypoints);
  if (keypoints.size() <= count) return;
  const auto cells = static_cast<std::size_t>(grid);
  const std::size_t share = count / cells;
  const auto index = [](float position, int length, int parts) {
    const double part = std::floor((double{position} + 0.5) * parts / length);
    return static_cast<std::size_t>(std::clamp(part, 0.0, parts - 1.0));
  };
  std::vector<std::size_t> taken(cells, 0);
  std::vector<Keypoint> rest;
  std::vector<Keypoint> kept;
  kept.reserve(count);
  for (const Keypoint& keypoint : keypoints) {
    const std::size_t cell = index(keypoint.y, height, rows) * static_cast<std::size_t>(columns) +
                             index(keypoint.x, width, columns);
    const bool fits = taken[cell] < share;
    taken[cell] += fits ? 1 : 0;
    (fits ? kept : rest).push_back(keypoint);
  }
  const std::size_t missing = std::min(count - kept.size(), rest.size());
  kept.insert(kept.end(), rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(missing));
  detail::sort_by_strength(kept);
  keypoints.swap(kept);
}

/// A detection threshold that follows the scene from frame to frame towards a wanted number of points. The
/// number found is about inversely proportional to the threshold, so the threshold is scaled by found /
/// target, by at most `largest_change` a frame, and left alone within the tolerance.
struct AdaptiveThreshold {
  float value = 30.0F;
  std::size_t target = 2000;
  float tolerance = 0.1F;
  float largest_change = 0.2F;
  float lowest = 1.0F;
  float highest = 10000.0F;

  /// Learns how many points `value` has found; gives the value for the next frame.
  float observe(std::size_t found) noexcept {
    const float ratio = static_cast<float>(found) / static_cast<float>(std::max<std::size_t>(target, 1));
    if (std::abs(ratio - 1) > tolerance)
      value = std::clamp(value * std::clamp(ratio, 1 - largest_change, 1 + largest_change), lowest, highest);
    return value;
  }
};

}}  // namespace cairn::CAIRN_ABI
