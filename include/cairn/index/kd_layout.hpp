// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The shape of a balanced tree as arithmetic: which points and which leaves stand below which node.
///
/// n points fill L = ceil(n / 16) leaves, leaf j holding the ranks [j n / L, (j + 1) n / L): every leaf has
/// 15 or 16 points (fewer only for tiny n). Slot s of depth d stands for the leaves [s L / 2^d, (s + 1) L /
/// 2^d), its two children are the slots 2 s and 2 s + 1 of depth d + 1, so each split is at the median by
/// rank, to within a leaf, and nothing needs a pointer. All divisions by powers of two are shifts.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include <cairn/index/block_lanes.hpp>

namespace cairn::inline CAIRN_ABI::detail {

/// A half-open range of points, leaves or slots.
struct Range {
  std::size_t begin;
  std::size_t end;
  [[nodiscard]] std::size_t size() const noexcept { return end - begin; }
};

class KdLayout {
public:
  KdLayout() = default;
  explicit KdLayout(std::size_t points) noexcept
      : points_(points),
        leaves_((points + block_size - 1) / block_size),
        depth_(leaves_ == 0 ? 0 : static_cast<unsigned>(std::bit_width(leaves_ - 1))) {}

  [[nodiscard]] std::size_t points() const noexcept { return points_; }
  [[nodiscard]] std::size_t leaves() const noexcept { return leaves_; }
  /// Splits between the root and the deepest leaf: ceil(log2(leaves)).
  [[nodiscard]] unsigned depth() const noexcept { return depth_; }
  /// Inner nodes with room for every slot above the last depth.
  [[nodiscard]] std::size_t splits() const noexcept { return (std::size_t{1} << depth_) - 1; }

  /// Leaves below slot `slot` of depth `depth`; a slot of the last depth may have none.
  [[nodiscard]] Range leaves_below(unsigned depth, std::size_t slot) const noexcept {
    return {(slot * leaves_) >> depth, ((slot + 1) * leaves_) >> depth};
  }
  /// Ranks of the first point of leaf `leaf`.
  [[nodiscard]] std::size_t first_point(std::size_t leaf) const noexcept { return leaf * points_ / leaves_; }
  /// Number of the split of a slot in arrays of splits: the root first, then depth by depth.
  [[nodiscard]] static std::size_t split_at(unsigned depth, std::size_t slot) noexcept {
    return (std::size_t{1} << depth) - 1 + slot;
  }

private:
  std::size_t points_ = 0;
  std::size_t leaves_ = 0;
  unsigned depth_ = 0;
};

}  // namespace cairn::inline CAIRN_ABI::detail
