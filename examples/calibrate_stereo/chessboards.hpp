// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What OpenCV does here: finds the corners of chessboards, and where a calibration begins.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/vision/image.hpp>

#include "board_calibration.hpp"

namespace calibrate_stereo {

/// The inner corners of a chessboard, row by row, to a fraction of a pixel; nothing where not all are found.
[[nodiscard]] std::optional<std::vector<cairn::Vector<2>>> find_corners(cairn::ImageView image, int columns,
                                                                        int rows);

struct Start {
  cairn::StereoRig rig;
  std::vector<cairn::SE3> T_left_board;
  double rms = 0;  ///< OpenCV's, of the stereo calibration with all numbers free [pixels]
};

/// OpenCV's calibrateCamera for each camera and stereoCalibrate of both. Throws cairn::Error where OpenCV
/// refuses.
[[nodiscard]] Start begin(std::span<const cairn::Vector<3>> board, std::span<const BoardView> views,
                          int width, int height, const BoardCalibrationOptions& options);

}  // namespace calibrate_stereo
