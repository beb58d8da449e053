// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Search with a bounded amount of work: leaves in the order of their cells' distance from the query, until a
/// budget of leaves is spent (Beis and Lowe, "Shape indexing using approximate nearest-neighbour search in
/// high-dimensional spaces", CVPR 1997).
///
/// Several trees share one queue, one budget and one collector, so p trees do not cost p searches. With
/// enough budget the answer is exact: a queued cell's bound is its true distance, kept up to date as in Arya
/// and Mount by looking up how far the cell already was along the split's axis.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/cell_queue.hpp>
#include <cairn/index/detail/kd_layout.hpp>
#include <cairn/index/detail/tree_access.hpp>
#include <cairn/index/metric.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Best-bin-first search over trees of one kind. Holds the queue, so keep one for many searches; one a
/// thread.
template <class Tree>
class BestBinFirst {
public:
  using Real = typename Tree::Real;

  /// Offers points of all `trees` (null ones are skipped) to the collector, until nothing nearer can be left
  /// or the budget is spent. `query` holds dimension() finite numbers. Returns true where the answer is
  /// exact.
  template <Collector<Real> C>
  bool search(std::span<const Tree* const> trees, const Real* query, C& collector, Budget budget = {},
              Work* work = nullptr) {
    detail::check_collector<C, typename Tree::Measure>();
    query = wrapped(trees, query);
    return search_each(trees, [query](std::size_t) { return query; }, collector, budget, work);
  }

  /// The same where each tree holds the points in coordinates of its own: queries[i] is the query in those of
  /// trees[i]. Distances must mean the same in all of them. Not for axes that are circles.
  template <Collector<Real> C>
    requires(!detail::HasPeriods<typename Tree::Measure>)
  bool search(std::span<const Tree* const> trees, std::span<const Real* const> queries, C& collector,
              Budget budget = {}, Work* work = nullptr) {
    detail::check_collector<C, typename Tree::Measure>();
    CAIRN_EXPECTS(queries.size() == trees.size(), "BestBinFirst: there must be one query a tree");
    return search_each(trees, [queries](std::size_t i) { return queries[i]; }, collector, budget, work);
  }

  /// The same for one tree and any kind of query point, which is checked.
  template <Point Query, Collector<Real> C>
  bool search(const Tree& tree, const Query& query, C& collector, Budget budget = {}, Work* work = nullptr) {
    if (tree.empty()) return true;
    row_.resize(tree.dimension());
    detail::copy_point<Real>(query, row_.size(), row_.data(), {"BestBinFirst: query", 0});
    const Tree* const trees[] = {&tree};
    return search(std::span<const Tree* const>(trees), row_.data(), collector, budget, work);
  }

private:
  static constexpr std::uint32_t no_turn = 0xffffffffU;

  template <class QueryOf, class C>
  bool search_each(std::span<const Tree* const> trees, const QueryOf& query_of, C& collector, Budget budget,
                   Work* work) {
    queue_.open(budget.leaves);
    turns_.clear();
    Work done;
    for (std::size_t i = 0; i < trees.size(); ++i)
      if (trees[i] != nullptr && !trees[i]->empty() && queue_.takes(0))
        queue_.push({0, static_cast<std::uint32_t>(i), 1, no_turn});
    Leaf waiting;  // scanned only after the next one has been asked for, so that memory is not waited for
    while (!queue_.done()) {
      const Cell cell = queue_.pop();
      if (!(cell.bound < static_cast<Real>(collector.limit()))) break;
      const Real* const query = query_of(cell.tree);
      const Leaf next{trees[cell.tree], query, descend(*trees[cell.tree], cell, query, collector, done)};
      prefetch(next);
      if (waiting.tree != nullptr) scan(waiting, collector, done);
      waiting = next;
    }
    if (waiting.tree != nullptr) scan(waiting, collector, done);
    if (work != nullptr) *work += done;
    return !(queue_.left_out() < static_cast<Real>(collector.limit()));
  }

  /// A subtree not yet visited: its lower bound (reduced), its root, and the last turn away from the query
  /// above that. Slot s of depth d is node 2^d + s, so that the children of node k are 2 k and 2 k + 1.
  struct Cell {
    Real bound;
    std::uint32_t tree;
    std::uint32_t node;
    std::uint32_t turn;
  };
  struct Leaf {
    const Tree* tree = nullptr;
    const Real* query = nullptr;
    std::size_t leaf = 0;
  };
  static void prefetch(const Leaf& leaf) noexcept {
    detail::TreeAccess::blocks(*leaf.tree).prefetch(leaf.leaf, leaf.tree->dimension());
  }
  template <class C>
  static void scan(const Leaf& leaf, C& collector, Work& work) {
    detail::TreeAccess::scan_leaf(*leaf.tree, leaf.leaf, leaf.query, collector, work);
  }
  /// The path to a cell left the query's side of a split here; `offset` is how far that side is.
  struct Turn {
    Real offset;
    std::uint32_t axis;
    std::uint32_t before;
  };

  /// From a cell down to the leaf on the query's side of every split, whose number is returned; the other
  /// sides are queued.
  template <class C>
  std::size_t descend(const Tree& tree, Cell cell, const Real* query, const C& collector, Work& work) {
    for (unsigned depth = static_cast<unsigned>(std::bit_width(cell.node)) - 1;; ++depth) {
      const std::uint32_t slot = cell.node - (1U << depth);
      const detail::Range leaves = detail::TreeAccess::layout(tree).leaves_below(depth, slot);
      if (leaves.size() == 1) return leaves.begin;
      ++work.nodes;
      const auto& split = detail::TreeAccess::split(tree, depth, slot);
      const Real offset = query[split.axis] - static_cast<Real>(split.value);
      const std::uint32_t near = 2 * cell.node + (offset < 0 ? 0U : 1U);
      const Real old = offset_along(split.axis, cell.turn);
      const Real across =
          detail::offset_across(tree.metric(), query[split.axis], static_cast<Real>(split.value), split.axis);
      const Real bound = detail::moved_bound(tree.metric(), cell.bound, old, across, split.axis);
      if (bound < static_cast<Real>(collector.limit()) && queue_.takes(bound)) {
        turns_.push_back({across, split.axis, cell.turn});
        queue_.push({bound, cell.tree, near ^ 1U, static_cast<std::uint32_t>(turns_.size() - 1)});
      }
      cell.node = near;
    }
  }

  /// The query with coordinates on circles as the trees hold them.
  const Real* wrapped(std::span<const Tree* const> trees, const Real* query) {
    if constexpr (detail::HasPeriods<typename Tree::Measure>) {
      const auto tree =
          std::find_if(trees.begin(), trees.end(), [](const Tree* t) { return t != nullptr && !t->empty(); });
      if (tree == trees.end()) return query;
      wrapped_.assign(query, query + (*tree)->dimension());
      detail::wrap_row((*tree)->metric(), wrapped_.size(), wrapped_.data());
      return wrapped_.data();
    } else {
      return query;
    }
  }

  /// How far the current cell is from the query along an axis: the last turn on that axis, 0 without one.
  [[nodiscard]] Real offset_along(std::uint32_t axis, std::uint32_t turn) const noexcept {
    for (; turn != no_turn; turn = turns_[turn].before)
      if (turns_[turn].axis == axis) return turns_[turn].offset;
    return 0;
  }

  detail::CellQueue<Cell> queue_;
  std::vector<Turn> turns_;
  std::vector<Real> row_;
  std::vector<Real> wrapped_;
};

}}  // namespace cairn::CAIRN_ABI
