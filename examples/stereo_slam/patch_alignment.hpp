// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where a small patch of the left image lies in the right one, to a fraction of a pixel.
///
/// Lucas and Kanade's method (IJCAI 1981) in the inverse form of Baker and Matthews (IJCV 56(3), 2004):
/// gradients of the left patch are computed once. The warp is what a plane does to a nearly rectified pair,
///   right(u + d_u + a x + b y, v + d_v),   x, y from the patch centre,
/// so that a slanted floor is matched as well as a wall; brightness may differ by a gain and an offset.
#pragma once

#include <optional>

#include <cairn/vision/image.hpp>

namespace stereo_slam {

struct PatchAlignment {
  float x = 0;  ///< where the patch centre lies in the other image [pixels]
  float y = 0;
  float stretch = 0;      ///< a: by how much columns lie farther apart there
  float shear = 0;        ///< b: how much farther right each row lies than the one above
  float sigma = 0;        ///< standard deviation of x that the residual and the gradients imply [pixels]
  float correlation = 0;  ///< normalised cross-correlation of the two patches, at most 1
};

/// Aligns the 11 x 11 patch of `left` around (left_x, left_y) with `right`, starting at (right_x, right_y).
/// Nothing where a patch leaves its image, has no gradient across, moves more than 2 pixels from its start or
/// does not settle.
[[nodiscard]] std::optional<PatchAlignment> align_patch(cairn::ImageView left, float left_x, float left_y,
                                                        cairn::ImageView right, float right_x, float right_y);

}  // namespace stereo_slam
