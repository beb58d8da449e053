// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The frames of a run with their points, read and worked on while the pipeline is busy with those before.
///
///   read and decode -> points of both images -> stereo pairs  =>  bounded queue  =>  pipeline
///
/// The cut is where the estimate begins to matter. Stereo pairs stand before it while the rig is settled; a
/// rig that is being corrected decides which points are pairs, so there they are left to the pipeline.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "dataset.hpp"
#include "front_end.hpp"
#include "support/ahead.hpp"

namespace stereo_slam {

/// A frame, and what could be said of it ahead.
struct FrameAhead {
  StereoFrame frame;
  double load_milliseconds = 0;
  FramePoints points;
};

/// So many of a run's threads work on frames ahead, the one that takes among them. The work on a frame before
/// the cut is about as much as that behind it: more than four would wait for the pipeline.
[[nodiscard]] constexpr unsigned threads_ahead(unsigned threads) noexcept {
  return std::clamp(threads, 1U, 4U);
}

/// So many share the work on one frame behind the cut, where one at least is busy ahead of it. While the
/// queue is full the others are free for it; until then some wait for each other.
[[nodiscard]] constexpr unsigned threads_behind(unsigned threads) noexcept {
  return std::max(threads, 2U) - 1;
}

/// One thread takes. The frames are the same for every number of `threads`, which are those of the whole run.
/// At most twice as many frames are in memory as threads work ahead.
class FramesAhead {
public:
  /// The data set has to outlive it.
  FramesAhead(const Dataset& dataset, const FeatureOptions& features, unsigned threads);

  /// The next frame. Throws cairn::Error where it cannot be read, after all frames before.
  [[nodiscard]] FrameAhead take() { return ahead_.take(); }

  /// From now on the pairs are found as well, by this matcher (nullptr: not).
  void match_by(std::shared_ptr<const StereoMatcher> matcher);
  /// From now on these parts of the images are left alone, in frames that are under way not yet.
  void leave_alone(std::shared_ptr<const HiddenParts> parts);
  /// From now on so many points are kept in an image. In frames that are under way it is as before: with more
  /// than one thread it depends on the clock which frame is the first.
  void keep(int points);

private:
  [[nodiscard]] FrameAhead make(std::size_t i, unsigned thread);

  const Dataset& dataset_;
  std::vector<FrontEnd> front_ends_;  // one a thread
  std::mutex mutex_;
  std::shared_ptr<const StereoMatcher> matcher_;  // under the mutex, as the next
  std::shared_ptr<const HiddenParts> left_alone_;
  int points_;
  example::Ahead<FrameAhead> ahead_;  // the last member: its threads use the others
};

}  // namespace stereo_slam
