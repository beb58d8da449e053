// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A second look: once the pose is known, landmarks are searched for where they must be.
///
/// The ratio test drops a landmark that looks like another one. Without the second look such landmarks would
/// enter the map again, and the twins then fail the ratio test for ever.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>

#include "landmark_store.hpp"
#include "landmarks.hpp"

namespace stereo_slam {

/// A stereo pair of points that nothing is known of yet.
struct FreePoint {
  std::uint32_t point;  ///< a number of the caller's choosing
  cairn::Vector<2> left_pixel, right_pixel;
  Look look;
};

/// A landmark that may be in view.
struct ExpectedLandmark {
  LandmarkId id;
  cairn::Vector<3> position;  ///< world [m]
  Look look;
};

struct GuidedMatch {
  std::uint32_t point;
  LandmarkId landmark;
};

struct GuidedMatchingOptions {
  double radius = 8;           ///< around where the pose predicts a landmark, in both images [pixels]
  double max_distance = 0.45;  ///< of unit descriptors
};

/// Each free point with the landmark predicted near it that looks most like it, one to one, most alike first;
/// equally alike ones in the order of their numbers.
[[nodiscard]] std::vector<GuidedMatch> match_guided(const cairn::StereoRig& rig,
                                                    const cairn::SE3& T_world_camera,
                                                    std::vector<FreePoint> points,
                                                    std::span<const ExpectedLandmark> landmarks,
                                                    const GuidedMatchingOptions& options);

}  // namespace stereo_slam
