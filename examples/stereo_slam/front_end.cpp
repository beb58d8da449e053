// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "front_end.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <cairn/core/parallel.hpp>

#include "stopwatch.hpp"

namespace stereo_slam {
namespace {

FeatureOptions of_one_side(FeatureOptions features, unsigned threads) {
  features.threads = std::max(1U, threads / 2);
  return features;
}

}  // namespace

FrontEnd::FrontEnd(const FeatureOptions& features, unsigned threads)
    : features_(of_one_side(features, threads)),
      threads_(threads),
      left_(make_extractor(features_)),
      right_(make_extractor(features_)) {}

void FrontEnd::make_extractors() {
  features_.evenly = left_alone_ && left_alone_->evenly;
  left_ = make_extractor(features_, left_alone_ ? left_alone_->cells[0] : HiddenCells());
  right_ = make_extractor(features_, left_alone_ ? left_alone_->cells[1] : HiddenCells());
}

void FrontEnd::keep(int points) {
  if (points == features_.points) return;
  features_.points = points;
  make_extractors();
}

void FrontEnd::leave_alone(std::shared_ptr<const HiddenParts> parts) {
  if (parts == left_alone_) return;
  left_alone_ = std::move(parts);
  make_extractors();
}

FramePoints FrontEnd::operator()(const StereoFrame& frame, std::shared_ptr<const StereoMatcher> matcher) {
  FramePoints points;
  points.wanted = features_.points;
  points.left_alone = left_alone_;
  {
    const Stopwatch watch(points.detect_milliseconds);
    cairn::parallel_for(2, threads_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t side = begin; side < end; ++side)
        (side == 0 ? points.left : points.right) = side == 0 ? left_(frame.left) : right_(frame.right);
    });
  }
  if (!matcher) return points;
  const Stopwatch watch(points.stereo_milliseconds);
  points.pairs = (*matcher)(frame.left, points.left, frame.right, points.right, threads_);
  points.matched_by = std::move(matcher);
  return points;
}

}  // namespace stereo_slam
