// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a frame shows before anything is known of where the camera is: the interest points of both images
/// and, as long as the rig is not being corrected, which of them are the same point.
///
/// No estimate has a part in it, so it may be computed ahead of the frame's turn and on any thread
/// (frames_ahead.hpp), and is the same wherever that happens.
#pragma once

#include <memory>
#include <vector>

#include <cairn/vision/features.hpp>

#include "dataset.hpp"
#include "feature_choice.hpp"
#include "hidden_cells.hpp"
#include "stereo_matcher.hpp"

namespace stereo_slam {

/// The points of one frame.
struct FramePoints {
  cairn::Features left, right;
  int wanted = 0;  ///< as many as were looked for in an image
  /// Where matched_by is there: the pairs that it found.
  std::vector<PointPair> pairs;
  std::shared_ptr<const StereoMatcher> matched_by;
  std::shared_ptr<const HiddenParts> left_alone;  ///< only few were looked for there
  double detect_milliseconds = 0;                 ///< that the points took
  double stereo_milliseconds = 0;                 ///< that the pairs took
};

/// Has the memory of its extractors: one object a thread.
class FrontEnd {
public:
  /// On up to `threads` threads; the points do not depend on it. `features.threads` is not looked at.
  FrontEnd(const FeatureOptions& features, unsigned threads);
  FrontEnd(FrontEnd&&) = default;
  FrontEnd& operator=(FrontEnd&&) = default;

  /// From now on so many points are kept in an image, the strongest. The points do not depend on what was
  /// kept before. Where the number changes the extractors are made anew.
  void keep(int points);

  /// From now on parts of the images are left alone (nullptr: none): what is kept lies elsewhere, but for a
  /// tenth as many more that show whether the parts still look as they did. OpenCV's points are not chosen by
  /// where they lie.
  void leave_alone(std::shared_ptr<const HiddenParts> parts);

  /// The points of a frame; their pairs where there is a matcher.
  [[nodiscard]] FramePoints operator()(const StereoFrame& frame,
                                       std::shared_ptr<const StereoMatcher> matcher = nullptr);

private:
  void make_extractors();

  FeatureOptions features_;  // of one image
  unsigned threads_;
  Extractor left_, right_;
  std::shared_ptr<const HiddenParts> left_alone_;
};

}  // namespace stereo_slam
