// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the surface around a landmark looked like when it was first seen, and where it is in another image.
///
/// A blob is a maximum at the scale of pixels, so that the place of one on a surface changes as the camera
/// comes nearer: the dark and the bright side of a stone are found farther apart from afar. The grey levels
/// around it stay where they are. With the disparity's slope the patch is a piece of a plane, whose inverse
/// depth is linear in the pixels of the view that it was taken from:
///   rho(o) = rho (1 + slope . o);   q(o) = R ray(o) + rho(o) t is then linear in o                      (1)
/// for (R, t) from that view to another, and q(o) over its third coordinate is where the other camera sees
/// it. The offset d for which grey(q(o + d)) is the patch up to gain and offset is found as in
/// patch_alignment.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/vision/image.hpp>

namespace stereo_slam {

/// A piece of an image and of the plane that it shows. Its place is wherever between pixels a landmark was
/// found: looked at from the same distance, patches around whole pixels would all lie at one part of a pixel,
/// and what linear interpolation does wrong there would turn the camera instead of averaging out
/// (docs/stereo_slam.md).
struct SurfacePatch {
  static constexpr int half = 5;             ///< it reaches so far to every side of its centre [pixels]
  static constexpr int side = 2 * half + 4;  ///< of what is kept: slopes and the part of a pixel need more
  cairn::Vector<2> pixel = cairn::Vector<2>::Zero();  ///< its centre, in the image that it is of
  cairn::Vector<2> slope = cairn::Vector<2>::Zero();  ///< of the inverse depth, over itself [1 / pixel]
  std::size_t keyframe = 0;                           ///< that took the image
  std::array<std::uint8_t, static_cast<std::size_t>(side* side)> grey{};

  /// Nothing where it leaves the image, or the place is none.
  [[nodiscard]] static std::optional<SurfacePatch> of(cairn::ImageView image, const cairn::Vector<2>& pixel,
                                                      const cairn::Vector<2>& slope, std::size_t keyframe);
};

struct FoundPatch {
  cairn::Vector<2> pixel;  ///< of the patch's centre
  double sigma = 0;        ///< of each coordinate, that the residual and the gradients imply [pixels]
  double correlation = 0;
};

/// Where the patch is in `image`. `T_now_then` leads from the camera that took it to the one of `image`, and
/// `inverse_depth` is that of its centre there [1/m]; the search begins at `expected`. Nothing where the
/// patch leaves the image, is seen from behind or on its edge, shows no place in both directions, is more
/// than 2 of its own pixels away or does not settle.
[[nodiscard]] std::optional<FoundPatch> find_patch(const SurfacePatch& patch,
                                                   const cairn::PinholeCamera& camera,
                                                   const cairn::SE3& T_now_then, double inverse_depth,
                                                   cairn::ImageView image, const cairn::Vector<2>& expected);

}  // namespace stereo_slam
