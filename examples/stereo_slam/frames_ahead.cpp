// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "frames_ahead.hpp"

#include <algorithm>
#include <utility>

#include "stopwatch.hpp"

namespace stereo_slam {
namespace {

std::vector<FrontEnd> one_a_thread(const FeatureOptions& features, unsigned threads) {
  std::vector<FrontEnd> front_ends;
  for (unsigned thread = 0; thread < threads_ahead(threads); ++thread) front_ends.emplace_back(features, 1);
  return front_ends;
}

}  // namespace

FramesAhead::FramesAhead(const Dataset& dataset, const FeatureOptions& features, unsigned threads)
    : dataset_(dataset),
      front_ends_(one_a_thread(features, threads)),
      points_(features.points),
      ahead_(dataset.size(), threads_ahead(threads), front_ends_.size() > 1 ? 2 * front_ends_.size() : 1,
             [this](std::size_t i, unsigned thread) { return make(i, thread); }) {}

void FramesAhead::match_by(std::shared_ptr<const StereoMatcher> matcher) {
  const std::lock_guard lock(mutex_);
  matcher_ = std::move(matcher);
}

void FramesAhead::leave_alone(std::shared_ptr<const HiddenParts> parts) {
  const std::lock_guard lock(mutex_);
  left_alone_ = std::move(parts);
}

void FramesAhead::keep(int points) {
  const std::lock_guard lock(mutex_);
  points_ = points;
}

FrameAhead FramesAhead::make(std::size_t i, unsigned thread) {
  FrameAhead made;
  {
    const Stopwatch watch(made.load_milliseconds);
    made.frame = dataset_.frame(i);
  }
  std::unique_lock lock(mutex_);
  std::shared_ptr<const StereoMatcher> matcher = matcher_;
  front_ends_[thread].keep(points_);
  front_ends_[thread].leave_alone(left_alone_);
  lock.unlock();
  made.points = front_ends_[thread](made.frame, std::move(matcher));
  return made;
}

}  // namespace stereo_slam
