// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The map of joint keyframes against what solves the same problem otherwise: all keyframes and landmarks at
/// once, and a window of keyframes of which the oldest are marginalised. Simulated drives, association known.
#pragma once

#include "support/scoreboard.hpp"

namespace stereo_slam_bench {

/// Two laps of the simulated arena by each of ten seeds.
void add_joint_rows(cairn_bench::Scoreboard& board);

}  // namespace stereo_slam_bench
