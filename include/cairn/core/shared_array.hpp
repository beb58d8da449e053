// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// An array whose copies share what none of them has changed.
///
///   root -> branches of 16 -> ... -> leaves of 16 elements
/// A trie over the digits of the index to base 16 (P. Bagwell, "Ideal hash trees", EPFL, 2001, for the idea
/// of wide nodes). Copying is O(1), reading and writing O(log_16 n); a write copies the nodes on its way that
/// others hold, at most one a level, and later writes to the same leaf copy nothing. Elements that were never
/// written are T{}. Different arrays may be used from different threads at once also where they share nodes.
#pragma once

#include <array>
#include <cstddef>
#include <initializer_list>
#include <utility>

#include <cairn/core/counted.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

template <class T>
class SharedArray {
public:
  SharedArray() = default;
  SharedArray(std::initializer_list<T> elements) {
    for (const T& element : elements) push_back(element);
  }

  /// One beyond the highest index that was written.
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

  /// The element, or T{} where nothing was written.
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept {
    if (i >= size_) return blank;
    const Branch* at = root_.get();
    for (int level = height_; level > 1; --level) {
      at = at->branches[digit(i, level)].get();
      if (at == nullptr) return blank;
    }
    const Leaf* leaf = at->leaves[digit(i, 1)].get();
    return leaf == nullptr ? blank : (*leaf)[digit(i, 0)];
  }

  /// The element of this array alone; valid until the array is copied or written elsewhere.
  [[nodiscard]] T& write(std::size_t i) {
    while (height_ == 0 || (i >> shift(height_)) >= fan) grow();
    if (i >= size_) size_ = i + 1;
    Branch* at = &own(root_);
    for (int level = height_; level > 1; --level) at = &own(at->branches[digit(i, level)]);
    return own(at->leaves[digit(i, 1)])[digit(i, 0)];
  }

  /// Writes behind the last.
  void push_back(T element) { write(size_) = std::move(element); }

  /// Nodes that writes to this array have copied since it was made or copied from one that had none: what
  /// sharing costs.
  [[nodiscard]] std::size_t node_copies() const noexcept { return copies_; }

private:
  static constexpr std::size_t fan = 16;
  using Leaf = std::array<T, fan>;
  struct Branch {  // of the two arrays the lowest branches use the second, all others the first
    std::array<Counted<Branch>, fan> branches{};
    std::array<Counted<Leaf>, fan> leaves{};
  };

  static constexpr int shift(int level) noexcept { return 4 * level; }
  static constexpr std::size_t digit(std::size_t i, int level) noexcept { return i >> shift(level) & 15U; }

  template <class Node>
  Node& own(Counted<Node>& node) {
    copies_ += node.shared() ? 1 : 0;
    return node.own();
  }

  void grow() {
    Counted<Branch> root;
    if (height_ > 0) root.own().branches[0] = root_;
    root_ = root;
    ++height_;
  }

  static inline const T blank{};
  Counted<Branch> root_;
  ResetOnMove<int> height_;  // levels of branches
  ResetOnMove<std::size_t> size_;
  ResetOnMove<std::size_t> copies_;
};

}}  // namespace cairn::CAIRN_ABI
