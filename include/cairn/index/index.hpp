// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What every index of points can do, so that a program takes any of them and the next one is tried by
/// changing a type: BruteForce, KdTree, MultiKdTree, KdForest, DescriptorIndex.
///
/// ```cpp
/// template <cairn::Index I>
/// std::size_t seen_before(const I& index, const Scan& scan) {
///   std::size_t seen = 0;
///   typename I::Scratch scratch;  // one a thread, kept for many searches
///   for (const auto& point : scan) {
///     cairn::Nearest<typename I::Real> nearest;
///     index.search(point, nearest, {.budget = {.leaves = 64}}, scratch);
///     seen += nearest.id() != cairn::no_point && index.metric().restore(nearest.reduced()) < 0.1;
///   }
///   return seen;
/// }
/// ```
///
/// Which of them have boxes, points in order of distance, files, growth: the table of docs/index.md. A batch
/// of queries over threads: batch_search.hpp.
#pragma once

#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <cairn/index/collectors.hpp>
#include <cairn/index/metric.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// A visitor of points that does nothing.
template <class Scalar>
struct PassOver {
  void operator()(PointId, std::span<const Scalar>) const noexcept {}
};

}  // namespace detail

/// Points, found by their distance from a query. `search` returns true where nothing nearer than the
/// collector's limit was left out: always without a budget. `nearest` under a budget, as `search`, answers
/// with what it met. Distances are true ones but for a collector's, which are the metric's reduced ones.
template <class I>
concept Index =
    requires {
      typename I::Real;
      typename I::Hit;
      typename I::Coordinate;
      typename I::Measure;
      typename I::Scratch;
      requires std::same_as<typename I::Hit, Neighbor<typename I::Real>>;
      requires Metric<typename I::Measure, typename I::Real>;
      requires std::default_initializable<typename I::Scratch>;
    } && requires(const I& index, const std::span<const typename I::Real> query,
                  KNearest<typename I::Real>& collector, const SearchOptions& options,
                  typename I::Scratch& scratch, std::size_t k, std::span<typename I::Hit> found,
                  typename I::Real radius, Budget budget, detail::PassOver<typename I::Coordinate> visit) {
      { index.size() } -> std::same_as<std::size_t>;
      { index.empty() } -> std::same_as<bool>;
      { index.dimension() } -> std::same_as<std::size_t>;
      { index.bytes() } -> std::same_as<std::size_t>;
      { index.metric() } -> std::convertible_to<typename I::Measure>;
      { index.search(query, collector) } -> std::same_as<bool>;
      { index.search(query, collector, options) } -> std::same_as<bool>;
      { index.search(query, collector, options, scratch) } -> std::same_as<bool>;
      { index.nearest(query) } -> std::same_as<std::optional<typename I::Hit>>;
      { index.nearest(query, budget) } -> std::same_as<std::optional<typename I::Hit>>;
      { index.nearest(query, k) } -> std::same_as<std::vector<typename I::Hit>>;
      { index.nearest(query, k, budget) } -> std::same_as<std::vector<typename I::Hit>>;
      { index.nearest(query, found) } -> std::same_as<std::size_t>;
      { index.within(query, radius) } -> std::same_as<std::vector<typename I::Hit>>;
      index.for_each(visit);
    };

}}  // namespace cairn::CAIRN_ABI
