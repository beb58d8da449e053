// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <string_view>
#include <vector>

#include "areas.hpp"

/// Without arguments all rows but those of a million descriptors; otherwise the parts named: low,
/// descriptors, growing, million_clustered, million_of_pictures.
int main(int argc, char** argv) {
  if (const auto code =
          cairn_bench::answer(argc, argv, "scoreboard_index",
                              {"low", "descriptors", "growing", "million_clustered", "million_of_pictures"}))
    return *code;
  const std::vector<std::string_view> parts(argv + 1, argv + argc);
  const auto named = [&](std::string_view part) {
    return std::find(parts.begin(), parts.end(), part) != parts.end();
  };
  const auto wanted = [&](std::string_view part) { return parts.empty() || named(part); };
  cairn_bench::Scoreboard board("index");
  if (wanted("low")) cairn_bench::score_low_dimensions(board);
  if (wanted("descriptors")) cairn_bench::score_descriptors(board);
  if (wanted("growing")) cairn_bench::score_growing(board);
  if (named("million_clustered")) cairn_bench::score_a_million_clustered(board);
  if (named("million_of_pictures")) cairn_bench::score_a_million_of_pictures(board);
  return board.finish();
}
