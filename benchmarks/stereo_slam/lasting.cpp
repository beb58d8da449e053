// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "lasting.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <memory>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>

#include "arena_dataset.hpp"
#include "arena_script.hpp"
#include "feature_choice.hpp"
#include "landmark_store.hpp"
#include "pipeline.hpp"
#include "summary.hpp"
#include "support/report.hpp"

namespace stereo_slam_bench {
namespace {

using cairn_bench::Row;
using cairn_bench::Scoreboard;

/// Normal noise that is cheap: a table, read from another place in every row.
class Noise {
public:
  Noise() {
    cairn::Random random(7);
    for (float& one : table_) one = static_cast<float>(random.normal(0, 1.2));
  }
  void add(cairn::Image& image, cairn::Random& random) const {
    for (int y = 0; y < image.height(); ++y) {
      std::size_t at = random.below(table_.size());
      for (int x = 0; x < image.width(); ++x, at = (at + 1) % table_.size())
        image(x, y) = static_cast<std::uint8_t>(
            std::clamp(std::lround(static_cast<float>(image(x, y)) + table_[at]), 0L, 255L));
    }
  }

private:
  std::array<float, 1 << 16> table_{};
};

/// Most memory this process had so far [MB].
double largest_resident() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024;
  return std::nan("");
}

double mean_of(const std::vector<double>& values, std::size_t from, std::size_t to) {
  return std::accumulate(values.begin() + static_cast<std::ptrdiff_t>(from),
                         values.begin() + static_cast<std::ptrdiff_t>(to), 0.0) /
         static_cast<double>(to - from);
}

/// To a power of ten; multiples of 0.01 that are no numbers of a computer would show as 56.550000000000004.
std::string rounded(double value, double unit) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(std::max(0, static_cast<int>(std::lround(-std::log10(unit)))))
       << value;
  return text.str();
}

// ---------------------------------------------------------------- two stores

/// What one frame of the lap asks the store and adds to it.
struct Step {
  std::vector<float> queries;  // 64 numbers each
  std::vector<std::int8_t> signs;
};

std::vector<Step> steps_of_a_lap() {
  stereo_slam::ArenaOptions arena;
  arena.script = "loop";
  const auto lap = stereo_slam::open_arena(arena, stereo_slam::loop_lap(), 2);
  stereo_slam::FeatureOptions features;
  features.points = 2000;
  features.surf_threshold = 10;
  auto extract = stereo_slam::make_extractor(features);
  std::vector<Step> steps;
  for (std::size_t i = 0; i < lap->size(); i += 2) {
    const stereo_slam::StereoFrame frame = lap->frame(i);
    const cairn::Features& points = extract(frame.left);
    Step step;
    for (std::size_t k = 0; k < points.size(); k += 2) {
      const auto look = points.descriptor(k);
      step.queries.insert(step.queries.end(), look.begin(), look.end());
      step.signs.push_back(points.keypoints[k].laplacian);
    }
    steps.push_back(std::move(step));
  }
  return steps;
}

/// Another room looks different but is the same among itself: its descriptors' numbers are permuted, half of
/// them with another sign.
class Room {
public:
  explicit Room(std::uint64_t number) {
    cairn::Random random(1, number);
    std::iota(place_.begin(), place_.end(), std::size_t{0});
    if (number == 0) {
      sign_.fill(1);
      return;
    }
    for (std::size_t i = place_.size(); i > 1; --i) std::swap(place_[i - 1], place_[random.below(i)]);
    for (float& one : sign_) one = random.below(2) == 0 ? 1.0F : -1.0F;
  }
  void look(const float* from, float* to) const {
    for (std::size_t i = 0; i < place_.size(); ++i) to[i] = sign_[i] * from[place_[i]];
  }

private:
  std::array<std::size_t, 64> place_{};
  std::array<float, 64> sign_{};
};

struct Growth {
  std::vector<double> landmarks, milliseconds;  // a step
  std::uint64_t matches = 0;
};

