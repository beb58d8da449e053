// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "feature_choice.hpp"

#include <memory>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/vision/surf.hpp>

#ifdef EXAMPLES_HAVE_OPENCV
#include "support/opencv_features.hpp"
#endif

namespace stereo_slam {
namespace {

/// std::function copies what it holds; an extractor stays one, with its memory.
template <cairn::FeatureExtractor E>
Extractor shared(E extractor) {
  return [kept = std::make_shared<E>(std::move(extractor))](
             cairn::ImageView image) -> const cairn::Features& { return (*kept)(image); };
}

}  // namespace

bool built_with_opencv() noexcept {
#ifdef EXAMPLES_HAVE_OPENCV
  return true;
#else
  return false;
#endif
}

Extractor make_extractor(const FeatureOptions& options) {
  if (options.kind == FeatureKind::surf) {
    cairn::SurfOptions surf;
    surf.upright = !options.oriented;
    surf.target_count = options.points;
    surf.threshold = options.surf_threshold;
    return shared(cairn::Surf(surf, options.threads));
  }
#ifdef EXAMPLES_HAVE_OPENCV
  return shared(options.kind == FeatureKind::sift ? example::OpenCvFeatures::sift(options.points)
                                                  : example::OpenCvFeatures::orb(options.points));
#else
  cairn::raise("SIFT and ORB are OpenCV's, which was not found when this was built (Debian: libopencv-dev)");
#endif
}

}  // namespace stereo_slam
