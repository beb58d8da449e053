// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rows of FastSLAM beside EKF-SLAM on the same simulated drives, against the numbers of landmarks and
/// particles.
#pragma once

#include "support/scoreboard.hpp"

/// Three drives for each number of landmarks, 48, 192 and 432: a loop that is once, twice
/// and three times as long, driven once and a fifth more. Error, NEES and CPU.
void add_joint_rival(cairn_bench::Scoreboard& board);
