// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Building the parts of a kd-tree: all at once, over several threads, or a piece at a time.
///
/// The tree is the same whichever way it is made: a split depends on the points of its range and their order,
/// and ranges of one depth share no points. A piece is a whole subtree of a few thousand points, split down
/// and written to its leaves while it is in the cache; above, one split (of at most all points, once).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/parallel.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/index/detail/box_tree.hpp>
#include <cairn/index/detail/kd_layout.hpp>
#include <cairn/index/detail/kd_split.hpp>
#include <cairn/index/detail/leaf_blocks.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// What a tree consists of. boxes are empty above few_axes dimensions.
template <class Scalar>
struct KdParts {
  ResetOnMove<KdLayout> layout;
  LeafBlocks<Scalar> blocks;
  std::vector<Split<Scalar>> splits;
  BoxTree<Scalar> boxes;
};

/// Points are given first, by add() or take(); then advance() until done(), or finish().
template <class Scalar, std::size_t Dim>
class KdBuilder {
public:
  using Points = PointsToSplit<Scalar, Dim>;

  explicit KdBuilder(std::size_t dim) : dim_(dim), points_(dim), scratch_(dim) {}

  void reserve(std::size_t count) { points_.reserve(count); }
  void add(PointId id, const Scalar* row) { points_.add(id, row); }
  void take(std::vector<Scalar> rows, std::span<const PointId> ids, unsigned threads) {
    points_.take(std::move(rows), ids, threads);
  }

  /// One piece of the work, as many points moved or written as is returned; 0 when nothing is left.
  std::uint64_t advance() {
    if (stage_ == Stage::gathering) start();
    if (stage_ == Stage::splitting) return split_next();
    if (stage_ == Stage::boxing) return box_next();
    return 0;
  }
  /// The sum of what advance() will return for so many points, to within a few per cent.
  [[nodiscard]] static std::uint64_t work(std::size_t points) noexcept {
    return std::uint64_t{points} * (KdLayout(points).depth() + 2);
  }

  /// Does what is left and hands over the tree.
  [[nodiscard]] KdParts<Scalar> finish(unsigned threads = 1) {
    if (threads > 1 && stage_ == Stage::gathering) split_over_threads(threads);
    while (advance() > 0) {
    }
    return std::move(parts_);
  }

private:
  enum class Stage { gathering, splitting, boxing, done };
  struct Slot {
    unsigned depth;
    std::size_t slot;
  };
  static constexpr std::size_t leaves_in_piece = 256;
  static constexpr std::size_t nodes_in_piece = 256;

  void start() {
    KdLayout& layout = parts_.layout;
    layout = KdLayout(points_.size());
    parts_.splits.resize(layout.points() == 0 ? 0 : layout.splits());
    parts_.blocks = LeafBlocks<Scalar>(dim_, layout);
    if (dim_ <= few_axes) parts_.boxes = BoxTree<Scalar>(dim_, layout);
    if (layout.points() > 0) todo_.push_back({0, 0});
    todo_.reserve(2 * 64);  // so that nothing can fail between a split and its children
    stage_ = todo_.empty() ? Stage::done : Stage::splitting;
  }

  /// Splits one slot; returns how many points it has. Out of line, as its callers are many and compiling it
  /// takes long.
  [[gnu::noinline]] std::size_t split(const Slot& at, typename Points::Scratch& scratch) {
    const KdLayout& layout = parts_.layout;
    const Range leaves = layout.leaves_below(at.depth, at.slot);
    const std::size_t middle = layout.leaves_below(at.depth + 1, 2 * at.slot).end;
    const std::size_t begin = layout.first_point(leaves.begin);
    const std::size_t end = layout.first_point(leaves.end);
    parts_.splits[KdLayout::split_at(at.depth, at.slot)] =
        points_.split(begin, layout.first_point(middle), end, scratch);
    return end - begin;
  }

