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

/// The walks of up to eight trees.
template <class Tree>
class WalksInStep {
public:
  using Real = typename Tree::Real;
  static constexpr std::size_t most = 8;

  /// `trees` are up to `most`, none empty, smallest first.
  explicit WalksInStep(std::span<const Tree* const> trees) noexcept : trees_(trees) {}

  template <class M, class C>
  [[gnu::always_inline]] void search(const Real* query, std::size_t dim, const M& metric, C& collector,
                                     Work& work) {
    unsigned deepest = 0;
    for (const Tree* tree : trees_) deepest = std::max(deepest, TreeAccess::boxes(*tree).levels());
    // Round by round one move of each tree, then each to its end. One call of advance() for both: it is
    // inlined, for every width of vectors and every collector.
    for (unsigned round = 0; round <= deepest + 1; ++round)
      for (std::size_t i = trees_.size(); i-- > 0;) {
        const auto& boxes = TreeAccess::boxes(*trees_[i]);
        const auto& blocks = TreeAccess::blocks(*trees_[i]);
        const unsigned levels = boxes.levels();
        if (round + levels < deepest) continue;
        if (round + levels == deepest) {
          boxes.enter(walks_[i]);
          if (levels == 0) continue;  // a leaf comes after the larger trees' first
        }
        while (boxes.advance(walks_[i], blocks, query, dim, metric, collector, work))
          if (round <= deepest) break;
        if (round < deepest && trees_.size() > 1) boxes.prefetch(walks_[i], blocks, dim);
      }
  }

private:
  std::span<const Tree* const> trees_;
  std::array<typename BoxTree<typename Tree::Coordinate>::Walk, most> walks_;
};

/// Offers the points of all trees, which are smallest first, to a collector. `query` holds checked numbers.
template <class Tree, class C>
void search_in_step(std::span<const Tree* const> trees, const typename Tree::Real* query, C& collector,
                    Work& work) {
  with_widest_lanes([&]() CAIRN_INLINED {
    for (auto rest = trees; !rest.empty();) {
      const std::size_t count = std::min(rest.size(), WalksInStep<Tree>::most);
      const Tree& any = *rest.back();
      WalksInStep<Tree> walks(rest.last(count));
      walks.search(query, any.dimension(), any.metric(), collector, work);
      rest = rest.first(rest.size() - count);
    }
  });
}

}}}  // namespace cairn::CAIRN_ABI::detail
