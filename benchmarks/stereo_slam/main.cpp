// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How true and how accurate stereo SLAM is: errors and NEES on the rendered arena over several seeds, drift
/// on recorded drives, time, and what a map costs that lasts. CAIRN_ARENA_SEEDS says how many seeds (3; a
/// script of a new seed is rendered first, which takes minutes), CAIRN_VIDEO_MINUTES how long the arena is
/// looped (6; an hour is 60, and takes a quarter of one), CAIRN_STEREO_ROWS which rows are wanted, by
/// commas: arena,joint,drives,return,drift,relocalisation,rate,stores,starry_night,video (all).
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <unistd.h>

#include <cairn/core/random.hpp>
#include <cairn/eval/kitti_metric.hpp>
#include <cairn/eval/trajectory_error.hpp>
#include <cairn/io/text.hpp>

#include "arena_dataset.hpp"
#include "arena_script.hpp"
#include "dataset.hpp"
#include "frames_ahead.hpp"
#include "joint.hpp"
#include "lasting.hpp"
#include "pipeline.hpp"
#include "receiver_heights.hpp"
#include "reference_mounting.hpp"
#include "saved_map.hpp"
#include "starry_night.hpp"
#include "stopwatch.hpp"
#include "summary.hpp"
#include "support/scoreboard.hpp"
#include "there_and_back.hpp"

namespace {

namespace fs = std::filesystem;
using cairn_bench::Row;
using cairn_bench::Scoreboard;

struct Run {
  stereo_slam::RunRecord record;
  stereo_slam::Summary summary;
  double cpu_milliseconds = 0;  ///< of a pair, without reading it
};

Run run(const stereo_slam::DatasetOptions& what, stereo_slam::PipelineOptions how, bool and_back = false) {
  std::cout << "running " << what.kind << ' '
            << (what.folder.empty() ? what.arena.script : what.folder.string()) << ", seed " << how.seed
            << std::endl;
  auto frames = stereo_slam::open_dataset(what);
  if (and_back) frames = stereo_slam::there_and_back(std::move(frames));
  stereo_slam::Pipeline pipeline(frames->rig(), how);
  double cpu = 0;
  for (std::size_t i = 0; i < frames->size(); ++i) {
    const stereo_slam::StereoFrame frame = frames->frame(i);
    const std::clock_t start = std::clock();
    pipeline.step(frame);
    cpu += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  }
  Run result{pipeline.record(), {}, 1e3 * cpu / static_cast<double>(frames->size())};
  result.summary = stereo_slam::summarise(result.record);
  return result;
}

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
  board.add({.name = "NEES of the pose: largest mean of a run",
             .measured = std::ranges::max(nees),
             .unit = "of 6",
             .must = 12,
             .aim = 9,
             .note = each});
  board.add({.name = "NEES of the pose: least mean of a run",
             .measured = std::ranges::min(nees),
             .unit = "of 6",
             .must = 3,
             .aim = 4,
             .better = cairn_bench::larger,
             .note = over});
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
  stereo_slam::PipelineOptions how;
  how.calibrate = stereo_slam::Calibration::drifting;
  board.add({.name = "arena loop on a rig that drifts: largest position error",
             .measured = run(what, how).summary.errors.value().largest.position,
             .unit = "m",
             .must = 0.03,
             .aim = 0.01,
             .note = "--drift 0.05 --calibrate drifting"});
}

fs::path data_folder() {
  const char* data = std::getenv("CAIRN_DATA");
  return data != nullptr ? data : "../shared/data";
}

std::optional<Run> run_drive(const std::string& name, const std::string& kind,
                             stereo_slam::Calibration calibrate, bool and_back = false) {
  stereo_slam::DatasetOptions what;
  what.kind = kind;
  what.folder = data_folder() / name;
  if (!fs::exists(what.folder)) return std::nullopt;
  stereo_slam::PipelineOptions how;
  how.calibrate = calibrate;
  return run(what, how, and_back);
}

/// A row of a drive, or why there is none.
void add(Scoreboard& board, Row row, const std::optional<double>& measured, bool data) {
  row.measured = measured;
  if (!measured) row.note = data ? "no value" : "no data";
  board.add(std::move(row));
}

