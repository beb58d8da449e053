// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The upper part of a tree of few dimensions for exact search: nodes of up to sixteen children, each with
/// the bounding box of its points, so that four levels of splits cost one pass of vector code.
///
/// The levels of the binary tree are taken four at a time from the leaves up; the root takes what remains.
/// Node j of level w has its children at f j, ..., f j + f - 1 of the level below (f: fan-out of the level),
/// so there are no pointers. A search keeps, for every level on its path, the sixteen lower bounds of the
/// children, each with the child's number in its last four bits, and always descends to the nearest that is
/// not yet visited: the smallest key above the last one.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include <cairn/index/detail/leaf_blocks.hpp>
#include <cairn/index/metric.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

template <class Scalar>
class BoxTree {
public:
  using Real = RealOf<Scalar>;
  using Bits = BitsOf<Real>;
  static constexpr unsigned max_levels = 8;  // 16^8 leaves of 16 points are more than 2^32

  BoxTree() = default;

  /// Room for the boxes of a layout, not yet written.
  BoxTree(std::size_t dim, const KdLayout& layout) : layout_(layout), dim_(dim) {
    levels_ = (layout.depth() + 3) / 4;
    std::size_t nodes = 0;
    for (unsigned level = 0; level < levels_; ++level) {
      first_node_[level] = nodes;
      nodes += nodes_at(level);
    }
    boxes_.resize(nodes * node_size());
  }

  /// Nodes of the last level, whose children are leaves; 0 where one leaf is all.
  [[nodiscard]] std::size_t last_nodes() const noexcept { return levels_ == 0 ? 0 : nodes_at(levels_ - 1); }
  /// Writes some nodes of the last level, once all leaves are written.
  void fill_last(const LeafBlocks<Scalar>& blocks, const Range& nodes) {
    for (std::size_t node = nodes.begin; node < nodes.end; ++node) fill_last(blocks, node);
  }
  /// Writes the nodes above, once all of the last level are written.
  void fill_above() {
    for (unsigned level = levels_ == 0 ? 0 : levels_ - 1; level-- > 0;)
      for (std::size_t node = 0; node < nodes_at(level); ++node) fill_inner(level, node);
  }

  [[nodiscard]] std::size_t bytes() const noexcept { return boxes_.capacity() * sizeof(Real); }

  /// How far a search has come: the children at every level of its path, as keys, the key that was visited
  /// last, and the nearest of the last level, whose memory has been asked for. Level w of the nodes is w + 1
  /// here: above the root stands a node whose only child it is.
  struct Walk {
    Block<Bits> keys[max_levels + 1];
    std::size_t node_of[max_levels + 1];
    Bits last[max_levels + 1];
    unsigned level;
    Bits next;
  };

  /// Levels of nodes above the leaves.
  [[nodiscard]] unsigned levels() const noexcept { return levels_; }

  /// Begins a search, above the root.
  [[gnu::always_inline]] void enter(Walk& walk) const {
    walk.level = 0;
    walk.node_of[0] = 0;
    walk.keys[0] = Block<Bits>{} + none;
    walk.next = layout_.leaves() > 0 ? Bits{0} : none;
  }

  /// Visits the node or leaf that is next, if it may hold something near enough; false where none does. What
  /// comes after it is asked for from memory: a leaf before this one is scanned, a node to be visited later.
  /// `dim` is the tree's, given again so that it may be a constant.
  template <class M, class C>
  [[gnu::always_inline]] bool advance(Walk& walk, const LeafBlocks<Scalar>& blocks, const Real* query,
                                      std::size_t dim, const M& metric, C& collector, Work& work) const {
    for (;;) {
      const bool near_enough = bound_of(walk.next) < static_cast<Real>(collector.limit());
      std::size_t child = 0;
      if (near_enough) {
        child = child_at(walk, walk.next);
        if constexpr (struck_out)
          walk.keys[walk.level][static_cast<std::size_t>(walk.next & 15)] = none;
        else
          walk.last[walk.level] = walk.next;
        if (walk.level < levels_) {
          walk.node_of[++walk.level] = child;
          bound_children(walk.level - 1, child, query, dim, metric, collector, walk.keys[walk.level], work);
          walk.next = smallest<Bits>(walk.keys[walk.level]);
          return true;
        }
      } else {
        if (walk.level <= 1) return false;
        --walk.level;
      }
      walk.next = next_of(walk);  // once for a leaf and for a way back: it is inlined
      if (!near_enough) continue;
      if (bound_of(walk.next) < static_cast<Real>(collector.limit()))
        blocks.prefetch(leaf_of(child_at(walk, walk.next)), dim);
      scan(blocks, leaf_of(child), query, dim, metric, collector, work);
      return true;
    }
  }

