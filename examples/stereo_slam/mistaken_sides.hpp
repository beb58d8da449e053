// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Left and right taken for one another, and baselines that are not in metres.
///
/// Images that are exchanged, a rig whose right camera stands on the wrong side or a thousand times too far,
/// leave hardly a true pair: what the matcher then finds are points that happen to look alike. Their grey
/// levels do not agree, where of true pairs most do. Only a frame like that is looked at in the other ways,
/// in one of which its grey levels agree if that is what is wrong.
#pragma once

#include <optional>
#include <span>
#include <string>

#include <cairn/geometry/stereo_rig.hpp>

#include "dataset.hpp"
#include "front_end.hpp"
#include "stereo_matcher.hpp"

namespace stereo_slam {

/// What is to be checked, where far more of a frame's points are pairs with the images exchanged or with the
/// right camera on the other side, or at distances that are not looked at, than are as it is said, by
/// `pairs`. Nothing where that is not so, nor where the matcher's options refine no pairs.
[[nodiscard]] std::optional<std::string> mistaken_sides(const cairn::StereoRig& rig,
                                                        const StereoMatcherOptions& options,
                                                        const StereoFrame& frame, const FramePoints& points,
                                                        std::span<const PointPair> pairs, unsigned threads);

}  // namespace stereo_slam
