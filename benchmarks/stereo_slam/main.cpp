// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How true and how accurate stereo SLAM is: errors and NEES on the rendered arena over several seeds, drift
/// on recorded drives, time, and what a map costs that lasts. CAIRN_ARENA_SEEDS says how many seeds (3; a
/// script of a new seed is rendered first, which takes minutes), CAIRN_VIDEO_MINUTES how long the arena is
/// looped (6; an hour is 60, and takes a quarter of one), CAIRN_STEREO_ROWS which rows are wanted, by
/// commas: arena,joint,drives,return,drift,relocalisation,loaded,rate,stores,starry_night,video (all).
/// CAIRN_DRIVES names further drives, kitti_odometry=DIR,euroc=DIR; CAIRN_RIVAL_PATHS a folder of paths that
/// other systems came to, DRIVE.NAME.txt, one KITTI row a frame.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <unistd.h>

#include <cairn/core/random.hpp>
#include <cairn/eval/trajectory_error.hpp>
#include <cairn/io/text.hpp>

#include "arena_dataset.hpp"
#include "arena_script.hpp"
#include "dataset.hpp"
#include "drives.hpp"
#include "frames_ahead.hpp"
#include "joint.hpp"
#include "lasting.hpp"
#include "pipeline.hpp"
#include "runs.hpp"
#include "saved_map.hpp"
#include "starry_night.hpp"
#include "stopwatch.hpp"
#include "summary.hpp"
#include "support/command_line.hpp"
#include "support/scoreboard.hpp"

