// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Paths of particles as a tree: what two particles have in common is stored once, and what no particle has
/// any more is forgotten. O(path + particles) nodes, as ancestors that died out leave no branch.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Nodes with a parent and a count of users: children and holders outside.
template <class Entry>
class PathTree {
public:
  using Node = std::uint32_t;
  static constexpr Node none = ~Node{0};

  /// A new node below `parent`, with one holder.
  Node extend(Node parent, Entry entry) {
    Node node = 0;
    if (free_.empty()) {
      node = static_cast<Node>(nodes_.size());
      nodes_.push_back({std::move(entry), parent, 1});
    } else {
      node = free_.back();
      free_.pop_back();
      nodes_[node] = {std::move(entry), parent, 1};
    }
    hold(parent);
    return node;
  }

  void hold(Node node) {
    if (node != none) ++nodes_[node].users;
  }
  /// Gives one hold back; a node without users goes, and so on upwards.
  void release(Node node) {
    while (node != none && --nodes_[node].users == 0) {
      free_.push_back(node);
      node = nodes_[node].parent;
    }
  }

  [[nodiscard]] Node parent(Node node) const { return nodes_[node].parent; }
  /// One more than the largest node.
  [[nodiscard]] std::size_t slots() const noexcept { return nodes_.size(); }
  [[nodiscard]] const Entry& at(Node node) const { return nodes_[node].entry; }
  /// Entries from the root to the node.
  [[nodiscard]] std::vector<Entry> path_to(Node node) const {
    std::vector<Entry> path;
    for (; node != none; node = nodes_[node].parent) path.push_back(nodes_[node].entry);
    std::reverse(path.begin(), path.end());
    return path;
  }
  [[nodiscard]] std::size_t size() const noexcept { return nodes_.size() - free_.size(); }

private:
  struct Slot {
    Entry entry;
    Node parent;
    std::uint32_t users;
  };
  std::vector<Slot> nodes_;
  std::vector<Node> free_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
