// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Many queries of any index, over threads.
///
/// ```cpp
/// const auto hits = cairn::nearest_batch(tree, queries, 10, {.threads = 2});  // ten a query
/// std::vector<cairn::NearestTwo<float>> two(queries.size());
/// cairn::search_batch(index, queries, two, {.budget = {.leaves = 64}, .threads = 2});
/// ```
///
/// Answers are those of one query after the other, bit for bit, for any number of threads. (In many
/// dimensions, exactly, with all queries of a picture at hand: packed_points.hpp.)
#pragma once

#include <algorithm>
#include <cstddef>
#include <mutex>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/sizes.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/index.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

struct BatchOptions {
  Budget budget{};       ///< for each query
  Work* work = nullptr;  ///< what all queries did is added to it
  unsigned threads = 1;  ///< 0 counts as 1
};

/// Searches for each of the queries with the collector of the same number. Returns true where each answer is
/// exact. Throws Error, naming the query, before any search where one is not finite or of another dimension.
template <Index I, QueryPoints Queries, Collector<typename I::Real> C>
bool search_batch(const I& index, const Queries& queries, std::span<C> collectors,
                  const BatchOptions& options = {}) {
  using Real = typename I::Real;
  const auto count = static_cast<std::size_t>(queries.size());
  CAIRN_EXPECTS(collectors.size() == count, "search_batch: there must be one collector a query");
  if (index.empty()) return true;
  const std::size_t dim = index.dimension();
  const std::vector<Real> rows = detail::copy_points<Real>(queries, dim, "search_batch: query");
  std::mutex sums;
  Work work;
  bool exact = true;
  parallel_for(count, options.threads, [&](std::size_t begin, std::size_t end) {
    typename I::Scratch scratch;
    Work done;
    bool all = true;
    for (std::size_t i = begin; i < end; ++i)
      all &= index.search(std::span<const Real>(rows.data() + i * dim, dim), collectors[i],
                          SearchOptions{.budget = options.budget, .work = &done}, scratch);
    const std::lock_guard lock(sums);
    work += done;
    exact &= all;
  });
  if (options.work != nullptr) *options.work += work;
  return exact;
}
template <Index I, QueryPoints Queries, Collector<typename I::Real> C>
bool search_batch(const I& index, const Queries& queries, std::vector<C>& collectors,
                  const BatchOptions& options = {}) {
  return search_batch(index, queries, std::span<C>(collectors), options);
}

/// The k nearest points of each query, nearest first: those of query i from i k on. Where a search found
/// fewer, the rest of its k are no_point, infinitely far. Throws as search_batch().
template <Index I, QueryPoints Queries>
[[nodiscard]] std::vector<typename I::Hit> nearest_batch(const I& index, const Queries& queries,
                                                         std::size_t k, const BatchOptions& options = {}) {
  using Real = typename I::Real;
  const auto count = static_cast<std::size_t>(queries.size());
  std::vector<typename I::Hit> found(detail::room_for(count, k, "nearest_batch"));
  std::vector<KNearest<Real>> collectors;
  collectors.reserve(count);
  for (std::size_t i = 0; i < count; ++i) collectors.emplace_back(found.data() + i * k, k);
  if (k == 0) return found;
  search_batch(index, queries, collectors, options);
  const auto metric = index.metric();
  for (KNearest<Real>& collector : collectors) collector.restore(metric);
  return found;
}

}}  // namespace cairn::CAIRN_ABI
