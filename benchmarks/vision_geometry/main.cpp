// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "rows.hpp"

int main() {
  cairn_bench::Scoreboard board("vision_geometry");
  add_geometry_rows(board);
#ifdef CAIRN_BENCH_VISION_ROWS
  add_vision_rows(board);
#endif
  return board.finish();
}
