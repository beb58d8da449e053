// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How features of two images of a plane are judged.
///
/// Only places that the other image shows count; places are counted once whatever their directions; points
/// are assigned one to one, the nearest (or best overlapping) first; rates are over the smaller number.
#pragma once

#include <cstddef>

#include <cairn/vision/features.hpp>

#include "vision_pictures.hpp"

namespace vision_bench {

struct Repeatability {
  double rate = 0;         ///< [%]
  double rms = 0;          ///< distance of the repeated points [pixels]
  std::size_t points = 0;  ///< the smaller number in the common part
};

/// Within `tolerance` pixels and a factor of 1.5 in scale.
Repeatability repeatability(const Pair& pair, const cairn::Features& first, const cairn::Features& second,
                            double tolerance);

/// The same after the points of the second image have been mirrored: what chance and crowding give [%].
double chance_level(const Pair& pair, const cairn::Features& first, const cairn::Features& second,
                    double tolerance);

/// Mikolajczyk and Schmid (IJCV 65, 2005): regions, here circles of 3 sigma, brought to a radius of 30
/// pixels, whose overlap error is below 40 % [%].
double overlap_repeatability(const Pair& pair, const cairn::Features& first, const cairn::Features& second);

struct Matches {
  std::size_t found = 0;
  std::size_t correct = 0;
};

/// Nearest neighbours that pass the ratio test of 0.8 among features of the same sign; correct within 5
/// pixels.
Matches ratio_matches(const Pair& pair, const cairn::Features& first, const cairn::Features& second);

}  // namespace vision_bench