  /// Splits a slot down to its leaves.
  [[gnu::noinline]] void split_down(const Slot& at, typename Points::Scratch& scratch) {
    if (parts_.layout->leaves_below(at.depth, at.slot).size() <= 1) return;
    split(at, scratch);
    split_down({at.depth + 1, 2 * at.slot}, scratch);
    split_down({at.depth + 1, 2 * at.slot + 1}, scratch);
  }

  /// Splits a slot down to its leaves and writes them.
  [[gnu::noinline]] void make_leaves(const Slot& at, typename Points::Scratch& scratch) {
    split_down(at, scratch);
    parts_.blocks.fill(points_, parts_.layout, parts_.layout->leaves_below(at.depth, at.slot));
  }

  std::uint64_t split_next() {
    const Slot at = todo_.back();
    todo_.pop_back();
    const KdLayout& layout = parts_.layout;
    const Range leaves = layout.leaves_below(at.depth, at.slot);
    std::uint64_t moved = 0;
    if (leaves.size() <= leaves_in_piece) {
      make_leaves(at, scratch_);
      moved = std::uint64_t{layout.first_point(leaves.end) - layout.first_point(leaves.begin)} *
              (layout.depth() - at.depth + 1);
    } else {
      moved = split(at, scratch_);
      todo_.push_back({at.depth + 1, 2 * at.slot + 1});
      todo_.push_back({at.depth + 1, 2 * at.slot});
    }
    if (todo_.empty()) end_splitting();
    return moved;
  }

  void end_splitting() {
    points_ = Points(dim_);
    stage_ = parts_.boxes.last_nodes() == 0 ? Stage::done : Stage::boxing;
  }

  std::uint64_t box_next() {
    const std::size_t end = std::min(boxed_ + nodes_in_piece, parts_.boxes.last_nodes());
    parts_.boxes.fill_last(parts_.blocks, {boxed_, end});
    const std::size_t points = share(parts_.layout->points(), end - boxed_, parts_.boxes.last_nodes());
    boxed_ = end;
    if (boxed_ == parts_.boxes.last_nodes()) {
      parts_.boxes.fill_above();
      stage_ = Stage::done;
    }
    return points;
  }

  /// Depth by depth while there are fewer slots than threads, then the subtrees side by side.
  void split_over_threads(unsigned threads) {
    start();
    if (todo_.empty()) return;
    std::vector<Slot> slots = std::exchange(todo_, {});
    while (slots.size() < threads && parts_.layout->leaves() >= 4 * slots.size()) {
      parallel_for(slots.size(), threads, [&](std::size_t begin, std::size_t end) {
        typename Points::Scratch scratch(dim_);
        for (std::size_t i = begin; i < end; ++i) split(slots[i], scratch);
      });
      std::vector<Slot> below;
      for (const Slot& at : slots)
        for (const std::size_t side : {std::size_t{0}, std::size_t{1}})
          below.push_back({at.depth + 1, 2 * at.slot + side});
      slots = std::move(below);
    }
    parallel_for(slots.size(), threads, [&](std::size_t begin, std::size_t end) {
      typename Points::Scratch scratch(dim_);
      for (std::size_t i = begin; i < end; ++i) make_leaves(slots[i], scratch);
    });
    end_splitting();
    if (stage_ == Stage::done) return;
    parallel_for(parts_.boxes.last_nodes(), threads, [&](std::size_t begin, std::size_t end) {
      parts_.boxes.fill_last(parts_.blocks, {begin, end});
    });
    parts_.boxes.fill_above();
    stage_ = Stage::done;
  }

  std::size_t dim_;
  Points points_;
  typename Points::Scratch scratch_;
  KdParts<Scalar> parts_;
  std::vector<Slot> todo_;
  std::size_t boxed_ = 0;
  Stage stage_ = Stage::gathering;
};

}}}  // namespace cairn::CAIRN_ABI::detail