/// Goes through rooms until there are `most` landmarks. Those that match were seen again, the others are new.
Growth grow(const std::vector<Step>& steps, stereo_slam::StoreKind kind, std::size_t most) {
  stereo_slam::StoreOptions options;
  options.kind = kind;
  const auto store = stereo_slam::make_landmark_store(options);
  Growth growth;
  std::size_t size = 0;
  std::vector<float> looks;
  for (std::uint64_t number = 0; size < most && number < 60; ++number) {
    const Room room(number);
    for (const Step& step : steps) {
      if (size >= most) break;
      looks.resize(step.queries.size());
      std::vector<stereo_slam::Look> asked;
      for (std::size_t i = 0; i < step.signs.size(); ++i) {
        room.look(step.queries.data() + 64 * i, looks.data() + 64 * i);
        asked.push_back({{looks.data() + 64 * i, 64}, step.signs[i]});
      }
      const std::clock_t start = std::clock();
      const auto found = store->match(asked, 1);
      std::size_t added = 0, matched = 0;
      for (std::size_t i = 0; i < found.size(); ++i)
        if (found[i]) {
          store->sighted(found[i]->id);
          ++matched;
        } else {
          static_cast<void>(store->add(asked[i]));
          ++added;
        }
      const std::size_t gone = store->advance().size();
      growth.milliseconds.push_back(1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
      size += added - gone;
      growth.landmarks.push_back(static_cast<double>(size));
      growth.matches += matched;
    }
  }
  return growth;
}

/// Mean over a window of landmarks.
std::vector<double> smoothed(const Growth& growth, const std::vector<double>& at, double width) {
  std::vector<double> result;
  for (const double n : at) {
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < growth.landmarks.size(); ++i)
      if (std::abs(growth.landmarks[i] - n) <= width) {
        sum += growth.milliseconds[i];
        ++count;
      }
    result.push_back(count > 0 ? sum / count : std::nan(""));
  }
  return result;
}

}  // namespace

