// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Whether numbers that somebody gave can be the ids of points.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <cairn/index/collectors.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// The place of an id that cannot be one: it is no_point, or was given before. O(n); O(n log n) for ids that
/// are sparse.
[[nodiscard]] inline std::optional<std::size_t> bad_id(std::span<const PointId> ids) {
  PointId largest = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] == no_point) return i;
    largest = std::max(largest, ids[i]);
  }
  if (largest / 64 <= ids.size()) {
    std::vector<std::uint64_t> given(largest / 64 + 1);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const std::uint64_t bit = std::uint64_t{1} << (ids[i] % 64);
      if ((given[ids[i] / 64] & bit) != 0) return i;
      given[ids[i] / 64] |= bit;
    }
    return std::nullopt;
  }
  std::vector<PointId> sorted(ids.begin(), ids.end());
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice == sorted.end()) return std::nullopt;
  const auto first = std::find(ids.begin(), ids.end(), *twice);
  return static_cast<std::size_t>(std::find(first + 1, ids.end(), *twice) - ids.begin());
}

}}}  // namespace cairn::CAIRN_ABI::detail
