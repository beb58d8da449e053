// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Pictures of an arena: ray casting of rectangles with filtered textures.
///
/// For a panel with normal n through o, a camera at c and the ray of pixel p = (x, y, 1), inverse depth and
/// the panel's coordinates times inverse depth are linear in p:
///   1/t = m . p,   m = n^T R K^-1 / n.(o - c)                                    (1)
///   a/t = h . p,   h = along.(c - o) m + along^T R K^-1   (b likewise with up)   (2)
/// so that along an image row the part of a panel that is seen is one interval, found without rays, and the
/// derivatives that the texture filter needs are exact. A pixel whose corners see different panels is the
/// mean of 16 rays.
#pragma once

#include <cstdint>
#include <span>

#include <cairn/manifold/se3.hpp>
#include <cairn/vision/image.hpp>

#include "arena_scene.hpp"

namespace stereo_slam {

/// One picture to take: a distortion-free camera with square pixels, and its film.
struct Shot {
  cairn::SE3 T_world_camera;
  int width = 0;
  int height = 0;
  double focal = 0;                ///< [pixels]
  double centre_x = 0;             ///< [pixels], pixel centres at integers
  double centre_y = 0;             ///< [pixels]
  double exposure = 1;             ///< factor on every grey level
  double noise = 0;                ///< standard deviation [grey levels]
  std::uint64_t noise_stream = 0;  ///< different streams give independent noise
};

/// Takes all the shots; the same pictures for every number of threads.
[[nodiscard]] std::vector<cairn::Image> render(const ArenaScene& scene, std::span<const Shot> shots,
                                               unsigned threads);

}  // namespace stereo_slam
