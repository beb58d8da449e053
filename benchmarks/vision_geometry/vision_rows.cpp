// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The rows of the scoreboard about SURF: speed, repeatability and matches beside dlib and OpenCV, in one run
/// on the same images, at equal numbers of points.
#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <cairn/vision/surf.hpp>

#include "rows.hpp"
#include "support/data.hpp"
#include "support/timing.hpp"
#include "vision_pictures.hpp"
#include "vision_protocol.hpp"
#include "vision_rivals.hpp"

namespace {

using namespace vision_bench;
using cairn_bench::larger;
using cairn_bench::Row;
using cairn_bench::Scoreboard;
using cairn_bench::smaller;

cairn::SurfOptions options_for(int count) {
  cairn::SurfOptions options;
  options.threshold = 5;
  options.target_count = count;
  return options;
}

Extractor cairn_surf() {
  return {"cairn SURF",
          [](cairn::ImageView image, int count) { return cairn::surf(image, options_for(count)); }};
}

/// cairn first, then whoever was found.
std::vector<Extractor> everybody() {
  std::vector<Extractor> extractors{cairn_surf()};
  for (Extractor& rival : rival_extractors()) extractors.push_back(std::move(rival));
  return extractors;
}

std::string text(const char* format, double value) {
  std::array<char, 64> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, value);
  return buffer.data();
}

/// What one extractor reaches on one pair.
struct Score {
  std::string name;
  Repeatability repeated;
  double chance = 0, overlap = 0;
  Matches matches;
};

Score score(const Extractor& extractor, const Pair& pair, int count) {
  const cairn::Features first = extractor.run(pair.first, count);
  const cairn::Features second = extractor.run(pair.second, count);
  return {extractor.name, repeatability(pair, first, second, 2.5), chance_level(pair, first, second, 2.5),
          overlap_repeatability(pair, first, second), ratio_matches(pair, first, second)};
}

/// A row of ours with the best of the rivals beside it.
void add_compared(Scoreboard& board, Row row, const std::vector<Score>& scores,
                  double (*figure)(const Score&)) {
  row.measured = figure(scores.front());
  for (std::size_t i = 1; i < scores.size(); ++i) {
    const double value = figure(scores[i]);
    row.note += (i > 1 ? ", " : "") + scores[i].name + " " + text("%.3g", value);
    const bool best = !row.rival || (row.better == larger ? value > *row.rival : value < *row.rival);
    if (!best) continue;
    row.rival = value;
    row.rival_name = scores[i].name;
  }
  if (scores.size() == 1) row.note = "no rival";
  board.add(std::move(row));
}

void add_graf_rows(Scoreboard& board, const Pair& graf, const std::vector<Extractor>& extractors) {
  for (const int count : {500, 1000, 2000}) {
    std::vector<Score> scores;
    for (const Extractor& extractor : extractors) scores.push_back(score(extractor, graf, count));
    const std::string at = ", graf 1->3, " + std::to_string(count) + " points";
    const bool owed = count == 2000;
    const auto figure = [&](double value) { return owed ? std::optional(value) : std::nullopt; };
    add_compared(board,
                 {.name = "repeatability, 2.5 px" + at,
                  .unit = "%",
                  .must = figure(40),
                  .aim = figure(45),
                  .better = larger},
                 scores, [](const Score& s) { return s.repeated.rate; });
    add_compared(board,
                 {.name = "localisation rms" + at,
                  .unit = "px",
                  .must = figure(1.2),
                  .aim = figure(1.0),
                  .better = smaller},
                 scores, [](const Score& s) { return s.repeated.rms; });
    add_compared(board,
                 {.name = "correct ratio-test matches" + at,
                  .unit = "",
                  .must = figure(300),
                  .aim = figure(450),
                  .better = larger},
                 scores, [](const Score& s) { return static_cast<double>(s.matches.correct); });
    add_compared(board, {.name = "repeatability, overlap 60 %" + at, .unit = "%", .better = larger}, scores,
                 [](const Score& s) { return s.overlap; });
    add_compared(board, {.name = "chance level of the repeatability" + at, .unit = "%"}, scores,
                 [](const Score& s) { return s.chance; });
  }
}

/// The pairs made of one change of every photograph, under its name.
struct Change {
  std::string name;
  std::vector<Pair> pairs;
};

