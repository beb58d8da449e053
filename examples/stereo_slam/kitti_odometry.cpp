// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>
#include <cairn/io/trajectory.hpp>

#include "recording.hpp"

namespace stereo_slam {
namespace {

using Path = std::filesystem::path;
using Projection = std::vector<double>;  // 3 x 4, row by row

constexpr double frames_a_second_of_kitti = 10;  // where there is no times.txt

// P of the left and the right camera: rows P0: and P1:, or the first two rows of 12 numbers without names.
std::array<Projection, 2> read_projections(const Path& file) {
  const KeyedNumbers keyed(file);
  std::array<Projection, 2> both{Projection(12), Projection(12)};
  cairn::TextLines lines(file, "a KITTI calibration");
  const bool any = lines.next();
  if (!any || lines.line().find(':') != std::string_view::npos)
    return {keyed.at("P0", 12), keyed.at("P1", 12)};
  for (std::size_t i = 0; i < 2; ++i) {
    if (i > 0 && !lines.next()) lines.fail("a second row of 12 numbers, the right camera's projection");
    if (lines.numbers(' ', both[i].data(), 12) != 12) lines.fail("12 numbers, a camera's 3 x 4 projection");
  }
  return both;
}

// P = K [I | t] with t = (-baseline, 0, 0) relative to camera 0.
cairn::StereoRig rectified_rig(const Path& file) {
  const auto [left, right] = read_projections(file);
  cairn::StereoRig rig;
  for (const Projection* p : {&left, &right}) {
    if ((*p)[1] != 0 || (*p)[4] != 0 || (*p)[8] != 0 || (*p)[9] != 0 || (*p)[10] != 1 || !((*p)[0] > 0) ||
        !((*p)[5] > 0))
      cairn::raise(file.string() + ": expected projections K [I | t] with positive focal lengths");
    cairn::PinholeParameters camera;
    camera.fx = (*p)[0];
    camera.fy = (*p)[5];
    camera.cx = (*p)[2];
    camera.cy = (*p)[6];
    (p == &left ? rig.left : rig.right) = cairn::PinholeCamera(camera);
  }
  const double baseline = left[3] / left[0] - right[3] / right[0];
  if (!(baseline > 0))
    cairn::raise(file.string() +
                 ": expected the second camera to the right of the first, found a baseline of " +
                 cairn::shortest(baseline) + " m");
  rig.T_left_right = {{}, {baseline, 0, 0}};
  return rig;
}

std::vector<double> read_times(const Path& file, std::size_t frames) {
  std::vector<double> times(frames);
  if (!is_file(file)) {
    for (std::size_t i = 0; i < frames; ++i) times[i] = static_cast<double>(i) / frames_a_second_of_kitti;
    return times;
  }
  cairn::TextLines lines(file, "the times of a KITTI sequence");
  for (std::size_t i = 0; i < frames; ++i) {
    if (!lines.next() || lines.numbers(' ', &times[i], 1) != 1)
      lines.fail("one time for each of the " + std::to_string(frames) + " frames");
    if (i > 0 && times[i] < times[i - 1]) lines.fail("times that do not run backwards");
  }
  if (lines.next()) lines.fail("no more than " + std::to_string(frames) + " times, one a frame");
  return times;
}

// poses.txt beside the images, or poses/00.txt for sequences/00.
std::optional<Path> pose_file(const Path& folder) {
  std::error_code failure;
  const Path whole = std::filesystem::canonical(folder, failure);
  const Path beside = folder / "poses.txt";
  const Path published = whole.parent_path().parent_path() / "poses" / (whole.filename().string() + ".txt");
  if (is_file(beside)) return beside;
  if (is_file(published)) return published;
  return std::nullopt;
}

void add_truth(const Path& folder, Recording& recording) {
  const std::optional<Path> file = pose_file(folder);
  if (!file) return;
  const cairn::Trajectory poses = cairn::read_kitti(*file);
  if (poses.size() != recording.frames.size())
    cairn::raise(file->string() + ": holds " + std::to_string(poses.size()) + " poses; expected " +
                 std::to_string(recording.frames.size()) + ", one a frame");
  for (std::size_t i = 0; i < poses.size(); ++i) recording.frames[i].truth = poses[i].T_world_body;
}

}  // namespace

Recording read_kitti_odometry(const Path& folder) {
  require_folder(folder, "a KITTI odometry sequence (image_0, image_1, calib.txt)");
  std::error_code failure;
  const bool excerpt = std::filesystem::is_directory(folder / "image_l", failure);
  const Path left_folder = folder / (excerpt ? "image_l" : "image_0");
  const Path right_folder = folder / (excerpt ? "image_r" : "image_1");
  const std::vector<Path> left = image_files(left_folder, "the left images of a KITTI odometry sequence");
  const std::vector<Path> right = image_files(right_folder, "the right images of a KITTI odometry sequence");
  if (left.size() != right.size())
    cairn::raise(right_folder.string() + ": holds " + std::to_string(right.size()) + " images; expected " +
                 std::to_string(left.size()) + " as in " + left_folder.string());

  Recording recording;
  recording.name = "kitti_odometry " + folder.filename().string();
  recording.rig = rectified_rig(folder / "calib.txt");
  const std::vector<double> times = read_times(folder / "times.txt", left.size());
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (left[i].filename() != right[i].filename())
      cairn::raise(right[i].string() + ": has no partner; expected " +
                   (right_folder / left[i].filename()).string());
    recording.frames.push_back({number_of(left[i]).value_or(i), times[i], left[i], right[i], std::nullopt});
  }
  add_truth(folder, recording);
  return recording;
}

}  // namespace stereo_slam
