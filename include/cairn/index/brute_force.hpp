// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The reference answer: every distance, one after the other. Every other index answers like this one.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/collectors.hpp>
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
  static_assert(detail::is_coordinate<Scalar>,
                "coordinates are kept as float, double or whole numbers of up to four bytes");

  BruteForce() = default;

  /// Throws Error, naming the point, for a coordinate that is not finite or cannot be kept.
  template <PointSet Points>
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

  /// The nearest point; the first of equally near ones.
  template <Point Query>
  [[nodiscard]] std::optional<Hit> nearest(const Query& query) const {
    const std::vector<Hit> found = nearest(query, 1);
    if (found.empty()) return std::nullopt;
    return found.front();
  }

  /// The k nearest points, nearest first.
  template <Point Query>
  [[nodiscard]] std::vector<Hit> nearest(const Query& query, std::size_t k) const {
    std::vector<Hit> found(std::min(k, size()));
    KNearest<Real> collector(found.data(), found.size());
    if (!found.empty()) search(query, collector);
    collector.restore(metric_);
    return found;
  }

  /// All points at most `radius` away, nearest first. radius >= 0.
  template <Point Query>
  [[nodiscard]] std::vector<Hit> within(const Query& query, Real radius) const {
    CAIRN_EXPECTS(radius >= 0, "BruteForce::within: a radius is not negative");
    std::vector<Hit> found;
    Within<Real> collector(found, detail::largest_reduced(metric_, radius));
    search(query, collector);
    for (Hit& hit : found) hit.distance = metric_.restore(hit.distance);
    std::sort(found.begin(), found.end(), nearer<Real>);
    return found;
  }

  /// Offers every point that is nearer than the collector's limit, in the order of the set.
  template <Point Query, Collector<Real> C>
  void search(const Query& query, C& collector, Work* work = nullptr) const {
    detail::check_collector<C, M>();
    if (empty()) return;
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
  }

private:
  [[no_unique_address]] M metric_{};
  std::size_t dim_ = 0;
  std::vector<Scalar> rows_;
};

template <PointSet Points, class M = L2>
BruteForce(const Points&, M = {}) -> BruteForce<detail::CoordinateOf<Points>, dynamic_dim, M>;

}}  // namespace cairn::CAIRN_ABI
