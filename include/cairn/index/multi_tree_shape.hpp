// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How the trees of a multi-kd-tree grow: their sizes, which of them an insertion pulls into a merge, and
/// when that merge is done.
///
/// A tree of at most n1 points is of level 0, one of more than n1 q^(i-1) and at most n1 q^i of level i.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/detail/kd_layout.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// When trees are merged.
enum class MergeRule {
  /// At most one tree of a level: what would be a second one is poured into it, all smaller ones with it.
  /// Few trees to search; a point moves up to q times within a level.
  one_a_level,
  /// Up to q - 1 trees of a level, the q-th makes one of the next: the binary counter of Bentley and Saxe for
  /// q = 2. A point moves once a level; up to q - 1 times as many trees.
  counter,
};

/// Who does the work of a merge. The index answers the same in `spread` and `background`, whatever the
/// timing: a merge of trees up to level i is replaced by its result once half as many points as a tree of
/// level i - 1 may hold were inserted or erased since, no sooner and no later. Until then the trees merged
/// are searched.
enum class Merging {
  at_once,     ///< the insertion that starts it: fewest trees, but now and then an insertion takes long
  spread,      ///< every insertion and erasure until it is due does its share
  background,  ///< a thread; an insertion waits only if the merge is due and not done
};

/// Sizes of the trees: the first level holds up to first_size (n1) points, each further one `growth` (q)
/// times more.
struct MultiTreeShape {
  std::size_t first_size = 4096;
  std::size_t growth = 2;
  MergeRule rule = MergeRule::one_a_level;
  Merging merging = Merging::at_once;

  /// Largest size of a tree of this level; the largest number for levels that nothing can overflow.
  [[nodiscard]] std::size_t capacity(std::size_t level) const noexcept {
    std::size_t capacity = first_size;
    for (; level > 0; --level) {
      if (capacity > std::numeric_limits<std::size_t>::max() / growth)
        return std::numeric_limits<std::size_t>::max();
      capacity *= growth;
    }
    return capacity;
  }

  /// Level of a tree of so many points.
  [[nodiscard]] std::size_t level_of(std::size_t points) const noexcept {
    std::size_t level = 0;
    while (capacity(level) < points) ++level;
    return level;
  }
};

namespace detail {

inline void check_shape(const MultiTreeShape& shape) {
  CAIRN_EXPECTS(shape.first_size >= 1, "MultiTreeShape: the first tree must have room for a point");
  CAIRN_EXPECTS(shape.growth >= 2, "MultiTreeShape: trees must grow by a factor of at least 2");
}

/// Which of the trees, whose sizes are given smallest first, so many new points pull into a merge.
[[nodiscard]] inline Range pulled_in(const MultiTreeShape& shape, const std::vector<std::size_t>& sizes,
                                     std::size_t incoming) {
  const auto first_of = [&](std::size_t level) {
    std::size_t i = 0;
    while (i < sizes.size() && shape.level_of(sizes[i]) < level) ++i;
    return i;
  };
  const bool counter = shape.rule == MergeRule::counter;
  std::size_t level = shape.level_of(incoming);
  const std::size_t begin = counter ? first_of(level) : 0;
  Range pulled{begin, begin};
  for (std::size_t total = incoming;; level = shape.level_of(total)) {
    const std::size_t end = first_of(level + 1);
    const std::size_t needed = counter && level > 0 ? shape.growth - 1 : 1;
    if (end < pulled.end + needed) return pulled;
    for (; pulled.end < end; ++pulled.end) total += sizes[pulled.end];
  }
}

/// Points that are inserted or erased between the start of a merge into so many points and its end. A tree of
/// the merge's level cannot be full again before.
[[nodiscard]] inline std::size_t updates_of_merge(const MultiTreeShape& shape, std::size_t points) {
  const std::size_t level = shape.level_of(points);
  return level == 0 ? 1 : std::max<std::size_t>(1, shape.capacity(level - 1) / 2);
}

}  // namespace detail

}}  // namespace cairn::CAIRN_ABI
