// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The answers that every index gives, from its search: the nearest, the k nearest, all within a radius.
/// `search(collector)` is the search of one query.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/metric.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

template <class Real, class M, class Search>
[[nodiscard]] std::optional<Neighbor<Real>> nearest_of(const M& metric, const Search& search) {
  Nearest<Real> collector;
  search(collector);
  if (collector.id() == no_point) return std::nullopt;
  return Neighbor<Real>{collector.id(), metric.restore(collector.reduced())};
}

/// Writes as many as `found` has room for, nearest first; returns how many.
template <class Real, class M, class Search>
std::size_t nearest_into(std::span<Neighbor<Real>> found, const M& metric, const Search& search) {
  if (found.empty()) return 0;
  KNearest<Real> collector(found.data(), found.size());
  search(collector);
  collector.restore(metric);
  return collector.size();
}

/// The k nearest of `size` points.
template <class Real, class M, class Search>
[[nodiscard]] std::vector<Neighbor<Real>> k_nearest_of(std::size_t k, std::size_t size, const M& metric,
                                                       const Search& search) {
  std::vector<Neighbor<Real>> found(std::min(k, size));
  found.resize(nearest_into(std::span<Neighbor<Real>>(found), metric, search));
  return found;
}

/// Nearest first. Throws Error for a radius that is negative or NaN.
template <class Real, class M, class Search>
[[nodiscard]] std::vector<Neighbor<Real>> all_within(Real radius, const M& metric, const Search& search) {
  if (!(radius >= 0)) [[unlikely]]
    raise("within: a radius is at least 0, found " + std::to_string(radius));
  std::vector<Neighbor<Real>> found;
  Within<Real> collector(found, largest_reduced(metric, radius));
  search(collector);
  for (Neighbor<Real>& hit : found) hit.distance = metric.restore(hit.distance);
  std::sort(found.begin(), found.end(), nearer<Real>);
  return found;
}

}}}  // namespace cairn::CAIRN_ABI::detail
