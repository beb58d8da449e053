// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Two arrangements of the descriptors of one class of landmarks: one tree, or a probation tree beside a
/// multi-kd-tree. A store (landmark_store.hpp) says who is added and who is gone.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <cairn/index/kd_tree.hpp>
#include <cairn/index/landmark_ledger.hpp>
#include <cairn/index/multi_kd_tree.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// A few trees to search together; empty ones are left out.
template <class Tree>
class TreeList {
public:
  void add(const Tree& tree) noexcept {
    if (!tree.empty()) trees_[size_++] = &tree;
  }
  [[nodiscard]] std::span<const Tree* const> get() const noexcept { return {trees_.data(), size_}; }

private:
  std::array<const Tree*, 40> trees_{};  // sizes at least double, and ids have 32 bits
  std::size_t size_ = 0;
};

/// Descriptors in the order of their ids, and a tree of them, rebuilt when told.
template <std::size_t Dim>
class DescriptorTree {
public:
  using Tree = KdTree<float, Dim>;

  void reserve_one() {
    ids_.reserve(grown(ids_.size() + 1, ids_.capacity()));
    rows_.reserve(grown(rows_.size() + Dim, rows_.capacity()));
  }
  void add(LandmarkId id, std::span<const float> row) {
    ids_.push_back(id);
    rows_.insert(rows_.end(), row.begin(), row.end());
  }

  /// Appends those that pick(id) wants.
  template <class Pick>
  void copy_if(Pick&& pick, std::vector<LandmarkId>& ids, std::vector<float>& rows) const {
    for (std::size_t i = 0; i < ids_.size(); ++i)
      if (pick(ids_[i])) {
        ids.push_back(ids_[i]);
        const auto row = rows_.begin() + static_cast<std::ptrdiff_t>(i * Dim);
        rows.insert(rows.end(), row, row + Dim);
      }
  }
  /// Drops those that keep(id) does not want.
  template <class Keep>
  void filter(Keep&& keep) noexcept {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (!keep(ids_[i])) continue;
      const auto row = rows_.begin() + static_cast<std::ptrdiff_t>(i * Dim);
      if (kept != i) std::copy(row, row + Dim, rows_.begin() + static_cast<std::ptrdiff_t>(kept * Dim));
      ids_[kept++] = ids_[i];
    }
    ids_.resize(kept);
    rows_.resize(kept * Dim);
  }

  /// The tree of those that keep(id) wants, for replace().
  template <class Keep>
  [[nodiscard]] Tree tree_of(Keep&& keep) const {
    std::vector<LandmarkId> ids;
    std::vector<float> rows;
    ids.reserve(ids_.size());
    rows.reserve(rows_.size());
    copy_if(keep, ids, rows);
    return Tree::from_rows(std::move(rows), Dim, ids);
  }
  void replace(Tree tree) noexcept {
    tree_ = std::move(tree);
    points_moved_ += tree_.size();
  }

  [[nodiscard]] const Tree& tree() const noexcept { return tree_; }
  /// The descriptors, Dim numbers each; whoever changes them rebuilds.
  [[nodiscard]] std::vector<float>& rows() noexcept { return rows_; }
  [[nodiscard]] std::uint64_t points_moved() const noexcept { return points_moved_; }

private:
  static std::size_t grown(std::size_t needed, std::size_t capacity) {
    return needed <= capacity ? capacity : std::max(needed, 2 * capacity);
  }

  std::vector<LandmarkId> ids_;
  std::vector<float> rows_;
  Tree tree_;
  std::uint64_t points_moved_ = 0;
};

/// Everything in one tree.
template <std::size_t Dim>
class SingleTree {
public:
  using Tree = KdTree<float, Dim>;

  explicit SingleTree(const MultiTreeShape&) {}

  void reserve_one() { all_.reserve_one(); }
  void add(LandmarkId id, std::span<const float> row) { all_.add(id, row); }
  [[nodiscard]] std::vector<float>& rows() noexcept { return all_.rows(); }
  void erase(LandmarkId, bool) noexcept {}  // gone from the next rebuild on; until then the store skips it

  void settle(const LandmarkLedger& ledger) {
    const auto stays = [&](LandmarkId id) { return ledger.contains(id); };
    all_.replace(all_.tree_of(stays));
    all_.filter(stays);
  }

  /// The trees to search.
  [[nodiscard]] TreeList<Tree> list() const noexcept {
    TreeList<Tree> trees;
    trees.add(all_.tree());
    return trees;
  }
  [[nodiscard]] std::uint64_t points_moved() const noexcept { return all_.points_moved(); }

private:
  DescriptorTree<Dim> all_;
};

/// Probation in a small tree of its own, base in a multi-kd-tree.
template <std::size_t Dim>
class ProbationAndMultiTree {
public:
  using Tree = KdTree<float, Dim>;

  explicit ProbationAndMultiTree(const MultiTreeShape& shape) : base_(shape) {}

  void reserve_one() { probation_.reserve_one(); }
  void add(LandmarkId id, std::span<const float> row) { probation_.add(id, row); }
  [[nodiscard]] std::vector<float>& rows() noexcept { return probation_.rows(); }
  void erase(LandmarkId id, bool base) {
    if (base) base_.erase(id);
  }

  /// What can fail comes first: a landmark that were in both trees would be its own twin.
  void settle(const LandmarkLedger& ledger) {
    const auto stays = [&](LandmarkId id) { return ledger.contains(id) && !ledger.is_base(id); };
    std::vector<LandmarkId> ids;
    std::vector<float> rows;
    probation_.copy_if([&](LandmarkId id) { return ledger.is_base(id); }, ids, rows);
    Tree tree = probation_.tree_of(stays);
    if (!ids.empty()) base_.insert(Rows<float>(rows, Dim), ids);
    probation_.replace(std::move(tree));
    probation_.filter(stays);
  }

  /// The trees to search.
  [[nodiscard]] TreeList<Tree> list() const noexcept {
    TreeList<Tree> trees;
    for (const Tree* tree : ForestAccess::trees(base_)) trees.add(*tree);  // the store skips what is gone
    trees.add(probation_.tree());
    return trees;
  }
  [[nodiscard]] std::uint64_t points_moved() const noexcept {
    return probation_.points_moved() + base_.points_moved();
  }

private:
  DescriptorTree<Dim> probation_;
  MultiKdTree<float, Dim> base_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
