// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The ways to keep a growing set that the study compares, behind one interface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <cairn/index/collectors.hpp>
#include <cairn/index/multi_kd_tree.hpp>

namespace cairn_study {

/// What a query found: the nearest point, and the distances of the nearest two.
struct Found {
  cairn::PointId id = cairn::no_point;
  float first = 0;
  float second = 0;
};

class Store {
public:
  Store() = default;
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;
  virtual ~Store() = default;

  /// Takes in new points without making them findable yet: steps that are not timed.
  virtual void stage(std::span<const float> rows) { insert(rows); }
  /// Takes in new points; afterwards all are found.
  virtual void insert(std::span<const float> rows) = 0;
  virtual Found search(const float* query) = 0;

  [[nodiscard]] virtual std::size_t bytes() const = 0;
  /// Points written into trees so far.
  [[nodiscard]] virtual std::uint64_t points_moved() const = 0;
  [[nodiscard]] virtual std::size_t trees() const = 0;
  /// What the searches did so far.
  cairn::Work work;
};

/// Descriptors (more than three numbers) are searched under a budget of leaves, points exactly.
struct StoreOptions {
  std::size_t dim = 3;
  std::size_t leaves = 32;
};

/// One tree, rebuilt whenever points come.
std::unique_ptr<Store> make_single_tree(const StoreOptions& options);
/// The multi-kd-tree.
std::unique_ptr<Store> make_forest(const StoreOptions& options, const cairn::MultiTreeShape& shape);
/// All distances, sixteen at a time, no tree.
std::unique_ptr<Store> make_scan(const StoreOptions& options);

}  // namespace cairn_study
