// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The files a run leaves in its output folder: trajectory.tum, trajectory.kitti, trajectory_covariance.csv,
/// map.ply, summary.json, report.html and timing.json. All but the last are the same bytes for the same
/// options and data.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "run_record.hpp"
#include "support/rig_file.hpp"

namespace stereo_slam {

/// Makes the folder where it is missing, removes what killed runs left and proves that files can be written
/// there, so that a run does not end in vain; `besides` are other files that the run is to write, or empty.
/// Throws cairn::Error naming what cannot be.
void prepare_output_folder(const std::filesystem::path& folder,
                           const std::vector<std::filesystem::path>& besides = {});

/// Writes all files or, throwing cairn::Error that names the path, none: they take the place of another run's
/// as one step (support/result_folder.hpp). Returns why there is no report, where this program was built
/// without the page for it (a report of an earlier run is then removed).
[[nodiscard]] std::optional<std::string> write_outputs(const RunRecord& run,
                                                       const std::filesystem::path& folder);

/// The rig as a run believes it to be, which began with `given`, with the sigmas of the run's calibration: of
/// where the right camera stands, and of the cameras' own numbers where those were estimated.
[[nodiscard]] example::CalibratedRig learned_rig(const example::CalibratedRig& given, const RunRecord& run);

/// trajectory_covariance.csv: a head line, then a line a frame: its number, time [s], whether it was tracked
/// (1 or 0), and the upper triangle of the covariance of its pose, row by row: the 21 numbers P_11 P_12 ...
/// P_16 P_22 ... P_66 in m^2, m rad and rad^2. Error: truth = T_world_camera exp(e), e = (translation x y z,
/// rotation x y z) in the axes of the left camera. The frame that is the world has the gauge's.
void write_covariances(const std::filesystem::path& path, const std::vector<FrameRecord>& frames);

/// map.ply: x y z [m, world of the first camera], grey and red green blue (all the same grey, for viewers
/// that know no grey), sigma (root of the largest variance [m]), age [frames], sightings. A landmark with a
/// number that is not finite is left out, and a comment says how many were.
void write_map(const std::filesystem::path& path, const std::vector<LandmarkRecord>& landmarks);

}  // namespace stereo_slam
