// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The report of a run: path and errors against the truth, matches and landmarks, the map in space and
/// one frame with its matches.
#pragma once

#include "../support/report.hpp"
#include "run_record.hpp"
#include "summary.hpp"

namespace stereo_slam {

/// The page of a run with at least one frame. Panels that need a truth or a sample frame say so where there
/// is none. Shows no times, so that the same run gives the same bytes.
[[nodiscard]] example::Report run_report(const RunRecord& run, const Summary& summary);

}  // namespace stereo_slam
