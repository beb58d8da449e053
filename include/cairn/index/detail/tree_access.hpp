// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What searches and indices made of trees see of a kd-tree that its users do not.
#pragma once

#include <cstddef>
#include <utility>

#include <cairn/index/detail/kd_layout.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Templates throughout, so that a tree may itself use the searches that use this.
struct TreeAccess {
  /// The shape: which leaves stand below which slot.
  template <class Tree>
  [[nodiscard]] static const KdLayout& layout(const Tree& tree) noexcept {
    return tree.parts_.layout;
  }
  template <class Tree>
  [[nodiscard]] static const auto& split(const Tree& tree, unsigned depth, std::size_t slot) noexcept {
    return tree.parts_.splits[KdLayout::split_at(depth, slot)];
  }
  /// The points, leaf by leaf.
  template <class Tree>
  [[nodiscard]] static const auto& blocks(const Tree& tree) noexcept {
    return tree.parts_.blocks;
  }
  /// Boxes above the leaves; none above few_axes dimensions.
  template <class Tree>
  [[nodiscard]] static const auto& boxes(const Tree& tree) noexcept {
    return tree.parts_.boxes;
  }
  /// Offers a leaf's points to a collector. `query` holds checked numbers.
  template <class Tree, class C, class Work>
  static void scan_leaf(const Tree& tree, std::size_t leaf, const typename Tree::Real* query, C& collector,
                        Work& work) {
    tree.scan_leaf(leaf, query, collector, work);
  }
  /// Exact search. `row` holds checked numbers.
  template <class Tree, class C, class Work>
  static void search_row(const Tree& tree, const typename Tree::Real* row, C& collector, Work& work) {
    if (!tree.empty()) tree.search_row(row, collector, work);
  }
  /// A tree of what a builder made.
  template <class Tree, class Parts>
  [[nodiscard]] static Tree from_parts(Parts parts, std::size_t dim, typename Tree::Measure metric) {
    Tree tree;
    tree.metric_ = std::move(metric);
    tree.dim_ = dim;
    tree.parts_ = std::move(parts);
    return tree;
  }
};

}}}  // namespace cairn::CAIRN_ABI::detail
