// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the example leaves in its folder: summary.json, errors.csv, report.html and timing.json. All but the
/// last are the same bytes for the same options, whatever the number of threads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "acquisition.hpp"
#include "loop_mapping.hpp"
#include "planar_flight.hpp"
#include "straight_flight.hpp"

namespace correlation_navigation {

struct Results {
  std::string field;               ///< what the flights (b) to (d) were over
  std::vector<std::string> notes;  ///< what could not be flown over this field, and why
  std::optional<std::string>
      ended_early;  ///< in which experiment and why, where it did: later ones are missing
  std::uint64_t seed = 0;
  std::size_t runs = 0;
  StraightFlight straight_options;
  StraightResult straight;
  std::vector<BudgetRow> budget;
  std::vector<DivergenceRow> divergence;
  std::optional<AcquisitionResult> acquisition;
  std::optional<PlanarResult> planar;
  std::optional<LoopResult> loop;
  unsigned threads = 1;
  std::vector<std::pair<std::string, double>> seconds;  ///< that each experiment took
};

/// Errors, sigmas and bounds of the straight flight against time. Throws cairn::Error naming the column and
/// the row of a number that is not finite.
[[nodiscard]] std::string errors_csv(const StraightResult& result);

/// The summary as JSON text: null where an experiment was not made, or had nothing to measure.
[[nodiscard]] std::string summary(const Results& results);

/// How long the experiments took, as JSON text.
[[nodiscard]] std::string timing(const Results& results);

/// The report page as HTML, or nothing where the program was built without it.
[[nodiscard]] std::optional<std::string> report(const Results& results);

/// Makes the folder where it is missing, removes what killed runs left and checks that a file can be written
/// into it: before the work, not after it. Throws cairn::Error.
void prepare_folder(const std::filesystem::path& folder);

/// Writes all files or, throwing cairn::Error that names what cannot be written, none: they take the place of
/// another run's as one step (support/result_folder.hpp). Returns why there is no report, where this program
/// was built without the page for it (a report of an earlier run is then removed).
[[nodiscard]] std::optional<std::string> write_outputs(const Results& results,
                                                       const std::filesystem::path& folder);

}  // namespace correlation_navigation
