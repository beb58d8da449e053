// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The reference answer: every distance, one after the other. Every other index answers like this one.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/answers.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/metric.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The interface of KdTree, in O(n) a query and without a build. Owns a copy of the points.
template <class Scalar = float, std::size_t Dim = dynamic_dim, class M = L2>
class BruteForce {
public:
  using Real = detail::RealOf<Scalar>;
  using Hit = Neighbor<Real>;
  using Coordinate = Scalar;
  using Measure = M;
  struct Scratch {};  ///< a search needs none
  static constexpr std::size_t fixed_dimension = Dim;
  static_assert(detail::is_coordinate<Scalar>,
                "coordinates are kept as float, double or whole numbers of up to four bytes");

  BruteForce() = default;

  /// Throws Error, naming the point, for a coordinate that is not finite or cannot be kept.
  template <class Points>
    requires(PointSet<Points> || detail::explain_points<Points>)
  explicit BruteForce(const Points& points, M metric = {})
      : metric_(std::move(metric)),
        dim_(detail::dimension_of<Dim>(points)),
        rows_(detail::copy_points<Scalar>(points, dim_, "BruteForce: point")) {
    if (rows_.empty()) return;
    detail::check_metric(metric_, dim_);
    if constexpr (detail::HasPeriods<M>) rows_ = detail::wrapped_rows(metric_, dim_, std::move(rows_));
  }

  [[nodiscard]] std::size_t size() const noexcept { return dim_ == 0 ? 0 : rows_.size() / dim_; }
  [[nodiscard]] bool empty() const noexcept { return rows_.empty(); }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  [[nodiscard]] const M& metric() const noexcept { return metric_; }
  /// Memory held, the points included.
  [[nodiscard]] std::size_t bytes() const noexcept { return rows_.capacity() * sizeof(Scalar); }

  /// The nearest point; the first of equally near ones.
  template <QueryPoint Query>
  [[nodiscard]] std::optional<Hit> nearest(const Query& query, Budget = {}) const {
    return detail::nearest_of<Real>(metric_, [&](auto& collector) { search(query, collector); });
  }

  /// The k nearest points, nearest first.
  template <QueryPoint Query>
  [[nodiscard]] std::vector<Hit> nearest(const Query& query, std::size_t k, Budget = {}) const {
    return detail::k_nearest_of<Real>(k, size(), metric_, [&](auto& collector) { search(query, collector); });
  }
  template <QueryPoint Query>
  void nearest(const Query&, std::floating_point auto) const = delete;  ///< a radius? within(query, radius)
  /// Writes the nearest points, nearest first, as many as `found` has room for; returns how many.
  template <QueryPoint Query>
  std::size_t nearest(const Query& query, std::span<Hit> found) const {
    return detail::nearest_into(found, metric_, [&](auto& collector) { search(query, collector); });
  }

  /// All points at most `radius` away, nearest first. Throws Error where that is negative or NaN.
  template <QueryPoint Query>
  [[nodiscard]] std::vector<Hit> within(const Query& query, Real radius) const {
    return detail::all_within(radius, metric_, [&](auto& collector) { search(query, collector); });
  }

  /// Offers every point that is nearer than the collector's limit, in the order of the set. Returns true:
  /// nothing is left out.
  template <QueryPoint Query, Collector<Real> C>
  bool search(const Query& query, C& collector, Work* work = nullptr) const {
    detail::check_collector<C, M>();
    if (empty()) return true;
    std::vector<Real> row(dim_);
    detail::copy_point<Real>(query, dim_, row.data(), {"BruteForce: query", 0});
    detail::wrap_row(metric_, dim_, row.data());
    for (std::size_t i = 0; i < size(); ++i) {
      Real reduced = 0;
      for (std::size_t a = 0; a < dim_; ++a)
        metric_.accumulate(reduced, row[a] - static_cast<Real>(rows_[i * dim_ + a]), a);
      if (reduced < static_cast<Real>(collector.limit())) collector.offer(static_cast<PointId>(i), reduced);
    }
    if (work != nullptr) work->distances += size();
    return true;
  }
  /// The same: here a budget leaves nothing out.
  template <QueryPoint Query, Collector<Real> C>
  bool search(const Query& query, C& collector, const SearchOptions& options) const {
    return search(query, collector, options.work);
  }
  template <QueryPoint Query, Collector<Real> C>
  bool search(const Query& query, C& collector, const SearchOptions& options, Scratch&) const {
    return search(query, collector, options.work);
  }

  /// Calls visit(id, std::span<const Scalar>) for every point, in the order of the set.
  template <class Visit>
  void for_each(Visit&& visit) const {
    for (std::size_t i = 0; i < size(); ++i)
      visit(static_cast<PointId>(i), std::span<const Scalar>(rows_.data() + i * dim_, dim_));
  }

private:
  [[no_unique_address]] M metric_{};
  std::size_t dim_ = 0;
  std::vector<Scalar> rows_;
};

template <PointSet Points, class M = L2>
BruteForce(const Points&, M = {}) -> BruteForce<detail::CoordinateOf<Points>, dynamic_dim, M>;

}}  // namespace cairn::CAIRN_ABI
