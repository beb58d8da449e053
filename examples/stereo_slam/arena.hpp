// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The arena: a stereo camera drives through a walled field of lunar ground, and every picture is rendered.
///
/// World frame: z up, floor at z = 0, the 10 x 10 m arena centred at the origin. Camera frames: x right, y
/// down, z forward. The pictures, poses and noise depend on the options alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

namespace stereo_slam {

/// What is driven and what the cameras are like.
struct ArenaOptions {
  /// turn: 360 degrees on the spot, the last pose is the first. loop: two laps of a rectangle with round
  /// corners, pose for pose over the same ground. spiral: three turns outwards.
  std::string script = "loop";
  std::uint64_t seed = 1;     ///< of the ground, the boxes and the noise
  int width = 768;            ///< [pixels]
  int height = 576;           ///< [pixels]
  double field_of_view = 40;  ///< horizontal [degrees]
  double baseline = 0.2;      ///< [m]
  double noise = 1.2;         ///< standard deviation of the sensor noise [grey levels]
  double exposure = 0.12;     ///< how far the exposure wanders about 1
  double drift = 0;           ///< the right camera turns by so much in 100 frames, unknown to rig() [degrees]
  bool cache = true;          ///< keep rendered pairs on disk
  std::filesystem::path
      cache_folder;  ///< empty: $XDG_CACHE_HOME/cairn, ~/.cache/cairn or the temporary folder
};

}  // namespace stereo_slam
