// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// SURF: finds blobs in an image and describes each by 64 or 128 numbers.
///
/// ```cpp
/// const cairn::Features features = cairn::surf(image, {.upright = true, .target_count = 2000});
/// ```
///
/// The detector is in fast_hessian.hpp, the direction in surf_orientation.hpp, the numbers in
/// surf_descriptor.hpp. H. Bay, A. Ess, T. Tuytelaars and L. Van Gool, "Speeded-up robust features (SURF)",
/// CVIU 110(3), 2008. The algorithm has been patented (US 8,165,401; EP 1 850 270): see docs/vision.md before
/// shipping it. Nothing else in cairn depends on this header; pipelines take any FeatureExtractor.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/version.hpp>
#include <cairn/vision/detail/surf_descriptor.hpp>
#include <cairn/vision/detail/surf_orientation.hpp>
#include <cairn/vision/fast_hessian.hpp>
#include <cairn/vision/features.hpp>
#include <cairn/vision/image.hpp>
#include <cairn/vision/integral_image.hpp>
#include <cairn/vision/keypoint_selection.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Thresholds of other programs in the unit used here, (grey levels)^2 with the filters divided by their
/// area. OpenSURF scales the image to 0..1; OpenCV divides each box by its own area and weighs Dxy more, so
/// the last one holds only where Dxy is small. dlib's unit is the same as ours.
[[nodiscard]] constexpr float threshold_from_opensurf(float threshold) noexcept {
  return threshold * 65025.0F;
}
[[nodiscard]] constexpr float threshold_from_opencv(float threshold) noexcept {
  return threshold / 29.16F;
}

/// Sub-regions of the descriptor: those of Bay et al., or those of M-SURF, which overlap.
enum class SurfLayout { plain, overlapping };

struct SurfOptions {
  bool upright = false;  ///< leave out the direction: faster and more distinct where the camera does not roll
  bool extended = false;  ///< 128 numbers instead of 64
  SurfLayout layout = SurfLayout::overlapping;
  float threshold = 30.0F;  ///< least response [(grey levels)^2]
  int target_count = 0;     ///< keep this many of the strongest; 0 keeps all
  int grid_columns = 1;     ///< with a target: spread it evenly over this many cells
  int grid_rows = 1;
  int octaves = 4;
  int intervals = 4;
  int initial_step = 1;
};

/// SURF with its memory, reused from image to image; models Detector, Descriptor and FeatureExtractor. The
/// outcome is the same for every number of threads and for every history of the object. One object per
/// thread.
class Surf {
public:
  /// Throws Error when an option is out of its range, naming it.
  explicit Surf(const SurfOptions& options = {}, unsigned threads = 1)
      : options_(options),
        threads_(std::max(threads, 1U)),
        detector_({options.octaves, options.intervals, options.initial_step, options.threshold}) {
    if (options.target_count < 0)
      raise("SURF: expected a target_count of at least 0, found " + std::to_string(options.target_count));
    if (options.grid_columns < 1 || options.grid_rows < 1)
      raise("SURF: expected a grid of at least 1 x 1 cells, found " + std::to_string(options.grid_columns) +
            " x " + std::to_string(options.grid_rows));
  }

  [[nodiscard]] const SurfOptions& options() const noexcept { return options_; }

  /// Numbers a descriptor has.
  [[nodiscard]] int dimension() const noexcept { return options_.extended ? 128 : 64; }

  /// Keypoints and descriptors, strongest first. The reference lasts until the next call. An image without
  /// room for a filter has none.
  const Features& operator()(ImageView image) {
    sums_.assign(image);
    find(features_.keypoints);
    describe_all(features_, !options_.upright);
    return features_;
  }

  /// The keypoints alone, strongest first, with their direction.
  [[nodiscard]] std::vector<Keypoint> detect(ImageView image) {
    std::vector<Keypoint> keypoints;
    sums_.assign(image);
    find(keypoints);
    if (!options_.upright) find_angles(keypoints);
    return keypoints;
  }

  /// Descriptors of given keypoints, in their order; their angles are obeyed, and at_rim is set anew. Throws
  /// Error naming the keypoint that lies outside the image or whose scale or angle is no such thing.
  [[nodiscard]] Features describe(ImageView image, std::span<const Keypoint> keypoints) {
    Features features;
    features.keypoints.assign(keypoints.begin(), keypoints.end());
    for (std::size_t i = 0; i < keypoints.size(); ++i) check(keypoints[i], i, image);
    sums_.assign(image);
    describe_all(features, false);
    return features;
  }

private:
  static void check(const Keypoint& keypoint, std::size_t index, ImageView image) {
    const auto position = "SURF: keypoint " + std::to_string(index) + ": expected ";
    if (!(keypoint.x >= -0.5F && keypoint.y >= -0.5F &&
          keypoint.x <= static_cast<float>(image.width()) - 0.5F &&
          keypoint.y <= static_cast<float>(image.height()) - 0.5F))
      raise(position + "a place in the image of " + std::to_string(image.width()) + " x " +
            std::to_string(image.height()) + " pixels, found (" + std::to_string(keypoint.x) + ", " +
            std::to_string(keypoint.y) + ")");
    if (!(keypoint.scale > 0) || !std::isfinite(keypoint.scale))
      raise(position + "a positive scale, found " + std::to_string(keypoint.scale));
    if (!std::isfinite(keypoint.angle)) raise(position + "a finite angle");
    if (image.empty()) raise(position + "an image with pixels to describe it by");
  }

  void find(std::vector<Keypoint>& keypoints) {
    detector_(sums_, keypoints, threads_);
    const std::size_t count =
        options_.target_count > 0 ? static_cast<std::size_t>(options_.target_count) : keypoints.size();
    const bool grid = options_.grid_columns > 1 || options_.grid_rows > 1;
    if (grid && options_.target_count > 0 && !keypoints.empty())
      keep_strongest_spread(keypoints, count, sums_.width(), sums_.height(), options_.grid_columns,
                            options_.grid_rows);
    else
      keep_strongest(keypoints, count);
  }

  void find_angles(std::vector<Keypoint>& keypoints) const {
    parallel_for(keypoints.size(), threads_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Keypoint& keypoint = keypoints[i];
        detail::NeighbourhoodCells cells;
        detail::sample_cells(sums_, keypoint.x, keypoint.y, keypoint.scale, cells);
        keypoint.angle = detail::dominant_angle(cells);
      }
    });
  }

  void describe_all(Features& features, bool find_angle) const {
    features.dimension = dimension();
    const auto columns = static_cast<std::size_t>(dimension());
    features.descriptors.resize(features.size() * columns);
    parallel_for(features.size(), threads_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Keypoint& keypoint = features.keypoints[i];
        detail::describe_keypoint(sums_, keypoint, find_angle, options_.layout == SurfLayout::overlapping,
                                  options_.extended, features.descriptors.data() + i * columns);
        keypoint.at_rim = detail::reaches_over_rim(sums_, keypoint);
      }
    });
  }

  SurfOptions options_;
  unsigned threads_;
  FastHessian detector_;
  IntegralImage sums_;
  Features features_;
};

/// SURF of one image. For a sequence of images a Surf object saves the allocations.
[[nodiscard]] inline Features surf(ImageView image, const SurfOptions& options = {}, unsigned threads = 1) {
  Surf extractor(options, threads);
  return extractor(image);
}

static_assert(FeatureExtractor<Surf> && Detector<Surf> && Descriptor<Surf>);

}}  // namespace cairn::CAIRN_ABI
