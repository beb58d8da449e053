// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What fastslam leaves in its folder: trajectory.txt (TUM), landmarks.csv, summary.json, report.html,
/// timing.json. All but the last are the same bytes for the same log, options and seed, whatever the number
/// of threads.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "slam.hpp"

namespace fastslam {

[[nodiscard]] std::string summary(const Results& results);
[[nodiscard]] std::optional<std::string> report(const Results& results);

/// Makes the folder where it is missing and checks that a file can be written, and `besides`, if they have
/// names, beside the results. Throws cairn::Error.
void prepare_folder(const std::filesystem::path& folder,
                    const std::vector<std::filesystem::path>& besides = {});

/// Writes all files or, throwing cairn::Error, none. Returns why there is no report, where there is none.
[[nodiscard]] std::optional<std::string> write_outputs(const Results& results,
                                                       const std::filesystem::path& folder);

}  // namespace fastslam