  /// Asks for the memory of what is next.
  [[gnu::always_inline]] void prefetch(const Walk& walk, const LeafBlocks<Scalar>& blocks,
                                       std::size_t dim) const noexcept {
    if (walk.next == none) return;
    const std::size_t child = child_at(walk, walk.next);
    if (walk.level >= levels_) return blocks.prefetch(leaf_of(child), dim);
    const auto* bytes = reinterpret_cast<const char*>(boxes_.data() + (first_node_[walk.level] + child) *
                                                                          (2 * dim * block_size));
    for (std::size_t at = 0; at < 2 * dim * block_size * sizeof(Real); at += 64)
      __builtin_prefetch(bytes + at);
  }

  /// Offers all points nearer than the collector's limit, nearest boxes first.
  template <class M, class C>
  [[gnu::always_inline]] void search(const LeafBlocks<Scalar>& blocks, const Real* query, std::size_t dim,
                                     const M& metric, C& collector, Work& work) const {
    Walk walk;
    enter(walk);
    while (advance(walk, blocks, query, dim, metric, collector, work)) {
    }
  }

private:
  static constexpr Bits none = std::numeric_limits<Bits>::max();
  /// Whether a key that was visited becomes `none`. Else keys stay as they were written, since a changed one
  /// holds up the next reading of all sixteen; but gcc 12 compares sixteen keys of eight bytes one by one.
  static constexpr bool struck_out = sizeof(Bits) == 8;

  [[nodiscard]] std::size_t node_size() const noexcept { return 2 * dim_ * block_size; }
  [[nodiscard]] unsigned root_bits() const noexcept { return layout_.depth() - 4 * (levels_ - 1); }
  [[nodiscard]] unsigned fan_bits(unsigned level) const noexcept { return level == 0 ? root_bits() : 4; }
  /// Depth in the binary tree of the nodes of a level.
  [[nodiscard]] unsigned depth_of(unsigned level) const noexcept {
    return level == 0 ? 0 : root_bits() + 4 * (level - 1);
  }
  [[nodiscard]] std::size_t nodes_at(unsigned level) const noexcept {
    return std::size_t{1} << depth_of(level);
  }
  [[nodiscard]] Real* box(unsigned level, std::size_t node) noexcept {
    return boxes_.data() + (first_node_[level] + node) * node_size();
  }
  [[nodiscard]] const Real* box(unsigned level, std::size_t node) const noexcept {
    return boxes_.data() + (first_node_[level] + node) * (2 * dim_ * block_size);
  }

  /// The nearest child, of the node where a search stands, that it has not visited.
  [[gnu::always_inline]] static Bits next_of(const Walk& walk) noexcept {
    const Block<Bits>& keys = walk.keys[walk.level];
    if constexpr (struck_out) return smallest<Bits>(keys);
    const Block<Bits> later = keys > walk.last[walk.level] ? keys : (Block<Bits>{} + none);
    return smallest<Bits>(later);
  }

  /// Number, within its level, of a child of the node where a search stands. The root has number 0, so its
  /// fan-out, which may be less than sixteen, does not matter.
  [[gnu::always_inline]] static std::size_t child_at(const Walk& walk, Bits key) noexcept {
    return (walk.node_of[walk.level] << 4) + static_cast<std::size_t>(key & 15);
  }
  [[nodiscard]] std::size_t leaf_of(std::size_t child) const noexcept {
    return layout_.first_leaf(layout_.depth(), child);
  }

  /// A key's lower bound: its number without the child in the last four bits. NaN stands for `none`.
  [[gnu::always_inline]] static Real bound_of(Bits key) noexcept {
    return std::bit_cast<Real>(key & ~Bits{15});
  }

