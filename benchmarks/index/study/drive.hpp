// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// One growing set kept in one way: per step m points are inserted and s queries asked, both timed and
/// checked.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "study/store.hpp"

namespace cairn_study {

/// The points in the order in which they come, and how they are asked for.
struct Stream {
  std::string name = {};   ///< for files: "clusters_64"
  std::string title = {};  ///< for readers
  std::size_t dim = 0;
  std::vector<float> rows = {};
  std::size_t step = 0;       ///< m: points inserted a step
  std::size_t queries = 0;    ///< s: queries a step
  std::size_t timed = 0;      ///< queries of a step that are asked; times count s / timed fold
  float noise = 0;            ///< half of the queries are points already there, moved by so much a coordinate
  std::size_t leaves = 32;    ///< budget of a query, above three numbers
  std::size_t held_back = 0;  ///< points at the end that are never inserted: the other half of the queries

  [[nodiscard]] std::size_t points() const noexcept { return rows.size() / dim - held_back; }
  [[nodiscard]] std::size_t steps() const noexcept { return points() / step; }
  /// Query i of a step in which `present` points are there.
  void make_query(std::size_t step_number, std::size_t i, std::size_t present, float* query) const;
};

/// A step that was timed.
struct Sample {
  double points = 0;     ///< n after the insertion
  double steps = 1;      ///< it stands for: itself and those before it that were not timed
  double build = 0;      ///< CPU seconds of the insertion
  double search = 0;     ///< CPU seconds of all s queries
  double bytes = 0;      ///< held, the points included
  double moved = 0;      ///< points written into trees in this step
  double distances = 0;  ///< distances computed a query
  double trees = 0;
};

/// Exact answers at some steps, by a plain scan in double.
struct Truth {
  struct Query {
    std::size_t step;
    std::size_t number;
    double first;
    double second;
  };
  std::vector<Query> queries;
};
Truth make_truth(const Stream& stream);

struct Drive {
  std::string name = {};        ///< "q = 4, z = 10"
  std::size_t growth = 0;       ///< q; 0 where there is no forest
  std::size_t first_steps = 0;  ///< z
  std::vector<Sample> samples;
  std::size_t checked = 0;  ///< answers compared with the truth
  std::size_t wrong = 0;  ///< that are no distance to the point named, or not the nearest where they must be
  double matches = 0;     ///< of the exact search under the ratio test (0.8)
  double kept = 0;        ///< of them, found
};

struct RunOptions {
  double gap = 0;         ///< steps after a timed one are timed again when n has grown by this share
  std::size_t timed = 1;  ///< queries of a step that are asked
  bool exact = false;     ///< every answer must be the nearest
};

/// Runs a stream through a store. `progress` is called after every step.
Drive run(const Stream& stream, const Truth& truth, Store& store, const RunOptions& options,
          const std::function<void()>& progress);

}  // namespace cairn_study
