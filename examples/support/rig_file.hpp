// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A stereo rig in a file, version 1: what `--camera` reads, `--save-rig` and calibrate_stereo write.
///
/// ```yaml
/// cairn_rig: 1                          # version of this format
/// left:
///   image_size: [1242, 375]             # width, height [pixels]
///   intrinsics: [718.9, 718.9, 607.2, 185.2]          # fx, fy, cx, cy [pixels], first pixel's centre (0, 0)
///   distortion: [0, 0, 0, 0, 0]         # k1, k2, p1, p2, k3 (cairn/geometry/camera.hpp); absent: none
///   intrinsics_sigma: [0.2, 0.2, 0.4, 0.3]            # standard deviations; absent: not known
///   distortion_sigma: [1e-3, 3e-3, 2e-4, 2e-4, 5e-3]
/// right: ...                            # the same
/// T_left_right:                         # carries the right camera's coordinates to the left's
///   rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1]             # row by row
///   translation: [0.54, 0, 0]           # [m], about (baseline, 0, 0)
///   rotation_sigma: [3e-5, 4e-4, 2e-5]  # about the right camera's axes [rad]
///   translation_sigma: [0, 1e-4, 1e-4]  # along the left camera's axes [m]
/// note: where it is from
/// ```
///
/// Instead of `intrinsics` a camera may have OpenCV's `camera_matrix`, and any list may be one of OpenCV's
/// matrices (`rows`, `cols`, `dt`, `data`). A file without `cairn_rig` is read as what OpenCV's stereo
/// calibration leaves: M1, D1, M2, D2, R, T with x_right = R x_left + T, and image_width, image_height where
/// they are there; its other keys are passed over. T is then taken to be in metres. One with `cam0` is a
/// camera chain of Kalibr's, of two pinhole cameras, the left one first.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_rig.hpp>

namespace example {

/// How well a camera's numbers are known; nothing where that is not known.
struct CameraSigmas {
  std::optional<std::array<double, 4>> intrinsics;  ///< of fx, fy, cx, cy [pixels]
  std::optional<std::array<double, 5>> distortion;  ///< of k1, k2, p1, p2, k3
};

struct CalibratedRig {
  cairn::StereoRig rig;
  CameraSigmas left, right;
  std::optional<cairn::Vector<3>> rotation_sigma;     ///< about the right camera's axes [rad]
  std::optional<cairn::Vector<3>> translation_sigma;  ///< along the left camera's axes [m]
  std::string note;

  /// The largest standard deviation of an angle by which the right camera or the direction of the baseline
  /// may be off [rad]; nothing where the file does not say.
  [[nodiscard]] std::optional<double> angle_sigma() const;
};

/// Throws cairn::Error naming the file, the field and what was expected; also where the program was built
/// without yaml-cpp.
[[nodiscard]] CalibratedRig read_rig(const std::filesystem::path& path);

/// The same of a text; `name` is for messages.
[[nodiscard]] CalibratedRig parse_rig(std::string_view text, const std::string& name);

/// As read_rig reads it, bit for bit but for the rotation, which is within rounding.
[[nodiscard]] std::string rig_text(const CalibratedRig& rig);

/// Writes it completely or not at all. Throws cairn::Error naming the path.
void write_rig(const std::filesystem::path& path, const CalibratedRig& rig);

}  // namespace example
