// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What line_slam leaves in its folder: trajectory.txt (TUM), lines.csv, summary.json, report.html,
/// timing.json. All but the last are the same bytes for the same options and seed, whatever the number of
/// threads.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "drive.hpp"
#include "run.hpp"

namespace line_slam {

[[nodiscard]] std::string summary(const Results& results);
[[nodiscard]] std::optional<std::string> report(const Results& results, const Drive& drive);

/// Makes the folder where it is missing and checks that a file can be written. Throws cairn::Error.
void prepare_folder(const std::filesystem::path& folder);

/// Writes all files or, throwing cairn::Error, none. Returns why there is no report, where there is none.
[[nodiscard]] std::optional<std::string> write_outputs(const Results& results, const Drive& drive,
                                                       const std::filesystem::path& folder);

}  // namespace line_slam
