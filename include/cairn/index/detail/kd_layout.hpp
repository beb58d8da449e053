// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The shape of a balanced tree as arithmetic: which points and which leaves stand below which node.
///
/// n points fill L = ceil(n / 16) leaves, leaf j holding the ranks [j n / L, (j + 1) n / L): every leaf has
/// 15 or 16 points (fewer only for tiny n). Slot s of depth d stands for the leaves [s L / 2^d, (s + 1) L /
/// 2^d), its two children are the slots 2 s and 2 s + 1 of depth d + 1, so each split is at the median by
/// rank, to within a leaf, and nothing needs a pointer. All divisions by powers of two are shifts. Products
/// of two numbers of leaves or points are taken in 64 bits: from 2^18 points on 32 are too few for them.
#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>

#include <cairn/core/sizes.hpp>
#include <cairn/index/detail/block_lanes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// A half-open range of points, leaves or slots.
struct Range {
  std::size_t begin;
  std::size_t end;
  [[nodiscard]] std::size_t size() const noexcept { return end - begin; }
};

/// Size: std::size_t, but for tests of machines where that is another type.
template <std::unsigned_integral Size>
class LayoutOf {
public:
  LayoutOf() = default;
  /// Of fewer than 2^32 points.
  constexpr explicit LayoutOf(Size points) noexcept
      : points_(points),
        leaves_(points / static_cast<Size>(block_size) + (points % static_cast<Size>(block_size) != 0)),
        depth_(leaves_ == 0 ? 0 : static_cast<unsigned>(std::bit_width(leaves_ - 1))) {}

  [[nodiscard]] constexpr Size points() const noexcept { return points_; }
  [[nodiscard]] constexpr Size leaves() const noexcept { return leaves_; }
  /// Splits between the root and the deepest leaf: ceil(log2(leaves)).
  [[nodiscard]] constexpr unsigned depth() const noexcept { return depth_; }
  /// Inner nodes with room for every slot above the last depth.
  [[nodiscard]] constexpr Size splits() const noexcept { return (Size{1} << depth_) - 1; }

  /// First leaf below slot `slot` of depth `depth`: the end of the slot before.
  [[nodiscard]] constexpr Size first_leaf(unsigned depth, Size slot) const noexcept {
    return static_cast<Size>((std::uint64_t{slot} * leaves_) >> depth);
  }
  /// Leaves below slot `slot` of depth `depth`; a slot of the last depth may have none.
  [[nodiscard]] constexpr Range leaves_below(unsigned depth, Size slot) const noexcept {
    return {static_cast<std::size_t>(first_leaf(depth, slot)),
            static_cast<std::size_t>(first_leaf(depth, slot + 1))};
  }
  /// Ranks of the first point of leaf `leaf`.
  [[nodiscard]] constexpr Size first_point(Size leaf) const noexcept { return share(points_, leaf, leaves_); }
  /// Number of the split of a slot in arrays of splits: the root first, then depth by depth.
  [[nodiscard]] static constexpr Size split_at(unsigned depth, Size slot) noexcept {
    return (Size{1} << depth) - 1 + slot;
  }

private:
  Size points_ = 0;
  Size leaves_ = 0;
  unsigned depth_ = 0;
};
using KdLayout = LayoutOf<std::size_t>;

}}}  // namespace cairn::CAIRN_ABI::detail
