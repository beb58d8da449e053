// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "feature_choice.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/vision/keypoint_selection.hpp>
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

/// Points that are chosen by where they lie.
class SurfBeside {
public:
  SurfBeside(const cairn::SurfOptions& options, unsigned threads, HiddenCells hidden)
      : wanted_(static_cast<std::size_t>(options.target_count)),
        surf_(all_of(options), threads),
        hidden_(std::move(hidden)) {}

  const cairn::Features& operator()(cairn::ImageView image) {
    std::vector<cairn::Keypoint> kept = surf_.detect(image);
    const auto end = std::ranges::partition(
        kept, [&](const cairn::Keypoint& point) { return !hidden_.hides(point.x, point.y); });
    std::vector<cairn::Keypoint> within(end.begin(), end.end());
    kept.erase(end.begin(), end.end());
    cairn::keep_strongest(kept, wanted_);
    cairn::keep_strongest(within, wanted_ / 10);
    kept.insert(kept.end(), within.begin(), within.end());
    features_ = surf_.describe(image, kept);
    return features_;
  }

private:
  static cairn::SurfOptions all_of(cairn::SurfOptions options) {
    options.target_count = 0;
    return options;
  }

  std::size_t wanted_;
  cairn::Surf surf_;
  HiddenCells hidden_;
  cairn::Features features_;
};

}  // namespace

bool built_with_opencv() noexcept {
#ifdef EXAMPLES_HAVE_OPENCV
  return true;
#else
  return false;
#endif
}

Extractor make_extractor(const FeatureOptions& options, HiddenCells hidden) {
  if (options.kind == FeatureKind::surf) {
    cairn::SurfOptions surf;
    surf.upright = !options.oriented;
    surf.target_count = options.points;
    surf.threshold = options.surf_threshold;
    if (options.evenly) {
      surf.grid_columns = 12;
      surf.grid_rows = 8;
    }
    if (hidden.count() > 0) return shared(SurfBeside(surf, options.threads, std::move(hidden)));
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
