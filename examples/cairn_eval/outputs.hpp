// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What cairn_eval says and writes.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "evaluate.hpp"

namespace cairn_eval {

struct NamedEvaluation {
  std::string name;
  Evaluation evaluation;
};

/// Words for the command line, one block an estimate.
[[nodiscard]] std::string in_words(const std::vector<NamedEvaluation>& all, const EvaluationOptions& options);

/// Makes the folder, before the work. Throws cairn::Error where nothing can be written there.
void prepare_output_folder(const std::filesystem::path& folder);

/// summary.json, errors.csv (each pair's error) and report.html, in one step. A sentence where there is no
/// report.
std::optional<std::string> write_outputs(const std::filesystem::path& folder,
                                         const std::vector<NamedEvaluation>& all,
                                         const EvaluationOptions& options);

}  // namespace cairn_eval
