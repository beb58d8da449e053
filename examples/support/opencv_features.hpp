// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// SIFT and ORB of OpenCV as FeatureExtractors: what an adapter of somebody else's detector looks like.
///
/// Descriptors come out with distances like those of unit vectors, so that the same gates serve them: SIFT's
/// 128 numbers scaled to unit length; ORB's 256 bits as numbers 0 and 1/16, whose distance is the square root
/// of Hamming's, over 16.
#pragma once

#include <memory>

#include <cairn/vision/features.hpp>

namespace cv {
class Feature2D;
}

namespace example {

/// One of OpenCV's detectors with the memory of its result; one object a thread.
class OpenCvFeatures {
public:
  /// About the `count` strongest points.
  [[nodiscard]] static OpenCvFeatures sift(int count);
  [[nodiscard]] static OpenCvFeatures orb(int count);

  /// Keypoints and descriptors, strongest first. The reference lasts until the next call. Throws cairn::Error
  /// with OpenCV's words where it refuses the image.
  const cairn::Features& operator()(cairn::ImageView image);

private:
  OpenCvFeatures(std::shared_ptr<cv::Feature2D> extractor, int dimension, float scale_of_size, float shift);

  std::shared_ptr<cv::Feature2D> extractor_;
  float scale_of_size_;  // what a keypoint's diameter is multiplied by
  float shift_;          // added to coordinates
  cairn::Features features_;
};

static_assert(cairn::FeatureExtractor<OpenCvFeatures>);

}  // namespace example
