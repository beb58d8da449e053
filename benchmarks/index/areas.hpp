// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The parts of the scoreboard of the index.
#pragma once

#include "support/scoreboard.hpp"

namespace cairn_bench {

void score_low_dimensions(Scoreboard& board);
void score_descriptors(Scoreboard& board);
/// Graphs take minutes to build over these, so they are a part that is asked for by its name.
void score_a_million_descriptors(Scoreboard& board);
void score_growing(Scoreboard& board);

}  // namespace cairn_bench
