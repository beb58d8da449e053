// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Detectors of other libraries behind cairn's FeatureExtractor, as far as they were found when building.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <cairn/vision/features.hpp>

namespace vision_bench {

/// Finds and describes about the `count` strongest points, on one thread.
struct Extractor {
  std::string name;
  std::function<cairn::Features(cairn::ImageView image, int count)> run;
};

/// "dlib SURF", then "OpenCV SIFT", "OpenCV ORB", "OpenCV AKAZE". Bits of binary descriptors become the
/// numbers 0 and 1, the square root of whose Hamming distance is what the ratio test sees.
std::vector<Extractor> rival_extractors();

/// The image coded as JPEG of this quality and decoded; nothing without OpenCV.
std::optional<cairn::Image> jpeg_coded(const cairn::Image& image, int quality);

}  // namespace vision_bench
