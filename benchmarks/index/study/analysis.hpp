// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// From single steps to curves over n, exponents and crossings.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "study/drive.hpp"

namespace cairn_study {

/// A store's costs at the n of a grid. Means are over the steps since n / 2.
struct Curves {
  std::vector<double> build;      ///< mean a step [s]
  std::vector<double> search;     ///< mean a step [s]
  std::vector<double> sum;        ///< mean a step [s]
  std::vector<double> worst;      ///< slowest step so far [s]
  std::vector<double> bytes;      ///< a point
  std::vector<double> moved;      ///< points written into trees for each point inserted, so far
  std::vector<double> distances;  ///< a query
  std::vector<double> trees;
  std::vector<double> total_build;   ///< of all steps so far [s]
  std::vector<double> total_search;  ///< of all steps so far [s]
  std::vector<double> total;         ///< of all steps so far [s]
};

/// Growth of a cost a step: the exponent of its total over n >= 1/32 of the end, less one; the theory's the
/// same way.
struct Growth {
  double measured = 0;
  double theory = 0;
};

struct Result {
  Drive drive;
  Curves curves;
  Growth build;
  Growth search;
  double worst_build = 0;  ///< [s]
  std::optional<double>
      below_single;  ///< n from which on all steps so far together cost less than the single tree's
  std::optional<double> below_scan;  ///< the same against the scan
};

/// All stores over one stream. The first drive is the single tree, the last the scan.
struct Study {
  Stream stream;
  std::vector<double> grid;  ///< n, growing geometrically
  std::vector<Result> results;
  std::size_t best = 1;            ///< of the results: the forest whose steps took least together
  std::vector<double> gains = {};  ///< the single tree's time over the best forest's, of several runs of both
};

/// Of all steps together [s].
double total_time(const Drive& drive);

/// Takes the drives of one stream together.
Study analyse(Stream stream, std::vector<Drive> drives);

}  // namespace cairn_study
