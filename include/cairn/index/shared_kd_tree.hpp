// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A kd-tree whose copies share what none of them has changed: where the landmarks of a particle are.
///
/// Branches split at the median of the wider axis, leaves hold up to 16 points. Copying is O(1); an insertion
/// or erasure copies the branches and the leaf on its way that others hold (J. Driscoll, N. Sarnak,
/// D. Sleator, R. Tarjan, "Making data structures persistent", JCSS 38, 1989, sec. 2: path copying). Where a
/// way grows longer than twice the logarithm of what is below, that part is built anew (I. Galperin,
/// R. Rivest, "Scapegoat trees", SODA 1993): O(log n) amortised over the changes of one tree. Where that
/// falls due in a part which many copies share, each builds and keeps its own. Different trees may be used
/// from different threads at once also where they share nodes. Of many points at the very same place erase()
/// looks at up to all. Where memory ends within insert() or erase(), that tree is to be given up; its copies
/// are as they were.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/counted.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Of points of D numbers, each with an id that the user gives; the same id at several points is allowed.
template <int D, class Id = std::uint32_t>
class SharedKdTree {
public:
  using Point = std::array<double, D>;
  struct Entry {
    Point point{};
    Id id{};
  };

  [[nodiscard]] std::size_t size() const noexcept { return root_.size(); }

  /// Throws Error where a number is not finite.
  void insert(const Point& point, Id id) {
    for (const double number : point)
      if (!(number - number == 0)) raise("SharedKdTree: expected a point of finite numbers");
    insert(root_, {point, id});
  }

  /// Takes out the entry of this id at exactly this point. False, and nothing changed, where there is none.
  bool erase(const Point& point, Id id) {
    if (!holds(root_, point, id)) return false;
    erase(root_, point, id);
    return true;
  }

  /// Calls visit(id, point) for every point of the box, bounds included.
  template <class Visit>
  void for_each_in_box(const Point& low, const Point& high, Visit&& visit) const {
    search(root_, low, high, visit);
  }

  /// Nodes that changes of this tree have copied: what sharing costs.
  [[nodiscard]] std::size_t node_copies() const noexcept { return copies_; }
  /// Branches on the longest way.
  [[nodiscard]] std::size_t depth() const noexcept { return depth(root_); }

private:
  static constexpr std::size_t leaf_size = 16;

  struct Branch;
  struct Leaf {
    std::size_t count = 0;
    std::array<Entry, leaf_size> entries{};
  };
  /// What is below: a branch, a leaf or nothing.
  struct Below {
    Counted<Branch> branch{};
    Counted<Leaf> leaf{};
    [[nodiscard]] std::size_t size() const noexcept {
      if (branch) return branch.get()->size;
      return leaf ? leaf.get()->count : 0;
    }
  };
  /// Points whose number on the axis is less than `split` are in the first part, greater in the second, equal
  /// in either.
  struct Branch {
    int axis = 0;
    double split = 0;
    std::size_t size = 0;
    std::array<Below, 2> parts{};
  };

  template <class Node>
  Node& own(Counted<Node>& node) {
    copies_ += node.shared() ? 1 : 0;
    return node.own();
  }

  /// More branches than this above points as many as these, and they are built anew.
  static std::size_t most_depth(std::size_t points) noexcept {
    return 2 * static_cast<std::size_t>(std::bit_width(points / leaf_size)) + 2;
  }

  /// Returns branches from here to where the entry went.
  std::size_t insert(Below& at, const Entry& entry) {
    if (!at.branch) {
      insert_in_leaf(at, entry);
      return at.branch ? 1 : 0;
    }
    Branch& branch = own(at.branch);
    ++branch.size;
    const std::size_t part = entry.point[static_cast<std::size_t>(branch.axis)] < branch.split ? 0 : 1;
    const std::size_t below = insert(branch.parts[part], entry) + 1;
    if (below <= most_depth(branch.size)) return below;
    rebuild(at);
    return depth(at);
  }

  void insert_in_leaf(Below& at, const Entry& entry) {
    Leaf& leaf = own(at.leaf);
    if (leaf.count < leaf_size) {
      leaf.entries[leaf.count++] = entry;
      return;
    }
    std::vector<Entry> all(leaf.entries.begin(), leaf.entries.end());
    all.push_back(entry);
    at = built(all.data(), all.data() + all.size());
  }

