// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a map costs that lasts: an hour of video, and 100,000 landmarks in either store.
#pragma once

#include "support/scoreboard.hpp"

namespace stereo_slam_bench {

/// The arena's lap again and again for an hour at ten frames a second, with fresh noise in every image.
/// `frames`: of an hour's 36,000.
void add_hour_rows(cairn_bench::Scoreboard& board, std::size_t frames);

/// One lap's points through rooms that do not look like each other, until a store holds 100,000 landmarks:
/// the time of a step with the single tree and with the forest. Draws both into a page beside the results.
void add_store_rows(cairn_bench::Scoreboard& board);

}  // namespace stereo_slam_bench
