// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A right camera that is pitched against what its rig says.
///
/// Half a degree moves the rows of the right image by six pixels of KITTI's, and pairs are looked for within
/// two: what is left are points that happen to look alike. Looked for twenty rows away true pairs are found
/// as before (the first frames of three drives: 943 to 1123 for 992 to 1141 whose grey levels agree), and how
/// far they lie from where the rig has them says how the camera is pitched.
#pragma once

#include <optional>
#include <span>

#include <cairn/geometry/stereo_rig.hpp>

#include "dataset.hpp"
#include "front_end.hpp"
#include "stereo_matcher.hpp"

namespace stereo_slam {

/// No camera is taken to be turned by more [rad].
inline constexpr double largest_pitch = 0.05;

struct LevelledRig {
  cairn::StereoRig rig;  ///< the right camera turned about its x axis so that pairs share a row
  double angle = 0;      ///< by which it is turned [rad]
  double rows = 0;       ///< how far the rows were apart [pixels]
};

/// The rig levelled, where half as many pairs again are found by it as `pairs`, those of the rig as it is: of
/// both only those whose grey levels agree. Nothing where that is not so, where two thirds of `pairs` agree,
/// nor where the options refine no pairs.
[[nodiscard]] std::optional<LevelledRig> levelled(const cairn::StereoRig& rig,
                                                  const StereoMatcherOptions& options,
                                                  const StereoFrame& frame, const FramePoints& points,
                                                  std::span<const PointPair> pairs, unsigned threads);

}  // namespace stereo_slam