/// The first 12 poses of the reference are filled in (docs/design.md): the drive begins after them.
void add_odometry_rows(Scoreboard& board, stereo_slam::Calibration calibrate) {
  const auto drive = run_drive("kitti_odometry_a", "kitti_odometry", calibrate);
  const std::string name = std::string("kitti_odometry_a from frame 12") +
                           (calibrate == stereo_slam::Calibration::off ? ", --calibrate off" : "");
  std::optional<double> end, ate, lost;
  std::optional<stereo_slam::MountedConsistency> consistency;
  if (drive) {
    std::vector<cairn::PosePair> pairs = stereo_slam::truth_pairs(drive->record);
    pairs.erase(pairs.begin(), pairs.begin() + 12);
    const cairn::SE3 E = (pairs.front().estimate.inverse() * pairs.back().estimate).inverse() *
                         (pairs.front().truth.inverse() * pairs.back().truth);
    end = 100 * E.translation().norm() / cairn::path_distances(pairs).back();
    ate = cairn::absolute_error(pairs)->translation.rmse;
    lost = static_cast<double>(drive->summary.frames_lost);
    consistency = stereo_slam::mounted_consistency(drive->record.frames, 12);
  }
  add(board, {.name = name + ": end error over the path", .unit = "%", .must = 0.6, .aim = 0.4}, end,
      drive.has_value());
  add(board, {.name = name + ": ATE", .unit = "m", .must = 0.05, .aim = 0.025}, ate, drive.has_value());
  add(board, {.name = name + ": frames lost", .unit = "", .must = 0}, lost, drive.has_value());
  add(board, {.name = name + ": NEES of the pose", .unit = "of 6"},
      consistency ? std::optional(consistency->nees_as_given) : std::nullopt, drive.has_value());
  std::string mounting;
  for (int i = 0; consistency && i < 3; ++i)
    mounting += (i == 0 ? "by " : ", ") + cairn::shortest(std::round(1e4 * consistency->turn(i)) / 10);
  add(board,
      {.name = name + ": the same, the reference turned against the camera",
       .unit = "of 6",
       .note = mounting + " mrad"},
      consistency ? std::optional(consistency->nees) : std::nullopt, drive.has_value());
  if (calibrate == stereo_slam::Calibration::automatic)
    add(board, {.name = "CPU a pair at 1226 x 370", .unit = "ms", .must = 45, .aim = 24},
        drive ? std::optional(drive->cpu_milliseconds) : std::nullopt, drive.has_value());
}

/// In the ground plane, because the altitude of the satellite receiver is not that of the car: it climbs by
/// 0.7 m between the frames 25 and 45, where the same receiver's upward velocity says that it does not, so
/// that from frame 50 on the reference is believed sideways, ahead and in heading. Besides, the reference
/// with its heights by that velocity.
void add_raw_rows(Scoreboard& board, stereo_slam::Calibration calibrate) {
  const auto drive = run_drive("kitti_raw_0926", "kitti_raw", calibrate);
  const std::string name =
      std::string("kitti_raw_0926") + (calibrate == stereo_slam::Calibration::off ? ", --calibrate off" : "");
  std::optional<double> ate, over25, over50, by_velocity50, level25, level50, lost, nees, level_nees;
  if (drive) {
    std::vector<cairn::PosePair> pairs = stereo_slam::truth_pairs(drive->record);
    lost = static_cast<double>(drive->summary.frames_lost);
    if (const auto all = stereo_slam::mounted_consistency(drive->record.frames, 0)) nees = all->nees_as_given;
    level_nees = stereo_slam::level_nees(drive->record.frames, 50);
    const auto mean_over = [&](double length, std::optional<double>& to) {
      if (const auto error = cairn::kitti_error(pairs, {.lengths = {length}, .step = 1}))
        to = error->overall.translation_percent();
    };
    mean_over(25, over25);
    mean_over(50, over50);
    const stereo_slam_bench::ReceiverHeights heights(data_folder() / "kitti_raw_0926");
    if (!heights.empty()) {
      // The reference of a frame is what the receiver said 0.1 s earlier, as its file says.
      constexpr double behind = 0.1;
      const double start = drive->record.frames.front().time;
      const std::vector<cairn::PosePair> as_given = pairs;
      for (cairn::PosePair& pair : pairs) {
        cairn::Vector<3> place = pair.truth.translation();
        place(1) += heights.slip(pair.time - start - behind);  // y points down
        pair.truth = cairn::SE3(pair.truth.rotation(), place);
      }
      mean_over(50, by_velocity50);
      pairs = as_given;
    }
    for (cairn::PosePair& pair : pairs)
      for (cairn::SE3* pose : {&pair.truth, &pair.estimate}) {
        cairn::Vector<3> flat = pose->translation();
        flat(1) = 0;
        *pose = cairn::SE3(pose->rotation(), flat);
      }
    mean_over(25, level25);
    mean_over(50, level50);
    ate = cairn::absolute_error(pairs)->translation.rmse;
  }
  add(board, {.name = name + ": horizontal ATE", .unit = "m", .must = 0.09, .aim = 0.07}, ate,
      drive.has_value());
  add(board, {.name = name + ": mean error over 25 m", .unit = "%"}, over25, drive.has_value());
  add(board, {.name = name + ": mean error over 50 m", .unit = "%", .must = 1.2, .aim = 1.0}, over50,
      drive.has_value());
  add(board,
      {.name = name + ": mean error over 50 m, heights by the receiver's upward velocity", .unit = "%"},
      by_velocity50, drive.has_value());
  add(board, {.name = name + ": mean error over 25 m in the ground plane", .unit = "%"}, level25,
      drive.has_value());
  add(board, {.name = name + ": mean error over 50 m in the ground plane", .unit = "%"}, level50,
      drive.has_value());
  add(board, {.name = name + ": frames lost", .unit = "", .must = 0}, lost, drive.has_value());
  add(board, {.name = name + ": NEES of the pose", .unit = "of 6"}, nees, drive.has_value());
  add(board, {.name = name + " from frame 50: NEES sideways, ahead and in heading", .unit = "of 3"},
      level_nees, drive.has_value());
}