  template <class M, class C>
  [[gnu::always_inline]] static void scan(const LeafBlocks<Scalar>& blocks, std::size_t leaf,
                                          const Real* query, std::size_t dim, const M& metric, C& collector,
                                          Work& work) {
    ++work.leaves;
    work.distances += block_size;
    blocks.scan(leaf, query, dim, metric, collector);
  }

  /// Lower bounds of the children of a node that may hold something near enough, as keys.
  template <class M, class C>
  [[gnu::always_inline]] void bound_children(unsigned level, std::size_t node, const Real* query,
                                             std::size_t dim, const M& metric, const C& collector,
                                             Block<Bits>& keys, Work& work) const {
    ++work.nodes;
    const Real* low = boxes_.data() + (first_node_[level] + node) * (2 * dim * block_size);
    Block<Real> sums{};
    for (std::size_t a = 0; a < dim; ++a) {
      Block<Real> under;
      Block<Real> over;
      load_block<Real>(low + 2 * a * block_size, under);
      load_block<Real>(low + (2 * a + 1) * block_size, over);
      under = under - query[a];
      over = query[a] - over;
      Block<Real> gap = under < over ? over : under;
      if constexpr (HasPeriods<M>) {  // the other way round to the farther side
        const Block<Real> other_way = static_cast<Real>(metric.period(a)) + (under < over ? under : over);
        gap = other_way < gap ? other_way : gap;
      }
      gap = gap < 0 ? Block<Real>{} : gap;
      accumulate_block<Real>(metric, sums, gap, a);
    }
    const Real limit = static_cast<Real>(collector.limit());
    Block<Bits> bits;
    std::memcpy(&bits, &sums, sizeof(bits));
    const Block<Bits> children = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    keys = sums < limit ? ((bits & ~Bits{15}) | children) : (Block<Bits>{} + none);
  }

  /// The children of the last level's nodes are leaves, or nothing where the last depth has no leaf.
  void fill_last(const LeafBlocks<Scalar>& blocks, std::size_t node) {
    Real* boxes = box(levels_ - 1, node);
    for (std::size_t lane = 0; lane < block_size; ++lane) {
      const std::size_t slot = (node << fan_bits(levels_ - 1)) + lane;
      const bool inside = lane < (std::size_t{1} << fan_bits(levels_ - 1));
      const Range leaves = inside ? layout_.leaves_below(layout_.depth(), slot) : Range{0, 0};
      for (std::size_t a = 0; a < dim_; ++a) {
        Real low = std::numeric_limits<Real>::infinity();
        Real high = -low;
        if (leaves.size() > 0) {
          const Scalar* numbers = blocks.block(leaves.begin) + a * block_size;
          for (std::size_t i = 0; i < block_size; ++i) {
            const auto number = static_cast<Real>(numbers[i]);
            low = number < low ? number : low;
            high = high < number ? number : high;
          }
        }
        boxes[2 * a * block_size + lane] = low;
        boxes[(2 * a + 1) * block_size + lane] = high;
      }
    }
  }

  /// A child's box holds the boxes of its own children.
  void fill_inner(unsigned level, std::size_t node) {
    Real* boxes = box(level, node);
    for (std::size_t lane = 0; lane < block_size; ++lane) {
      const std::size_t child = (node << fan_bits(level)) + lane;
      const bool inside = lane < (std::size_t{1} << fan_bits(level));
      for (std::size_t a = 0; a < dim_; ++a) {
        Real low = std::numeric_limits<Real>::infinity();
        Real high = -low;
        for (std::size_t i = 0; inside && i < block_size; ++i) {
          const Real* inner = box(level + 1, child) + 2 * a * block_size;
          low = inner[i] < low ? inner[i] : low;
          high = high < inner[block_size + i] ? inner[block_size + i] : high;
        }
        boxes[2 * a * block_size + lane] = low;
        boxes[(2 * a + 1) * block_size + lane] = high;
      }
    }
  }

  KdLayout layout_;
  std::size_t dim_ = 0;
  unsigned levels_ = 0;
  std::array<std::size_t, max_levels> first_node_{};
  AlignedVector<Real> boxes_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
