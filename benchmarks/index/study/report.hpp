// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The study as a page of plots, as JSON and as a table of comma-separated values.
#pragma once

#include <string>
#include <vector>

#include "study/analysis.hpp"
#include "study/recall.hpp"
#include "support/report.hpp"

namespace cairn_study {

/// The page; `subtitle` says on which machine and how it was measured.
example::Report make_report(const std::vector<Study>& studies, const std::vector<RecallStudy>& recalls,
                            const std::string& subtitle);

/// One line for each stream, store and n; a field is empty where there is no number.
std::string to_csv(const std::vector<Study>& studies);

/// Exponents, crossings, counters and checks of every store.
std::string to_json(const std::vector<Study>& studies);

}  // namespace cairn_study
