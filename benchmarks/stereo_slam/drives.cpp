// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "drives.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/eval/kitti_metric.hpp>
#include <cairn/eval/trajectory_error.hpp>
#include <cairn/io/text.hpp>
#include <cairn/io/trajectory.hpp>

#include "receiver_heights.hpp"
#include "reference_mounting.hpp"
#include "rival_viso2.hpp"
#include "runs.hpp"
#include "there_and_back.hpp"

namespace stereo_slam_bench {
namespace {

namespace fs = std::filesystem;
using cairn_bench::Row;
using cairn_bench::Scoreboard;

/// Where a camera was in each frame by somebody else's word.
struct OtherPath {
  std::string name;
  std::vector<cairn::SE3> poses;
  std::optional<double> cpu_milliseconds = std::nullopt;  ///< of a pair
};

struct Drive {
  Run run;
  std::vector<OtherPath> others;
};

/// DRIVE.NAME.txt of CAIRN_RIVAL_PATHS: one KITTI row a frame. Throws cairn::Error for another number of
/// rows.
std::vector<OtherPath> saved_paths(const std::string& drive, std::size_t frames) {
  std::vector<OtherPath> result;
  const char* folder = std::getenv("CAIRN_RIVAL_PATHS");
  if (folder == nullptr) return result;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    if (!file.starts_with(drive + '.') || entry.path().extension() != ".txt") continue;
    OtherPath path{entry.path().stem().string().substr(drive.size() + 1), {}};
    for (const cairn::StampedPose& pose : cairn::read_kitti(entry.path()))
      path.poses.push_back(pose.T_world_body);
    if (path.poses.size() != frames)
      cairn::raise(entry.path().string() + ": expected " + std::to_string(frames) +
                   " poses, as many as the drive has frames, found " + std::to_string(path.poses.size()));
    result.push_back(std::move(path));
  }
  std::ranges::sort(result, {}, &OtherPath::name);
  return result;
}

/// The drive with those that are compared with it; libviso2 is shown each pair in turn with the system.
Drive run_with_rivals(const std::string& name, const stereo_slam::DatasetOptions& what) {
  const auto frames = stereo_slam::open_dataset(what);
  const std::unique_ptr<Viso2> viso2 = Viso2::beside(frames->rig());
  Beside beside;
  if (viso2) beside = [&](const stereo_slam::StereoFrame& frame) { viso2->step(frame); };
  Drive drive{run(*frames, {}, beside), {}};
  drive.others = saved_paths(name, drive.run.record.frames.size());
  if (viso2)
    drive.others.insert(drive.others.begin(), {"libviso2", viso2->poses(), viso2->cpu_milliseconds()});
  return drive;
}

std::optional<stereo_slam::DatasetOptions> known_drive(const std::string& name, const std::string& kind) {
  stereo_slam::DatasetOptions what;
  what.kind = kind;
  what.folder = data_folder() / name;
  if (!fs::exists(what.folder)) return std::nullopt;
  return what;
}

std::optional<Drive> run_drive(const std::string& name, const std::string& kind,
                               stereo_slam::Calibration calibrate) {
  const auto what = known_drive(name, kind);
  if (!what) return std::nullopt;
  if (calibrate == stereo_slam::Calibration::automatic) return run_with_rivals(name, *what);
  stereo_slam::PipelineOptions how;
  how.calibrate = calibrate;
  return Drive{run(*what, how), {}};
}

/// Estimate and truth of the frames that have one, from frame `first` on, of the system or of `other`.
std::vector<cairn::PosePair> pairs_of(const Drive& drive, std::size_t first,
                                      const OtherPath* other = nullptr) {
  std::vector<cairn::PosePair> pairs;
  for (std::size_t i = first; i < drive.run.record.frames.size(); ++i) {
    const stereo_slam::FrameRecord& frame = drive.run.record.frames[i];
    if (frame.truth)
      pairs.push_back({frame.time, *frame.truth, other ? other->poses[i] : frame.T_world_camera});
  }
  return pairs;
}

/// How far off the drive ends once its first poses coincide, over its length [%].
std::optional<double> end_error(const std::vector<cairn::PosePair>& pairs) {
  if (pairs.size() < 2) return std::nullopt;
  const double length = cairn::path_distances(pairs).back();
  if (!(length > 0)) return std::nullopt;
  const cairn::SE3 E = (pairs.front().estimate.inverse() * pairs.back().estimate).inverse() *
                       (pairs.front().truth.inverse() * pairs.back().truth);
  return 100 * E.translation().norm() / length;
}

std::optional<double> rms_after_fit(const std::vector<cairn::PosePair>& pairs) {
  const auto error = cairn::absolute_error(pairs);
  return error ? std::optional(error->translation.rmse) : std::nullopt;
}

/// The KITTI measure over stretches of one length [%]; nothing where the drive is shorter.
std::optional<double> mean_over(double length, const std::vector<cairn::PosePair>& pairs) {
  const auto error = cairn::kitti_error(pairs, {.lengths = {length}, .step = 1});
  return error ? std::optional(error->overall.translation_percent()) : std::nullopt;
}

/// The row once for the system and, beside it, each of the others by the same measure.
template <class Measure>
void add_compared(Scoreboard& board, const Row& row, const std::optional<Drive>& drive, std::size_t first,
                  Measure measure) {
  std::optional<double> ours;
  if (drive) ours = measure(pairs_of(*drive, first));
  Row own = row;
  if (drive && !drive->others.empty()) {
    own.rival = measure(pairs_of(*drive, first, &drive->others.front()));
    own.rival_name = drive->others.front().name;
  }
  add(board, own, ours, drive.has_value());
  for (std::size_t i = 1; drive && i < drive->others.size(); ++i) {
    const OtherPath& other = drive->others[i];
    add(board, {.name = row.name + ", by " + other.name, .unit = row.unit},
        measure(pairs_of(*drive, first, &other)), true);
  }
}

void add_cpu_row(Scoreboard& board, Row row, const std::optional<Drive>& drive) {
  row.unit = "ms";
  for (const OtherPath& other : drive ? drive->others : std::vector<OtherPath>()) {
    if (!other.cpu_milliseconds) continue;
    row.rival = other.cpu_milliseconds;
    row.rival_name = other.name;
  }
  add(board, std::move(row), drive ? std::optional(drive->run.cpu_milliseconds) : std::nullopt,
      drive.has_value());
}

/// A row as it is owed of a drive that is driven by default; without calibration it is shown for comparison.
Row owed(stereo_slam::Calibration calibrate, Row row) {
  if (calibrate == stereo_slam::Calibration::off) row.must = row.aim = std::nullopt;
  return row;
}

std::optional<double> frames_lost(const std::optional<Drive>& drive) {
  return drive ? std::optional(static_cast<double>(drive->run.summary.frames_lost)) : std::nullopt;
}

/// The first 12 poses of the reference are filled in (docs/stereo_slam.md): the drive begins after them.
void add_odometry_rows(Scoreboard& board, stereo_slam::Calibration calibrate) {
  const auto drive = run_drive("kitti_odometry_a", "kitti_odometry", calibrate);
  const std::string name = std::string("kitti_odometry_a from frame 12") +
                           (calibrate == stereo_slam::Calibration::off ? ", --calibrate off" : "");
  constexpr std::size_t first = 12;
  std::optional<stereo_slam::MountedConsistency> consistency;
  if (drive) consistency = stereo_slam::mounted_consistency(drive->run.record.frames, first);
  add_compared(
      board,
      owed(calibrate, {.name = name + ": end error over the path", .unit = "%", .must = 0.6, .aim = 0.4}),
      drive, first, end_error);
  add_compared(board, owed(calibrate, {.name = name + ": ATE", .unit = "m", .must = 0.05, .aim = 0.025}),
               drive, first, rms_after_fit);
  add(board, {.name = name + ": frames lost", .unit = "", .must = 0}, frames_lost(drive), drive.has_value());
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
    add_cpu_row(board, {.name = "CPU a pair at 1226 x 370", .must = 45, .aim = 24}, drive);
}

/// In the ground plane, because the altitude of the satellite receiver is not that of the car: it climbs by
/// 0.7 m between the frames 25 and 45, where the same receiver's upward velocity says that it does not, so
/// that from frame 50 on the reference is believed sideways, ahead and in heading. Besides, the reference
/// with its heights by that velocity.
void add_raw_rows(Scoreboard& board, stereo_slam::Calibration calibrate) {
  const auto drive = run_drive("kitti_raw_0926", "kitti_raw", calibrate);
  const std::string name =
      std::string("kitti_raw_0926") + (calibrate == stereo_slam::Calibration::off ? ", --calibrate off" : "");
  std::optional<double> ate, over25, over50, by_velocity50, level25, level50, nees, level_nees;
  if (drive) {
    const std::vector<stereo_slam::FrameRecord>& frames = drive->run.record.frames;
    std::vector<cairn::PosePair> pairs = pairs_of(*drive, 0);
    if (const auto all = stereo_slam::mounted_consistency(frames, 0)) nees = all->nees_as_given;
    level_nees = stereo_slam::level_nees(frames, 50);
    over25 = mean_over(25, pairs);
    over50 = mean_over(50, pairs);
    const ReceiverHeights heights(data_folder() / "kitti_raw_0926");
    if (!heights.empty()) {
      // The reference of a frame is what the receiver said 0.1 s earlier, as its file says.
      constexpr double behind = 0.1;
      const double start = frames.front().time;
      const std::vector<cairn::PosePair> as_given = pairs;
      for (cairn::PosePair& pair : pairs) {
        cairn::Vector<3> place = pair.truth.translation();
        place(1) += heights.slip(pair.time - start - behind);  // y points down
        pair.truth = cairn::SE3(pair.truth.rotation(), place);
      }
      by_velocity50 = mean_over(50, pairs);
      pairs = as_given;
    }
    for (cairn::PosePair& pair : pairs)
      for (cairn::SE3* pose : {&pair.truth, &pair.estimate}) {
        cairn::Vector<3> flat = pose->translation();
        flat(1) = 0;
        *pose = cairn::SE3(pose->rotation(), flat);
      }
    level25 = mean_over(25, pairs);
    level50 = mean_over(50, pairs);
    ate = rms_after_fit(pairs);
  }
  add(board, owed(calibrate, {.name = name + ": horizontal ATE", .unit = "m", .must = 0.09, .aim = 0.07}),
      ate, drive.has_value());
  add(board, {.name = name + ": mean error over 25 m", .unit = "%"}, over25, drive.has_value());
  add(board, owed(calibrate, {.name = name + ": mean error over 50 m", .unit = "%", .must = 1.2, .aim = 1.0}),
      over50, drive.has_value());
  add(board,
      {.name = name + ": mean error over 50 m, heights by the receiver's upward velocity", .unit = "%"},
      by_velocity50, drive.has_value());
  add(board, {.name = name + ": mean error over 25 m in the ground plane", .unit = "%"}, level25,
      drive.has_value());
  add(board, {.name = name + ": mean error over 50 m in the ground plane", .unit = "%"}, level50,
      drive.has_value());
  add(board, {.name = name + ": frames lost", .unit = "", .must = 0}, frames_lost(drive), drive.has_value());
  add(board, {.name = name + ": NEES of the pose", .unit = "of 6"}, nees, drive.has_value());
  add(board, {.name = name + " from frame 50: NEES sideways, ahead and in heading", .unit = "of 3"},
      level_nees, drive.has_value());
}

}  // namespace

