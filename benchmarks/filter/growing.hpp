// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rows of the state that grows: one range and bearing of one of 200 landmarks, against dense filters of all
/// 403 numbers.
#pragma once

#include "support/scoreboard.hpp"

namespace cairn_bench {

void add_growing_rows(Scoreboard& board);

}  // namespace cairn_bench
