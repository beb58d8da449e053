// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "areas.hpp"

int main() {
  cairn_bench::Scoreboard board("index");
  cairn_bench::score_low_dimensions(board);
  cairn_bench::score_descriptors(board);
  cairn_bench::score_growing(board);
  return board.finish();
}