void add_hour_rows(Scoreboard& board, std::size_t frames) {
  std::cout << "running " << frames << " frames of the arena's lap" << std::endl;
  stereo_slam::ArenaOptions arena;
  arena.script = "loop";
  arena.width = 384;
  arena.height = 288;
  arena.noise = 0;
  const auto lap = stereo_slam::open_arena(arena, stereo_slam::loop_lap(), 1);
  stereo_slam::PipelineOptions how;
  how.points = 600;
  stereo_slam::Pipeline pipeline(lap->rig(), how);
  const Noise noise;
  cairn::Random random(1);
  std::vector<double> milliseconds, nees;
  std::size_t lost = 0, landmarks = 0, keyframes = 0;
  double largest = 0;
  for (std::size_t i = 0; i < frames; ++i) {
    stereo_slam::StereoFrame frame = lap->frame(i % lap->size());
    frame.index = i;
    frame.time = static_cast<double>(i) / 10;
    noise.add(frame.left, random);
    noise.add(frame.right, random);
    const std::clock_t start = std::clock();
    const stereo_slam::FrameRecord& record = pipeline.step(frame);
    milliseconds.push_back(1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    lost += record.tracked ? 0 : 1;
    landmarks = std::max(landmarks, record.landmarks);
    keyframes = std::max(keyframes, record.keyframes);
    if (record.tracked && record.truth)
      largest = std::max(largest, stereo_slam::frame_error(record.T_world_camera, *record.truth).position);
    if (const auto one = stereo_slam::pose_nees(record)) nees.push_back(*one);
    if ((i + 1) % 3000 == 0)
      std::cout << "  " << i + 1 << " frames: " << record.landmarks << " landmarks, " << record.keyframes
                << " keyframes, " << rounded(mean_of(milliseconds, i - 599, i + 1), 0.01) << " ms, "
                << rounded(largest_resident(), 1) << " MB, NEES "
                << rounded(mean_of(nees, nees.size() - std::min<std::size_t>(nees.size(), 3000), nees.size()),
                           0.01)
                << ", lost " << lost << std::endl;
  }
  const std::string of = frames == 36000
                             ? "an hour of video"
                             : cairn::shortest(static_cast<double>(frames) / 600) + " minutes of video";
  const std::string name = of + " (arena looped, 384 x 288, 600 points)";
  const std::size_t span = std::min<std::size_t>(3000, frames / 3);
  const double begin = mean_of(milliseconds, 0, span), end = mean_of(milliseconds, frames - span, frames);
  board.add({.name = name + ": resident memory",
             .measured = largest_resident(),
             .unit = "MB",
             .must = 300,
             .aim = 150,
             .note = std::to_string(landmarks) + " landmarks and " + std::to_string(keyframes) +
                     " keyframes at most"});
  board.add({.name = name + ": CPU time a frame, the last " + rounded(static_cast<double>(span) / 600, 0.1) +
                     " minutes over the first",
             .measured = end / begin,
             .unit = "",
             .must = 1.2,
             .aim = 1.05,
             .note = rounded(begin, 0.01) + " ms, then " + rounded(end, 0.01)});
  board.add({.name = name + ": NEES of the pose, not above",
             .measured = nees.empty() ? std::nullopt : std::optional(mean_of(nees, 0, nees.size())),
             .unit = "of 6",
             .must = 12,
             .note = "largest position error " + rounded(largest, 1e-4) + " m"});
  board.add({.name = name + ": frames lost", .measured = static_cast<double>(lost), .unit = "", .must = 0});
}

void add_store_rows(Scoreboard& board) {
  constexpr std::size_t most = 100000;
  std::cout << "growing both stores to " << most << " landmarks" << std::endl;
  const std::vector<Step> steps = steps_of_a_lap();
  const Growth forest = grow(steps, stereo_slam::StoreKind::multi, most);
  const Growth single = grow(steps, stereo_slam::StoreKind::single, most);
  std::vector<double> at;
  for (double n = 5000; n <= static_cast<double>(most) - 2500; n += 5000) at.push_back(n);
  const std::vector<double> by_forest = smoothed(forest, at, 2500), by_single = smoothed(single, at, 2500);
  const double last_forest = smoothed(forest, {95000}, 5000).front(),
               last_single = smoothed(single, {95000}, 5000).front();
  const double searched =
      std::accumulate(steps.begin(), steps.end(), 0.0,
                      [](double sum, const Step& s) { return sum + static_cast<double>(s.signs.size()); }) /
      static_cast<double>(steps.size());
  board.add({.name = "100,000 landmarks: step with the forest over step with the single tree",
             .measured = last_forest / last_single,
             .unit = "",
             .must = 0.3,
             .aim = 0.1,
             .note = rounded(last_forest, 0.01) + " ms over " + rounded(last_single, 0.01) + " ms, " +
                     rounded(searched, 1) + " points a step; matches " + std::to_string(forest.matches) +
                     " and " + std::to_string(single.matches)});
  example::Report page("Two stores", "one lap's SURF points through rooms that look different, " +
                                         rounded(searched, 1) + " points a step, CPU time");
  page.add(example::LinePlot{
      .title = "Time of a step",
      .caption = "Searching, adding and settling; means over 5,000 landmarks. The single tree is "
                 "rebuilt at each step, of the forest mostly a small tree.",
      .x = {"landmarks", ""},
      .y = {"time of a step", "ms"},
      .x_values = at,
      .curves = {{"single tree", example::Ink::wrong, by_single},
                 {"forest", example::Ink::belief, by_forest}},
      .wide = true});
  page.figure(
      {"forest over single tree", example::readable(last_forest / last_single), "", "at 90,000 to 100,000"});
  const std::filesystem::path folder = cairn_bench::output_folder();
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  if (const auto html = page.html()) cairn::write_file_atomically(folder / "stereo_slam_stores.html", *html);
}

}  // namespace stereo_slam_bench
