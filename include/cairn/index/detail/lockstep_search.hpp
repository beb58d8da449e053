// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Exact search of few dimensions through several trees in step.
///
/// A search of one tree waits for memory at every level, since where it goes next depends on what it just
/// read. Going down all trees together, a level at a time, lets those waits overlap. All trees reach
/// their first leaves in the same round, where the largest comes first and sets a bound for the others.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include <cairn/index/kd_tree.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

template <class Tree>
using WalkOf = typename BoxTree<typename Tree::Coordinate>::Walk;

/// Offers the points of some trees, none empty, smallest first. There is a walk for each. They are somebody
/// else's array: in one of its own gcc 12 computes the place of every number from that of the tree.
template <class Tree, class C>
[[gnu::always_inline]] inline void walk_in_step(WalkOf<Tree>* walks, std::span<const Tree* const> trees,
                                                const typename Tree::Real* query, C& collector, Work& work) {
  const Tree& any = *trees.back();
  Work done;  // at hand, where `work` is behind a pointer
  unsigned deepest = 0;
  for (std::size_t i = 0; i < trees.size(); ++i) {
    const auto& boxes = TreeAccess::boxes(*trees[i]);
    boxes.enter(walks[i]);
    deepest = std::max(deepest, boxes.levels());
  }
  // Round by round one move of each tree, then each to its end: a tree that is alone at once. One call of
  // advance() for both: it is inlined, for every width of vectors and every collector.
  std::size_t first = trees.size();  // of the trees that have begun
  for (unsigned round = trees.size() == 1 ? deepest + 1 : 0; round <= deepest + 1; ++round) {
    for (; first > 0; --first) {
      const unsigned levels = TreeAccess::boxes(*trees[first - 1]).levels();
      const unsigned begin =
          levels == 0 ? deepest + 1 : deepest - levels;  // a leaf after the first of others
      if (round < begin) break;
    }
    for (std::size_t i = trees.size(); i-- > first;) {
      const auto& boxes = TreeAccess::boxes(*trees[i]);
      const auto& blocks = TreeAccess::blocks(*trees[i]);
      while (boxes.advance(walks[i], blocks, query, any.dimension(), any.metric(), collector, done))
        if (round <= deepest) break;
      if (round < deepest) boxes.prefetch(walks[i], blocks, any.dimension());
    }
  }
  work += done;
}

/// Offers the points of all trees, which are smallest first, to a collector. `query` holds checked numbers.
template <class Tree, class C>
void search_in_step(std::span<const Tree* const> trees, const typename Tree::Real* query, C& collector,
                    Work& work) {
  std::array<WalkOf<Tree>, 8> walks;
  with_widest_lanes([&]() CAIRN_INLINED {
    for (auto rest = trees; !rest.empty();) {
      const std::size_t count = std::min(rest.size(), walks.size());
      walk_in_step(walks.data(), rest.last(count), query, collector, work);
      rest = rest.first(rest.size() - count);
    }
  });
}

}}}  // namespace cairn::CAIRN_ABI::detail
