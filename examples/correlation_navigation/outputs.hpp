// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the example leaves in its folder: summary.json, errors.csv and report.html.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "acquisition.hpp"
#include "loop_mapping.hpp"
#include "planar_flight.hpp"
#include "straight_flight.hpp"

namespace correlation_navigation {

struct Results {
  std::string field;               ///< what the flights (b) to (d) were over
  std::vector<std::string> notes;  ///< what could not be flown over this field, and why
  std::uint64_t seed = 0;
  std::size_t runs = 0;
  double seconds = 0;
  StraightFlight straight_options;
  StraightResult straight;
  std::vector<BudgetRow> budget;
  std::vector<DivergenceRow> divergence;
  AcquisitionResult acquisition;
  PlanarResult planar;
  LoopResult loop;
};

/// Errors, sigmas and bounds of the straight flight against time. Throws cairn::Error naming the column and
/// the row of a number that is not finite.
[[nodiscard]] std::string errors_csv(const StraightResult& result);

/// The summary as JSON text.
[[nodiscard]] std::string summary(const Results& results);

/// The report page as HTML, or nothing where the program was built without it.
[[nodiscard]] std::optional<std::string> report(const Results& results);

/// Makes the folder where it is missing and checks that a file can be written into it: before the work, not
/// after it. Throws cairn::Error.
void prepare_folder(const std::filesystem::path& folder);

/// Writes all files, each completely or not at all, into a prepared folder.
/// Throws cairn::Error naming what cannot be written.
void write_outputs(const Results& results, const std::filesystem::path& folder);

}  // namespace correlation_navigation
