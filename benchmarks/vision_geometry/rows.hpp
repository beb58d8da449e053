// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The two halves of the area.
#pragma once

#include "support/scoreboard.hpp"

void add_vision_rows(cairn_bench::Scoreboard& board);
void add_geometry_rows(cairn_bench::Scoreboard& board);
