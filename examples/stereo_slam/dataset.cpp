// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "dataset.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <system_error>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>
#include <cairn/io/trajectory.hpp>

#include "arena_dataset.hpp"
#include "recording.hpp"
#include "support/image_io.hpp"

namespace stereo_slam {
namespace {

// A row of P = K [I | t] of a KITTI calibration, t in the units of K.
std::string projection(const char* label, const cairn::PinholeCamera& camera, double baseline) {
  std::string line = label;
  const auto add = [&](double value) {
    line += ' ';
    cairn::append_number(line, value);
  };
  for (const double value : {camera.fx(), 0.0, camera.cx(), -camera.fx() * baseline}) add(value);
  for (const double value : {0.0, camera.fy(), camera.cy(), 0.0}) add(value);
  for (const double value : {0.0, 0.0, 1.0, 0.0}) add(value);
  return line + "\n";
}

}  // namespace

std::unique_ptr<Dataset> open_dataset(const DatasetOptions& options) {
  if (options.kind == "arena") {
    if (options.rig)
      cairn::raise("the arena is rendered with a rig of its own; expected a recorded data set with --camera");
    return open_arena(options.arena, options.frames, options.threads);
  }
  const auto with_rig = [&](Recording recording) {
    if (options.rig) recording.rig = *options.rig;
    return play(std::move(recording), options.frames);
  };
  if (options.kind == "images") {
    if (!options.rig) cairn::raise("images need a rig; expected one with --camera (rig.yaml)");
    return with_rig(read_images({options.left, options.right, options.rate}));
  }
  using Reader = Recording (*)(const std::filesystem::path&);
  const std::map<std::string, Reader> readers{
      {"kitti_odometry", read_kitti_odometry}, {"kitti_raw", read_kitti_raw}, {"euroc", read_euroc}};
  const auto reader = readers.find(options.kind);
  if (reader == readers.end())
    cairn::raise("there is no kind of data set '" + options.kind +
                 "'; expected arena, kitti_odometry, kitti_raw, euroc or images");
  if (options.folder.empty()) cairn::raise("the data set " + options.kind + " needs a folder; expected one");
  std::filesystem::path folder = options.folder.lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();  // "drive/" is "drive"
  return with_rig(reader->second(folder));
}

std::size_t write_kitti_sequence(const Dataset& dataset, const std::filesystem::path& folder,
                                 const std::function<bool()>& go_on) {
  const cairn::StereoRig& rig = dataset.rig();
  if (!rig.rectified())
    cairn::raise(folder.string() + ": expected a rectified rig, a KITTI sequence cannot hold " +
                 dataset.name());
  std::error_code unread;
  if (std::filesystem::is_directory(folder, unread) && !std::filesystem::is_empty(folder, unread))
    cairn::raise(folder.string() + ": expected a new folder or an empty one, this holds files");
  for (const char* images : {"image_0", "image_1"}) {
    std::error_code failure;
    std::filesystem::create_directories(folder / images, failure);
    if (failure)
      cairn::raise((folder / images).string() + ": cannot make the folder (" + failure.message() + ")");
  }
  std::string times;
  cairn::Trajectory truth;
  std::size_t written = 0;
  for (bool on = true; on && written < dataset.size();) {
    const std::size_t i = written++;
    const StereoFrame frame = dataset.frame(i);
    const std::string digits = std::to_string(i);
    const std::string file = std::string(6 - std::min<std::size_t>(6, digits.size()), '0') + digits + ".png";
    example::write_png(folder / "image_0" / file, frame.left);
    example::write_png(folder / "image_1" / file, frame.right);
    cairn::append_number(times, frame.time);
    times += '\n';
    if (frame.truth) truth.push_back({frame.time, *frame.truth});
    on = !go_on || go_on();
  }
  cairn::write_file_atomically(folder / "times.txt", times);
  cairn::write_file_atomically(folder / "calib.txt",
                               projection("P0:", rig.left, 0) + projection("P1:", rig.right, rig.baseline()));
  if (truth.size() == written) cairn::write_kitti(folder / "poses.txt", truth);
  return written;
}

}  // namespace stereo_slam
