// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/text.hpp>

#include "recording.hpp"

namespace stereo_slam {
namespace {

using Path = std::filesystem::path;

Path calibration_file(const Path& folder) {
  constexpr const char* name = "calib_cam_to_cam.txt";
  std::error_code failure;
  const Path whole = std::filesystem::canonical(folder, failure);
  for (const Path& place : {folder, folder / "calib", whole.parent_path(), whole.parent_path() / "calib"})
    if (is_file(place / name)) return place / name;
  cairn::raise((folder / name).string() +
               ": no such file, there or in calib or one folder up; expected the calibration of the cameras");
}

cairn::Matrix<3> rotation_of(const std::vector<double>& numbers) {
  cairn::Matrix<3> m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = numbers[static_cast<std::size_t>(i)];
  return m;
}

// x_camera = R_0i x_0 + T_0i of the calibration file.
cairn::SE3 camera_from_first(const KeyedNumbers& calibration, const std::string& camera) {
  const std::vector<double>& t = calibration.at("T_" + camera, 3);
  return {cairn::SO3::from_matrix(rotation_of(calibration.at("R_" + camera, 9))), {t[0], t[1], t[2]}};
}

cairn::PinholeCamera raw_camera(const KeyedNumbers& calibration, const Path& file,
                                const std::string& camera) {
  const std::vector<double>& k = calibration.at("K_" + camera, 9);
  const std::vector<double>& d = calibration.at("D_" + camera, 5);
  const std::vector<double>& size = calibration.at("S_" + camera, 2);
  return cairn::PinholeCamera(pinhole({k[0], k[4], k[2], k[5]}, d, size, file));
}

// What `make` makes of a file; where it throws, what it says is said of the file.
template <class Make>
auto made_of(const Path& file, const Make& make) {
  try {
    return make();
  } catch (const cairn::Error& error) {
    const std::string message = error.what();
    if (message.find(file.string()) != std::string::npos) throw;
    cairn::raise(file.string() + ": " + message);
  }
}

cairn::StereoRig raw_rig(const KeyedNumbers& calibration, const Path& file) {
  return made_of(file, [&] {
    return cairn::StereoRig{
        raw_camera(calibration, file, "00"), raw_camera(calibration, file, "01"),
        camera_from_first(calibration, "00") * camera_from_first(calibration, "01").inverse()};
  });
}

std::map<std::size_t, Path> numbered_images(const Path& folder, const std::string& expected) {
  std::map<std::size_t, Path> images;
  for (const Path& file : image_files(folder, expected)) {
    const std::optional<std::size_t> number = number_of(file);
    if (!number) cairn::raise(file.string() + ": the name is no number; expected names like 0000000012.png");
    const auto [other, fresh] = images.emplace(*number, file);
    if (!fresh)
      cairn::raise(file.string() + ": has the number of " + other->second.filename().string() +
                   "; expected one image a number");
  }
  return images;
}

// "2011-09-26 14:05:35.500923136" in seconds since 1970; the fraction may be absent, nothing else may differ.
std::optional<double> seconds_of(std::string_view text) {
  constexpr std::string_view form = "dddd-dd-dd dd:dd:dd";
  const auto is_digit = [](char letter) { return letter >= '0' && letter <= '9'; };
  if (text.size() < form.size()) return std::nullopt;
  for (std::size_t i = 0; i < form.size(); ++i)
    if (form[i] == 'd' ? !is_digit(text[i]) : text[i] != form[i]) return std::nullopt;
  const std::string_view fraction = text.substr(form.size());
  if (!fraction.empty() && (fraction.size() < 2 || fraction[0] != '.' ||
                            !std::all_of(fraction.begin() + 1, fraction.end(), is_digit)))
    return std::nullopt;
  const auto part = [&](std::size_t from, std::size_t count) {
    return *cairn::parse_number<int>(text.substr(from, count));
  };
  const int hour = part(11, 2), minute = part(14, 2);
  const std::optional<double> second = cairn::parse_number(text.substr(17));
  if (hour > 23 || minute > 59 || !second || !(*second < 60)) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(part(0, 4)),
                                         std::chrono::month(static_cast<unsigned>(part(5, 2))),
                                         std::chrono::day(static_cast<unsigned>(part(8, 2)))};
  if (!date.ok()) return std::nullopt;
  const auto days = std::chrono::sys_days(date).time_since_epoch().count();
  return 86400.0 * static_cast<double>(days) + 3600.0 * hour + 60.0 * minute + *second;
}

// Line n (from 0) is the time of frame n, also where its image is missing; 10 Hz where there is no file.
void add_times(const Path& file, Recording& recording) {
  const std::size_t last = recording.frames.back().index;
  for (RecordedFrame& frame : recording.frames) frame.time = 0.1 * static_cast<double>(frame.index);
  if (!is_file(file)) return;
  std::vector<double> times;
  cairn::TextLines lines(file, "the time stamps of a KITTI drive");
  while (lines.next()) {
    const std::optional<double> time = seconds_of(lines.line());
    if (!time) lines.fail("a time like 2011-09-26 14:05:35.500923136");
    if (!times.empty() && *time < times.back()) lines.fail("times that do not run backwards");
    times.push_back(*time);
  }
  if (times.size() <= last)
    cairn::raise(file.string() + ": holds " + std::to_string(times.size()) +
                 " times; expected one for each frame up to the last, " + std::to_string(last));
  for (RecordedFrame& frame : recording.frames) frame.time = times[frame.index];
}

// Poses of the rectified camera 0; x_rectified = R_rect_00 x_0.
void add_truth(const Path& file, const KeyedNumbers& calibration, const Path& calibration_of,
               Recording& recording) {
  if (!is_file(file)) return;
  const cairn::SE3 T_rectified_0(
      made_of(calibration_of,
              [&] { return cairn::SO3::from_matrix(rotation_of(calibration.at("R_rect_00", 9))); }),
      cairn::Vector<3>::Zero());
  const cairn::SE3 T_rectified_left = T_rectified_0 * camera_from_first(calibration, "00").inverse();
  std::map<std::size_t, cairn::SE3> poses;
  cairn::TextLines lines(file, "poses of camera 0: frame number and 3 x 4 numbers a line");
  double row[13];
  while (lines.next()) {
    if (lines.numbers(' ', row, 13) != 13 || row[0] < 0 || row[0] > 1e12 || row[0] != std::floor(row[0]))
      lines.fail("13 numbers: the frame and a 3 x 4 pose");
    cairn::Matrix<4> pose = cairn::Matrix<4>::Identity();
    for (int i = 0; i < 12; ++i) pose(i / 4, i % 4) = row[i + 1];
    const auto frame = static_cast<std::size_t>(row[0]);
    if (poses.contains(frame)) lines.fail("one pose a frame, not a second of " + std::to_string(frame));
    try {
      poses[frame] = cairn::SE3::from_matrix(pose);
    } catch (const cairn::Error& error) {
      lines.fail(std::string("a pose (") + error.what() + ")");
    }
  }
  for (RecordedFrame& frame : recording.frames)
    if (const auto pose = poses.find(frame.index); pose != poses.end())
      frame.truth = pose->second * T_rectified_left;
}

void note_unpaired(const char* camera, const std::vector<std::size_t>& frames, Recording& recording) {
  if (frames.empty()) return;
  recording.notes.push_back(std::string("left out, no image of the ") + camera +
                            " camera: " + frames_text(frames));
}

void pair_up(const std::map<std::size_t, Path>& left, const std::map<std::size_t, Path>& right,
             Recording& recording) {
  std::vector<std::size_t> without_left, without_right;
  for (const auto& entry : left) {
    const auto partner = right.find(entry.first);
    if (partner == right.end())
      without_right.push_back(entry.first);
    else
      recording.frames.push_back({entry.first, 0, entry.second, partner->second, std::nullopt});
  }
  for (const auto& entry : right)
    if (left.find(entry.first) == left.end()) without_left.push_back(entry.first);
  note_unpaired("left", without_left, recording);
  note_unpaired("right", without_right, recording);
}

}  // namespace

Recording read_kitti_raw(const Path& folder) {
  require_folder(folder, "a KITTI raw drive (image_00/data, image_01/data)");
  const auto left = numbered_images(folder / "image_00" / "data", "the left images of a KITTI raw drive");
  const auto right = numbered_images(folder / "image_01" / "data", "the right images of a KITTI raw drive");
  Recording recording;
  recording.name = "kitti_raw " + folder.filename().string();
  const Path file = calibration_file(folder);
  const KeyedNumbers calibration(file);
  recording.rig = raw_rig(calibration, file);
  pair_up(left, right, recording);
  if (recording.frames.empty())
    cairn::raise(folder.string() + ": no image of image_00 has a partner in image_01; expected equal names");
  add_times(folder / "image_00" / "timestamps.txt", recording);
  add_truth(folder / "poses_cam0_rectified.txt", calibration, file, recording);
  return recording;
}

}  // namespace stereo_slam
