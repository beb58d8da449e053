// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Ground that looks like the Moon.
///
/// A height field of fractal noise (octaves of cubic B-splines) and of craters, whose number falls with the
/// square of their diameter as on real planets: there is detail at every scale and no two places look alike.
/// A low sun lights it.
#pragma once

#include <cstdint>

#include "arena_texture.hpp"

namespace stereo_slam {

/// What the ground is made of.
struct GroundOptions {
  int width = 0;   ///< [texels]
  int height = 0;  ///< [texels]
  double texels_per_metre = 512;
  std::uint64_t seed = 0;
  double largest_crater = 1.0;   ///< diameter [m]
  double crater_density = 0.16;  ///< craters of diameter D to 2 D on D x D
  double roughness = 0.11;       ///< slope that each octave of the noise adds
  double sun_elevation = 0.6;    ///< [rad]
  double albedo = 0.42;          ///< grey of flat ground, 0..1
  double mottling = 0.12;        ///< how much each octave of the albedo varies
};

/// Lit ground; the same texels for every number of threads.
[[nodiscard]] Texels moon_ground(const GroundOptions& options, unsigned threads);

}  // namespace stereo_slam
