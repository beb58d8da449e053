// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// "Starry Night" (T. Barfoot, course AER1513 at Toronto): a stereo camera and a gyroscope carried over
/// twenty dots whose numbers are known, truth by Vicon. Unlike the filters' test, which is told where the
/// dots are, here they are mapped while the camera moves.
#pragma once

#include "support/scoreboard.hpp"

namespace stereo_slam_bench {

/// From the first image that shows three dots, the least a pose needs, to the end of the record; nothing of
/// it is left out. The noise of a pixel is what the images show without any truth, how differently high a dot
/// is in both; that which the record states is for the most part an error of the truth, so that the truth is
/// given a covariance of its own, by its surveyed dots. With the stated noise two rows more. A frame is
/// located in a KeyframeMap of the library by the dots it shows, near where the velocities lead or, where too
/// few agree there, near where the dots themselves put it; where it shows fewer than three known ones, which
/// determine no pose, an extended filter corrects with them what the velocities say. "No data" without the
/// record, or without zlib, which it is packed with.
void add_starry_night_rows(cairn_bench::Scoreboard& board);

}  // namespace stereo_slam_bench
