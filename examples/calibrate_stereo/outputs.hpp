// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a calibration leaves in its folder: rig.yaml (support/rig_file.hpp), summary.json, report.html.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <cairn/vision/image.hpp>

#include "board_calibration.hpp"

namespace calibrate_stereo {

struct Results {
  int columns = 0, rows = 0;
  double square = 0;  ///< [m]
  std::vector<cairn::Vector<3>> board;
  std::vector<BoardView> views;
  BoardCalibration calibration;
  std::vector<HeldOut> held_out;  ///< one a view
  double start_rms = 0;           ///< OpenCV's [pixels]
  double start_difference = 0;    ///< of a number from OpenCV's at most, in standard deviations
  cairn::Image sample;            ///< left image of the first view
  std::vector<std::string> notes;
};

void prepare_folder(const std::filesystem::path& folder);

/// Writes all files or, throwing cairn::Error, none. Returns why there is no report where the program was
/// built without the page for it.
[[nodiscard]] std::optional<std::string> write_outputs(const Results& results,
                                                       const std::filesystem::path& folder);

/// RMS of the epipolar distances of pairs that the calibration had not seen [pixels].
[[nodiscard]] double held_out_epipolar(const Results& results);
/// Mean over pairs of the relative error of lengths that it had not seen.
[[nodiscard]] double held_out_length(const Results& results);

}  // namespace calibrate_stereo
