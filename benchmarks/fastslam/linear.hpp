// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#pragma once

#include "support/scoreboard.hpp"

/// Rows of SLAM that is linear and Gaussian, against Kalman's filter of pose and landmarks in one.
void add_linear(cairn_bench::Scoreboard& board);
