// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What share of nearest descriptors is found in what time: the cells and every rival that is there, each
/// under budgets from small to large.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "support/report.hpp"

namespace cairn_study {

/// What one budget buys.
struct RecallPoint {
  int budget;
  double recall;   ///< share of queries whose nearest descriptor was found
  double seconds;  ///< a query
};

struct RecallCurve {
  std::string name;
  double build_seconds = 0;           ///< of processor time
  std::optional<double> megabytes{};  ///< beside the rows, where it is known
  std::vector<RecallPoint> points{};
};

struct RecallStudy {
  std::string name;   ///< for files: "sift_128"
  std::string title;  ///< for readers
  std::size_t count = 0;
  std::size_t dim = 0;
  std::size_t queries = 0;
  std::vector<RecallCurve> curves{};
};

/// Seconds a query until a share of the nearest is found, between two budgets as a straight line in
/// logarithms of both time and what is missed; nothing where no budget reaches it, or the smallest is already
/// beyond.
[[nodiscard]] std::optional<double> seconds_at(const RecallCurve& curve, double recall);

/// SIFT descriptors, where they are at hand, and made-up features of 256 numbers.
[[nodiscard]] std::vector<RecallStudy> recall_studies();

void add_recall(example::Report& report, const RecallStudy& study);

/// One line for each budget.
[[nodiscard]] std::string recall_csv(const std::vector<RecallStudy>& studies);

}  // namespace cairn_study