namespace {

namespace fs = std::filesystem;
using cairn_bench::Scoreboard;
using stereo_slam_bench::Run;
using stereo_slam_bench::run;

Run run_arena(const std::string& script, std::uint64_t seed) {
  stereo_slam::DatasetOptions what;
  what.kind = "arena";
  what.arena.script = script;
  what.arena.seed = seed;
  stereo_slam::PipelineOptions how;
  how.seed = seed;
  return run(what, how);
}

std::uint64_t seeds() {
  const char* text = std::getenv("CAIRN_ARENA_SEEDS");
  return text != nullptr ? std::max(1ULL, std::strtoull(text, nullptr, 10)) : 3;
}

std::size_t video_minutes() {
  const char* text = std::getenv("CAIRN_VIDEO_MINUTES");
  return text != nullptr ? std::max(1UL, std::strtoul(text, nullptr, 10)) : 6;
}

bool wanted(const std::string& rows) {
  const char* text = std::getenv("CAIRN_STEREO_ROWS");
  return text == nullptr || ("," + std::string(text) + ",").find("," + rows + ",") != std::string::npos;
}

/// What is owed of the NEES of every single run.
void add_nees_rows(Scoreboard& board, const std::string& name, const std::vector<double>& nees,
                   const std::string& each, const std::string& over) {
  board.add({.name = name + ": largest mean of a run",
             .measured = std::ranges::max(nees),
             .unit = "of 6",
             .must = 12,
             .aim = 9,
             .note = each});
  board.add({.name = name + ": least mean of a run",
             .measured = std::ranges::min(nees),
             .unit = "of 6",
             .must = 3,
             .aim = 4,
             .better = cairn_bench::larger,
             .note = over});
}

/// Largest errors, NEES of every run, the second lap.
void add_arena_rows(Scoreboard& board) {
  double position = 0, heading = 0, revisit = 0, revisit_heading = 0;
  std::size_t lost = 0;
  std::vector<double> nees;
  std::string each, loops;
  double met_again = 0, before = 0;
  for (const std::string script : {"loop", "turn", "spiral"}) {
    each += (each.empty() ? "" : "; ") + script;
    for (std::uint64_t seed = 1; seed <= seeds(); ++seed) {
      const Run one = run_arena(script, seed);
      const stereo_slam::TruthErrors& errors = one.summary.errors.value();
      lost += one.summary.frames_lost;
      nees.push_back(errors.consistency.value().nees_mean);
      loops += (loops.empty() ? "" : ", ") + script + ' ' + std::to_string(one.summary.loops_closed);
      for (const stereo_slam::LoopEffect& loop : one.summary.loops) {
        met_again = std::max(met_again, loop.after.value().position);
        before = std::max(before, loop.before.value().position);
      }
      each += ' ' + cairn::shortest(std::round(10 * nees.back()) / 10);
      if (script == "spiral") continue;
      position = std::max(position, errors.largest.position);
      heading = std::max(heading, errors.largest.heading * stereo_slam::degrees);
      if (script != "loop" || !errors.revisit) continue;
      revisit = std::max(revisit, errors.revisit->position);
      revisit_heading = std::max(revisit_heading, errors.revisit->heading * stereo_slam::degrees);
    }
  }
  double mean = 0;
  for (const double one : nees) mean += one / static_cast<double>(nees.size());
  const std::string over = std::to_string(seeds()) + " seeds";
  board.add({.name = "arena loop and turn: largest position error",
             .measured = position,
             .unit = "m",
             .must = 0.01,
             .aim = 0.003,
             .note = over});
  board.add({.name = "arena loop and turn: largest heading error",
             .measured = heading,
             .unit = "deg",
             .must = 0.15,
             .aim = 0.05,
             .note = over});
  add_nees_rows(board, "NEES of the pose", nees, each, over);
  // A mean that may be neither above nor below: two rows.
  const auto add_mean = [&](const char* side, double must, double aim, cairn_bench::Better better) {
    board.add({.name = std::string("NEES of the pose: mean over runs, not ") + side,
               .measured = mean,
               .unit = "of 6",
               .must = must,
               .aim = aim,
               .better = better,
               .note = over});
  };
  add_mean("above", 9, 7, cairn_bench::smaller);
  add_mean("below", 4, 5, cairn_bench::larger);
  board.add({.name = "second lap against first: position",
             .measured = revisit,
             .unit = "m",
             .must = 0.005,
             .aim = 0.002,
             .note = over});
  board.add({.name = "second lap against first: heading",
             .measured = revisit_heading,
             .unit = "deg",
             .must = 0.05,
             .note = over});
  board.add(
      {.name = "places met again: largest position error with the landmarks that came back",
       .measured = met_again,
       .unit = "m",
       .note = "without them " + cairn::shortest(std::round(1e4 * before) / 1e4) + " m; times: " + loops});
  board.add({.name = "arena: frames lost",
             .measured = static_cast<double>(lost),
             .unit = "",
             .must = 0,
             .note = over});
}

/// The right camera turns by 0.05 degrees in 100 frames.
void add_drift_row(Scoreboard& board) {
  stereo_slam::DatasetOptions what;
  what.kind = "arena";
  what.arena.script = "loop";
  what.arena.drift = 0.05;
  board.add({.name = "arena loop on a rig that drifts: largest position error",
             .measured = run(what, {}).summary.errors.value().largest.position,
             .unit = "m",
             .must = 0.03,
             .aim = 0.01,
             .note = "--drift 0.05"});
}

/// The map that a run over the frames leaves, as the next one has it: saved and loaded.
stereo_slam::SavedMap kept_map(const stereo_slam::Dataset& frames, const stereo_slam::PipelineOptions& how) {
  stereo_slam::Pipeline mapping(frames.rig(), how);
  for (std::size_t i = 0; i < frames.size(); ++i) mapping.step(frames.frame(i));
  const fs::path file = fs::temp_directory_path() / ("cairn_map_" + std::to_string(::getpid()));
  stereo_slam::save_map(file, mapping.map());
  stereo_slam::SavedMap saved = stereo_slam::load_map(file);
  fs::remove(file);
  return saved;
}

/// A run in a map that another made, found again without a word of where it is.
struct LoadedRun {
  std::string map, script;
  std::size_t map_frames = 0;  // all where 0
  bool localise = true;
};

/// NEES of every run in a saved map, against truth in the world of the run that made the map.
void add_loaded_rows(Scoreboard& board) {
  const auto arena = [](const std::string& script, std::uint64_t seed, std::size_t frames) {
    stereo_slam::ArenaOptions what;
    what.script = script;
    what.seed = seed;
    return stereo_slam::open_arena(what, frames > 0 ? frames : 100000, 2);
  };
  std::map<std::tuple<std::string, std::size_t, std::uint64_t>, stereo_slam::SavedMap> maps;
  const auto nees_of = [&](const LoadedRun& one, std::uint64_t seed, std::size_t& lost) {
    stereo_slam::PipelineOptions how;
    how.seed = seed;
    const std::tuple made{one.map, one.map_frames, seed};
    if (!maps.contains(made)) maps.emplace(made, kept_map(*arena(one.map, seed, one.map_frames), how));
    how.localise = one.localise;
    std::cout << "running arena " << one.script << " in the map of " << one.map << ", seed " << seed
              << std::endl;
    const auto frames = arena(one.script, seed, 0);
    stereo_slam::Pipeline pipeline(frames->rig(), how, maps.at(made), "map");
    for (std::size_t i = 0; i < frames->size(); ++i) lost += pipeline.step(frames->frame(i)).tracked ? 0 : 1;
    const auto errors = stereo_slam::summarise(pipeline.record()).errors;
    return errors && errors->consistency ? errors->consistency->nees_mean
                                         : std::numeric_limits<double>::infinity();  // never found: no pass
  };
  std::vector<double> nees;
  std::string each;
  std::size_t lost = 0;
  for (const LoadedRun& one :
       {LoadedRun{"loop", "spiral"}, LoadedRun{"loop", "turn"}, LoadedRun{"loop", "loop"},
        LoadedRun{"spiral", "loop"}, LoadedRun{"turn", "spiral"}, LoadedRun{"loop", "spiral", 0, false}}) {
    each += (each.empty() ? "" : "; ") + std::string(one.script) + " in " + one.map +
            (one.localise ? "" : ", going on");
    for (std::uint64_t seed = 1; seed <= seeds(); ++seed) {
      nees.push_back(nees_of(one, seed, lost));
      each += ' ' + cairn::shortest(std::round(10 * nees.back()) / 10);
    }
  }
  add_nees_rows(board, "NEES of the pose in a loaded map", nees, each,
                std::to_string(seeds()) + " seeds, " + std::to_string(lost) + " frames lost");
  // Places that the map knows from a single other one: reported, and known to be too sure.
  std::size_t hardly_known = 0;
  double worst = 0;
  for (std::uint64_t seed = 1; seed <= seeds(); ++seed)
    worst = std::max(worst, nees_of({"turn", "loop", 30}, seed, hardly_known));
  board.add({.name = "the same of the loop, in the map of 60 degrees of the turn",
             .measured = worst,
             .unit = "of 6",
             .note = std::to_string(hardly_known) + " frames lost"});
}

/// Views near the path of a map that was saved and loaded, each by itself: up to half a metre beside it,
/// turned by up to fifteen degrees.
void add_relocalisation_rows(Scoreboard& board) {
  constexpr std::size_t views = 50;
  constexpr double near = 0.02, turned = 0.3;  // [m, degrees]
  stereo_slam::ArenaOptions arena;
  arena.script = "loop";
  const auto lap = stereo_slam::open_arena(arena, stereo_slam::loop_lap(), 2);
  stereo_slam::PipelineOptions how;
  const stereo_slam::SavedMap saved = kept_map(*lap, how);

  cairn::Random random(1);
  std::vector<stereo_slam::Stance> stances;
  const std::vector<stereo_slam::Stance> path = stereo_slam::script_stances(arena.script);
  for (std::size_t i = 0; i < views; ++i) {
    stereo_slam::Stance stance = path[random.below(stereo_slam::loop_lap())];
    stance.x += random.uniform(-0.5, 0.5);
    stance.y += random.uniform(-0.5, 0.5);
    stance.heading += random.uniform(-15, 15) / stereo_slam::degrees;
    stances.push_back(stance);
  }
  const auto seen = stereo_slam::open_arena_views(arena, stances, 2);
  how.localise = true;
  std::size_t found = 0, wrong = 0;
  double nees = 0;
  for (std::size_t i = 0; i < views; ++i) {
    stereo_slam::Pipeline pipeline(seen->rig(), how, saved, "map");
    const stereo_slam::StereoFrame frame = seen->frame(i);
    const stereo_slam::FrameRecord& record = pipeline.step(frame);
    if (!record.tracked) continue;
    const stereo_slam::FrameError error = stereo_slam::frame_error(record.T_world_camera, *record.truth);
    nees += stereo_slam::pose_nees(record).value();
    ++(error.position < near && error.heading * stereo_slam::degrees < turned ? found : wrong);
  }
  board.add({.name = "50 views in a saved map: found within 0.02 m and 0.3 deg",
             .measured = 100.0 * static_cast<double>(found) / views,
             .unit = "%",
             .must = 95,
             .aim = 100,
             .better = cairn_bench::larger});
  board.add({.name = "50 views in a saved map: wrong",
             .measured = static_cast<double>(wrong),
             .unit = "",
             .must = 0});
  board.add({.name = "50 views in a saved map: mean NEES, not above",
             .measured = nees / static_cast<double>(found + wrong),
             .unit = "of 6",
             .must = 12});
}

/// The pictures are in the cache by now, so that the rate is that of the system and not of the renderer: wall
/// time of the whole run, as the program has it.
void add_rate_row(Scoreboard& board) {
  stereo_slam::DatasetOptions what;
  what.kind = "arena";
  what.arena.script = "loop";
  what.frames = 150;
  const auto frames = stereo_slam::open_dataset(what);
  constexpr unsigned threads = 2;
  stereo_slam::PipelineOptions how;
  how.threads = stereo_slam::threads_behind(threads);
  stereo_slam::Pipeline pipeline(frames->rig(), how);
  double milliseconds = 0;
  {
    const stereo_slam::Stopwatch watch(milliseconds);
    stereo_slam::FramesAhead ahead(*frames, stereo_slam::feature_options(how), threads);
    for (std::size_t i = 0; i < frames->size(); ++i) {
      const stereo_slam::FrameAhead next = ahead.take();
      pipeline.step(next.frame, next.points, next.load_milliseconds);
      ahead.match_by(pipeline.settled_matcher());
      ahead.leave_alone(pipeline.left_alone());
    }
  }
  board.add({.name = "rate, arena 768 x 576, 2000 points an image, 2 threads",
             .measured = 1e3 * static_cast<double>(frames->size()) / milliseconds,
             .unit = "Hz",
             .must = 25,
             .aim = 40,
             .better = cairn_bench::larger});
}

int score() {
  Scoreboard board("stereo_slam");
  if (wanted("video"))
    stereo_slam_bench::add_hour_rows(board, 600 * video_minutes());  // its memory is ours: first
  if (wanted("arena")) add_arena_rows(board);
  if (wanted("joint")) stereo_slam_bench::add_joint_rows(board);
  if (wanted("drives")) stereo_slam_bench::add_drive_rows(board);
  stereo_slam_bench::add_given_drive_rows(board);
  if (wanted("return")) stereo_slam_bench::add_return_row(board);
  if (wanted("drift")) add_drift_row(board);
  if (wanted("relocalisation")) add_relocalisation_rows(board);
  if (wanted("loaded")) add_loaded_rows(board);
  if (wanted("starry_night")) stereo_slam_bench::add_starry_night_rows(board);
  if (wanted("rate")) add_rate_row(board);
  if (wanted("stores")) stereo_slam_bench::add_store_rows(board);
  return board.finish();
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = "scoreboard_stereo_slam";
  if (const auto code = cairn_bench::answer(argc, argv, name)) return *code;
  return example::exit_code_of(name, score);
}