void add_drive_rows(Scoreboard& board) {
  for (const auto calibrate : {stereo_slam::Calibration::automatic, stereo_slam::Calibration::off}) {
    add_odometry_rows(board, calibrate);
    add_raw_rows(board, calibrate);
  }
}

void add_given_drive_rows(Scoreboard& board) {
  const char* text = std::getenv("CAIRN_DRIVES");
  std::istringstream drives(text != nullptr ? text : "");
  for (std::string one; std::getline(drives, one, ',');) {
    const std::size_t equals = one.find('=');
    if (equals == std::string::npos)
      cairn::raise("CAIRN_DRIVES: expected KIND=DIR,KIND=DIR, found '" + one + '\'');
    stereo_slam::DatasetOptions what;
    what.kind = one.substr(0, equals);
    what.folder = fs::path(one.substr(equals + 1)).lexically_normal();
    const std::string name =
        (what.folder.has_filename() ? what.folder : what.folder.parent_path()).filename().string();
    const std::optional<Drive> drive = run_with_rivals(name, what);
    add_compared(board, {.name = name + ": end error over the path", .unit = "%"}, drive, 0, end_error);
    add_compared(board, {.name = name + ": ATE", .unit = "m"}, drive, 0, rms_after_fit);
    for (const double length : {25.0, 50.0, 100.0, 200.0}) {
      const auto over = [&](const auto& pairs) { return mean_over(length, pairs); };
      if (!over(pairs_of(*drive, 0))) continue;
      add_compared(board, {.name = name + ": mean error over " + cairn::shortest(length) + " m", .unit = "%"},
                   drive, 0, over);
    }
    add(board, {.name = name + ": frames lost", .unit = ""}, frames_lost(drive), true);
    add_cpu_row(board, {.name = name + ": CPU a pair"}, drive);
  }
}

void add_return_row(Scoreboard& board) {
  std::optional<double> off;
  const auto what = known_drive("kitti_raw_0926", "kitti_raw");
  if (what) off = stereo_slam::return_error(run(*what, {}, /*and_back=*/true).record.frames).percent();
  add(board,
      {.name = "kitti_raw_0926 forwards then backwards: off the start, over the path",
       .unit = "%",
       .must = 0.2,
       .aim = 0.02},
      off, what.has_value());
}

}  // namespace stereo_slam_bench
