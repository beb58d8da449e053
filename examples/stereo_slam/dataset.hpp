// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where stereo frames come from: a rendered arena or a recorded drive, behind one interface.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/vision/image.hpp>

#include "arena.hpp"

namespace stereo_slam {

struct StereoFrame {
  std::size_t index = 0;  ///< the number that the data set itself gives the frame
  double time = 0;        ///< [s], from any origin
  cairn::Image left;
  cairn::Image right;
  std::optional<cairn::SE3>
      truth;                ///< T_world_left of the left camera of rig(), in a world of the data's own
  std::string truth_world;  ///< which world that is: by the same name, the same one; by none, no other's
  std::string name;         ///< for messages
};

/// A sequence of stereo frames from one rig.
class Dataset {
public:
  Dataset() = default;
  Dataset(const Dataset&) = delete;
  Dataset& operator=(const Dataset&) = delete;
  virtual ~Dataset() = default;

  [[nodiscard]] virtual std::string name() const = 0;
  [[nodiscard]] virtual std::size_t size() const = 0;
  [[nodiscard]] virtual const cairn::StereoRig& rig() const = 0;

  /// Frame i, 0 <= i < size(). Safe to call concurrently. Throws cairn::Error naming a file that is missing
  /// or damaged.
  [[nodiscard]] virtual StereoFrame frame(std::size_t i) const = 0;

  /// What a reader of the results should know: frames left out, truth that is missing.
  [[nodiscard]] virtual std::vector<std::string> notes() const = 0;
};

struct DatasetOptions {
  std::string kind = "arena";           ///< arena, kitti_odometry, kitti_raw, euroc or images
  std::filesystem::path folder;         ///< of a recorded data set
  std::optional<cairn::StereoRig> rig;  ///< of `images`; otherwise instead of the recording's
  std::string left, right;              ///< patterns for the names of the images, kind `images`
  std::optional<double> rate;           ///< their frames a second; nothing: as the names say
  std::size_t frames = 0;               ///< only so many; 0 = all
  unsigned threads = 1;                 ///< for rendering
  ArenaOptions arena;
};

/// The data set that the options name. Throws cairn::Error for an unknown kind, a missing folder, a
/// calibration that lacks something, or frames that do not pair up, naming the file and what was expected.
[[nodiscard]] std::unique_ptr<Dataset> open_dataset(const DatasetOptions& options);

/// Writes the frames as a KITTI odometry sequence (image_0, image_1, times.txt, calib.txt, poses.txt) that
/// other systems read, and returns how many there are: all, or those until go_on() says no, which is asked
/// after each. Needs a rectified rig; poses.txt is written when every frame has its truth. Throws
/// cairn::Error where the folder cannot be written or holds anything: nothing of anybody's is replaced.
std::size_t write_kitti_sequence(const Dataset& dataset, const std::filesystem::path& folder,
                                 const std::function<bool()>& go_on = {});

}  // namespace stereo_slam
