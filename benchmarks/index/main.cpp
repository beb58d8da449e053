// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <string_view>
#include <vector>

#include "areas.hpp"

/// Without arguments all rows but those of a million descriptors; otherwise the parts named: low,
/// descriptors, million, growing.
int main(int argc, char** argv) {
  if (const auto code =
          cairn_bench::answer(argc, argv, "scoreboard_index", {"low", "descriptors", "million", "growing"}))
    return *code;
  const std::vector<std::string_view> parts(argv + 1, argv + argc);
  const auto wanted = [&](std::string_view part) {
    return parts.empty() || std::find(parts.begin(), parts.end(), part) != parts.end();
  };
  cairn_bench::Scoreboard board("index");
  if (wanted("low")) cairn_bench::score_low_dimensions(board);
  if (wanted("descriptors")) cairn_bench::score_descriptors(board);
  if (std::find(parts.begin(), parts.end(), "million") != parts.end())
    cairn_bench::score_a_million_descriptors(board);
  if (wanted("growing")) cairn_bench::score_growing(board);
  return board.finish();
}
