// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "rows.hpp"

int main(int argc, char** argv) {
  if (const auto code = cairn_bench::answer(argc, argv, "scoreboard_vision_geometry")) return *code;
  cairn_bench::Scoreboard board("vision_geometry");
  add_geometry_rows(board);
#ifdef CAIRN_BENCH_VISION_ROWS
  add_vision_rows(board);
#endif
  return board.finish();
}