std::vector<Change> changes_of(const std::vector<cairn::Image>& photographs) {
  std::vector<Change> changes{
      {"zoom 0.6", {}}, {"turn 35 deg", {}}, {"blur 1.5 px", {}}, {"light 0.5", {}}, {"JPEG quality 20", {}}};
  for (const cairn::Image& image : photographs) {
    changes[0].pairs.push_back(similar(image, 0, 0.6));
    changes[1].pairs.push_back(similar(image, 35, 1));
    changes[2].pairs.push_back(blurred(image, 1.5));
    changes[3].pairs.push_back(relit(image, 0.5, 10));
    if (const auto coded = jpeg_coded(image, 20)) changes[4].pairs.push_back({image, *coded, {}});
  }
  return changes;
}

/// Means over the photographs at 1000 points.
void add_warp_rows(Scoreboard& board, const std::vector<cairn::Image>& photographs,
                   const std::vector<Extractor>& extractors) {
  for (const Change& change : changes_of(photographs)) {
    if (change.pairs.empty()) {
      board.add({.name = "repeatability, " + change.name, .note = "no encoder (needs OpenCV)"});
      continue;
    }
    std::vector<Score> means;
    for (const Extractor& extractor : extractors) {
      Score mean{.name = extractor.name, .repeated = {}, .matches = {}};
      for (const Pair& pair : change.pairs) {
        const Score one = score(extractor, pair, 1000);
        mean.repeated.rate += one.repeated.rate / static_cast<double>(change.pairs.size());
        mean.matches.correct += one.matches.correct;
      }
      mean.matches.correct /= change.pairs.size();
      means.push_back(mean);
    }
    const std::string of = change.name + ", mean of " + std::to_string(change.pairs.size()) + " photographs";
    add_compared(board, {.name = "repeatability, " + of, .unit = "%", .better = larger}, means,
                 [](const Score& s) { return s.repeated.rate; });
    add_compared(board, {.name = "correct matches, " + of, .unit = "", .better = larger}, means,
                 [](const Score& s) { return static_cast<double>(s.matches.correct); });
  }
}

void add_time_rows(Scoreboard& board, const cairn::Image& image, const std::vector<Extractor>& rivals) {
  cairn::SurfOptions upright = options_for(2000);
  upright.upright = true;
  cairn::Surf fast(upright);
  const cairn_bench::Contender contender{"upright",
                                         [&] { cairn_bench::do_not_optimise(fast(image).size()); }};
  const double seconds = cairn_bench::interleave({contender}).front().fastest;
  board.add({.name = "768 x 576, " + std::to_string(fast(image).size()) + " points, upright, one thread",
             .measured = 1e3 * seconds,
             .unit = "ms",
             .must = 30,
             .aim = 15,
             .better = smaller,
             .note = "fastest round"});
  if (rivals.empty())
    board.add(
        cairn_bench::against_rival("time against dlib SURF", seconds, std::nullopt, "dlib SURF", 2.5, 4));
  for (const Extractor& rival : rivals) {
    const auto points = static_cast<int>(rival.run(image, 2000).size());
    cairn::Surf ours(options_for(points));
    const bool is_dlib = rival.name == "dlib SURF";
    const auto timings = cairn_bench::interleave(
        {{"cairn SURF", [&] { cairn_bench::do_not_optimise(ours(image).size()); }},
         {rival.name, [&] { cairn_bench::do_not_optimise(rival.run(image, points).size()); }}});
    Row row = cairn_bench::against_rival(
        "time against " + rival.name + ", " + std::to_string(points) + " points", timings[0].median,
        timings[1].median, rival.name, is_dlib ? std::optional(2.5) : std::nullopt,
        is_dlib ? std::optional(4.0) : std::nullopt);
    row.measured = cairn_bench::ratio(timings[1], timings[0]);
    board.add(std::move(row));
  }
}

}  // namespace

void add_vision_rows(Scoreboard& board) {
  const auto folder = cairn_test::real_data("features");
  if (!folder) {
    board.add({.name = "SURF on photographs", .note = "no data"});
    return;
  }
  const Pair graf{read_png(*folder / "graf1.png"),
                  read_png(*folder / "graf3.png"),
                  // H1to3p.xml of the same folder
                  {{7.6285898e-01, -2.9922929e-01, 2.2567123e+02, 3.3443473e-01, 1.0143901e+00,
                    -7.6999973e+01, 3.4663091e-04, -1.4364524e-05, 1.0}}};
  std::vector<cairn::Image> photographs{graf.first};
  for (const char* name : {"box_in_scene.png", "rubberwhale1.png", "basketball1.png"})
    photographs.push_back(read_png(*folder / name));
  add_time_rows(board, cropped(graf.first, 16, 32, 768, 576), rival_extractors());
  const std::vector<Extractor> extractors = everybody();
  add_graf_rows(board, graf, extractors);
  add_warp_rows(board, photographs, extractors);
}