/// Without any truth: the frames of the drive forwards, then backwards.
void add_return_row(Scoreboard& board) {
  const auto drive =
      run_drive("kitti_raw_0926", "kitti_raw", stereo_slam::Calibration::automatic, /*and_back=*/true);
  std::optional<double> off;
  if (drive) off = stereo_slam::return_error(drive->record.frames).percent();
  add(board,
      {.name = "kitti_raw_0926 forwards then backwards: off the start, over the path",
       .unit = "%",
       .must = 0.2,
       .aim = 0.02},
      off, drive.has_value());
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
  stereo_slam::Pipeline mapping(lap->rig(), how);
  for (std::size_t i = 0; i < lap->size(); ++i) mapping.step(lap->frame(i));
  const fs::path file = fs::temp_directory_path() / ("cairn_map_" + std::to_string(::getpid()));
  stereo_slam::save_map(file, mapping.map());
  const stereo_slam::SavedMap saved = stereo_slam::load_map(file);
  fs::remove(file);

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
  const cairn::SE3 T_truth_world = *lap->frame(0).truth;
  how.localise = true;
  std::size_t found = 0, wrong = 0;
  for (std::size_t i = 0; i < views; ++i) {
    stereo_slam::Pipeline pipeline(seen->rig(), how, saved, "map");
    const stereo_slam::StereoFrame frame = seen->frame(i);
    const stereo_slam::FrameRecord& record = pipeline.step(frame);
    if (!record.tracked) continue;
    const stereo_slam::FrameError error =
        stereo_slam::frame_error(record.T_world_camera, T_truth_world.inverse() * *frame.truth);
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
    }
  }
  board.add({.name = "rate, arena 768 x 576, 2000 points an image, 2 threads",
             .measured = 1e3 * static_cast<double>(frames->size()) / milliseconds,
             .unit = "Hz",
             .must = 25,
             .aim = 40,
             .better = cairn_bench::larger});
}

}  // namespace

int main(int argc, char** argv) {
  if (const auto code = cairn_bench::answer(argc, argv, "scoreboard_stereo_slam")) return *code;
  Scoreboard board("stereo_slam");
  if (wanted("video"))
    stereo_slam_bench::add_hour_rows(board, 600 * video_minutes());  // its memory is ours: first
  if (wanted("arena")) add_arena_rows(board);
  if (wanted("joint")) stereo_slam_bench::add_joint_rows(board);
  for (const auto calibrate : {stereo_slam::Calibration::automatic, stereo_slam::Calibration::off}) {
    if (!wanted("drives")) break;
    add_odometry_rows(board, calibrate);
    add_raw_rows(board, calibrate);
  }
  if (wanted("return")) add_return_row(board);
  if (wanted("drift")) add_drift_row(board);
  if (wanted("relocalisation")) add_relocalisation_rows(board);
  if (wanted("starry_night")) stereo_slam_bench::add_starry_night_rows(board);
  if (wanted("rate")) add_rate_row(board);
  if (wanted("stores")) stereo_slam_bench::add_store_rows(board);
  return board.finish();
}
