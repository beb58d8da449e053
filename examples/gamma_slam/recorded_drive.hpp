// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A drive that stereo cameras recorded, forwards and then its frames in reverse order: a loop of real
/// images.
///
/// Visual odometry is found between neighbouring frames, from interest points that both see. A way back over
/// the same frames would undo its errors exactly, so that each step of either way is perturbed by noise of
/// its own, which the steps' covariances say; and the heights of the way back are of other points than those
/// of the way there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "drive.hpp"
#include "ground_stereo.hpp"

namespace stereo_slam {
class Dataset;
}

namespace gamma_slam {

/// What a step of odometry is perturbed by: standard deviations.
struct OdometryNoise {
  double along = 0.04;  ///< of its length, along it
  double side = 0.02;   ///< of its length, to the side
  double turn = 0.25;   ///< [deg]
};

struct RecordedDriveOptions {
  std::string kind = "kitti_raw";  ///< kitti_raw, kitti_odometry or euroc
  std::filesystem::path folder;
  std::size_t frames = 0;  ///< only so many; 0 = all
  std::uint64_t seed = 1;
  unsigned threads = 1;
  OdometryNoise noise{};
  GroundStereoOptions ground{};
};

/// Opens the recording, which costs little. Throws cairn::Error where there is none, or one of less than two
/// frames.
[[nodiscard]] std::shared_ptr<const stereo_slam::Dataset> opened_recording(
    const RecordedDriveOptions& options);

[[nodiscard]] std::size_t frame_count(const stereo_slam::Dataset& data);

/// What an interrupted preparation throws.
class Interrupted : public std::runtime_error {
public:
  using std::runtime_error::runtime_error;
};

/// The drive ends, and turns back, before the first frame that cannot be read, shows no ground, has no true
/// pose or where odometry fails; throws cairn::Error where that leaves less than two. `on_frame` is called
/// after every frame, by one thread at a time, and then `on_step` after every step of odometry; what either
/// returns, if anything, is thrown as Interrupted.
[[nodiscard]] Drive recorded_drive(const stereo_slam::Dataset& data, const RecordedDriveOptions& options,
                                   const std::function<std::optional<std::string>()>& on_frame = {},
                                   const std::function<std::optional<std::string>()>& on_step = {});

}  // namespace gamma_slam
