// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rows of recorded drives: the two that are owed, and any that the caller has.
#pragma once

#include "support/scoreboard.hpp"

namespace stereo_slam_bench {

/// kitti_odometry_a and kitti_raw_0926 of the data folder, as they come and with --calibrate off.
void add_drive_rows(cairn_bench::Scoreboard& board);

/// The drives that CAIRN_DRIVES names, as in "kitti_odometry=DIR,euroc=DIR", with the default settings.
void add_given_drive_rows(cairn_bench::Scoreboard& board);

/// Without any truth: the frames of kitti_raw_0926 forwards, then backwards.
void add_return_row(cairn_bench::Scoreboard& board);

}  // namespace stereo_slam_bench