  [[nodiscard]] static bool holds(const Below& at, const Point& point, Id id) {
    if (at.branch) {
      const Branch& branch = *at.branch.get();
      const double number = point[static_cast<std::size_t>(branch.axis)];
      return (number <= branch.split && holds(branch.parts[0], point, id)) ||
             (number >= branch.split && holds(branch.parts[1], point, id));
    }
    if (!at.leaf) return false;
    const Leaf& leaf = *at.leaf.get();
    return std::any_of(leaf.entries.begin(), leaf.entries.begin() + static_cast<std::ptrdiff_t>(leaf.count),
                       [&](const Entry& e) { return e.id == id && e.point == point; });
  }

  /// Of an entry that is there.
  void erase(Below& at, const Point& point, Id id) {
    if (!at.branch) {
      Leaf& leaf = own(at.leaf);
      std::size_t i = 0;
      while (leaf.entries[i].id != id || leaf.entries[i].point != point) ++i;
      leaf.entries[i] = leaf.entries[--leaf.count];
      return;
    }
    Branch& branch = own(at.branch);
    --branch.size;
    const bool first =
        point[static_cast<std::size_t>(branch.axis)] <= branch.split && holds(branch.parts[0], point, id);
    erase(branch.parts[first ? 0 : 1], point, id);
    if (branch.size <= leaf_size / 2) rebuild(at);
  }

  template <class Visit>
  static void search(const Below& at, const Point& low, const Point& high, Visit& visit) {
    if (at.branch) {
      const Branch& branch = *at.branch.get();
      const auto axis = static_cast<std::size_t>(branch.axis);
      if (low[axis] <= branch.split) search(branch.parts[0], low, high, visit);
      if (high[axis] >= branch.split) search(branch.parts[1], low, high, visit);
    } else if (at.leaf) {
      const Leaf& leaf = *at.leaf.get();
      for (std::size_t i = 0; i < leaf.count; ++i)
        if (is_inside(leaf.entries[i].point, low, high)) visit(leaf.entries[i].id, leaf.entries[i].point);
    }
  }
  [[nodiscard]] static bool is_inside(const Point& p, const Point& low, const Point& high) noexcept {
    for (std::size_t a = 0; a < D; ++a)
      if (!(low[a] <= p[a] && p[a] <= high[a])) return false;
    return true;
  }

  [[nodiscard]] static std::size_t depth(const Below& at) noexcept {
    if (!at.branch) return 0;
    return 1 + std::max(depth(at.branch.get()->parts[0]), depth(at.branch.get()->parts[1]));
  }

  static void collect(const Below& at, std::vector<Entry>& all) {
    if (at.branch) {
      for (const Below& part : at.branch.get()->parts) collect(part, all);
    } else if (at.leaf) {
      const Leaf& leaf = *at.leaf.get();
      all.insert(all.end(), leaf.entries.begin(),
                 leaf.entries.begin() + static_cast<std::ptrdiff_t>(leaf.count));
    }
  }

  static void rebuild(Below& at) {
    std::vector<Entry> all;
    all.reserve(at.size());
    collect(at, all);
    at = built(all.data(), all.data() + all.size());
  }

  [[nodiscard]] static Below built(Entry* begin, Entry* end) {
    const auto count = static_cast<std::size_t>(end - begin);
    Below result;
    if (count <= leaf_size) {
      Leaf& leaf = result.leaf.own();
      leaf.count = count;
      std::copy(begin, end, leaf.entries.begin());
      return result;
    }
    Branch& branch = result.branch.own();
    const std::size_t axis = wider_axis(begin, end);
    Entry* const middle = begin + count / 2;
    std::nth_element(begin, middle, end,
                     [axis](const Entry& a, const Entry& b) { return a.point[axis] < b.point[axis]; });
    branch.axis = static_cast<int>(axis);
    branch.split = middle->point[axis];
    branch.size = count;
    branch.parts = {built(begin, middle), built(middle, end)};
    return result;
  }

  [[nodiscard]] static std::size_t wider_axis(const Entry* begin, const Entry* end) noexcept {
    Point low = begin->point, high = begin->point;
    for (const Entry* e = begin; e != end; ++e)
      for (std::size_t a = 0; a < D; ++a) {
        low[a] = std::min(low[a], e->point[a]);
        high[a] = std::max(high[a], e->point[a]);
      }
    std::size_t widest = 0;
    for (std::size_t a = 1; a < D; ++a)
      if (high[a] - low[a] > high[widest] - low[widest]) widest = a;
    return widest;
  }

  Below root_;
  ResetOnMove<std::size_t> copies_;
};

}}  // namespace cairn::CAIRN_ABI
