// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rows of lines seen by three cameras. Apart from the other rows: both programs have a Map, a Drive, a run.
#pragma once

#include "support/scoreboard.hpp"

/// Five seeds that no setting was chosen by.
void add_lines(cairn_bench::Scoreboard& board);
