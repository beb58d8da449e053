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
/// Graphs take minutes to build over these two, so they are parts that are asked for by their names.
void score_a_million_clustered(Scoreboard& board);
void score_a_million_of_pictures(Scoreboard& board);
void score_growing(Scoreboard& board);

}  // namespace cairn_bench
