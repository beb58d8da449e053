// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The points of a kd-tree one after the other, nearest first, for callers who do not know beforehand how
/// many they need (Hjaltason and Samet, "Distance browsing in spatial databases", ACM TODS 24, 1999).
///
/// ```cpp
/// cairn::NearestFirst order(tree, query);
/// while (const auto hit = order.next())
///   if (suits(hit->id)) break;
/// ```
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <cairn/index/brute_force.hpp>
#include <cairn/index/kd_tree.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// Takes every point that it is offered; the nearest comes out first. Reduced distances.
template <class Hit>
class HitQueue {
public:
  using Real = decltype(Hit::distance);

  [[nodiscard]] bool empty() const noexcept { return hits_.empty(); }
  [[nodiscard]] const Hit& front() const noexcept { return hits_.front(); }
  [[nodiscard]] Hit pop() {
    std::pop_heap(hits_.begin(), hits_.end(), Farther{});
    const Hit hit = hits_.back();
    hits_.pop_back();
    return hit;
  }

  /// What makes it a collector.
  [[nodiscard]] Real limit() const noexcept { return std::numeric_limits<Real>::infinity(); }
  void offer(PointId id, Real reduced) {
    hits_.push_back({id, reduced});
    std::push_heap(hits_.begin(), hits_.end(), Farther{});
  }

private:
  struct Farther {
    bool operator()(const Hit& a, const Hit& b) const noexcept { return nearer(b, a); }
  };
  std::vector<Hit> hits_;
};

}  // namespace detail

/// Refers to the tree, which must live longer. The k-th call costs as much as it takes to be sure of the k-th
/// nearest; memory grows with the leaves visited.
template <class Tree>
class NearestFirst {
public:
  using Real = typename Tree::Real;
  using Hit = typename Tree::Hit;

  /// Throws Error where the query is not finite or of another dimension.
  template <QueryPoint Query>
    requires detail::is_kd_tree<Tree>
  NearestFirst(const Tree& tree, const Query& query) : tree_(&tree), query_(tree.dimension()) {
    if (tree.empty()) return;
    detail::copy_point<Real>(query, query_.size(), query_.data(), {"NearestFirst: query", 0});
    detail::wrap_row(tree.metric(), query_.size(), query_.data());
    cells_.push_back({0, 0, 0, {}});
  }
  template <QueryPoint Query>
  NearestFirst(const Tree&&, const Query&) = delete;  ///< would be gone

  /// The next nearest point, with its true distance; nothing when all have been given.
  std::optional<Hit> next() {
    while (!cells_.empty() && (hits_.empty() || cells_.front().bound <= hits_.front().distance))
      open_nearest_cell();
    if (hits_.empty()) return std::nullopt;
    const Hit hit = hits_.pop();
    return Hit{hit.id, tree_->metric().restore(hit.distance)};
  }

private:
  /// How far a cell is along one axis, kept for the axes on which it does not contain the query.
  struct Offset {
    std::uint32_t axis;
    Real offset;
  };
  struct Cell {
    Real bound;
    unsigned depth;
    std::size_t slot;
    std::vector<Offset> offsets;
  };

  struct FartherCell {
    bool operator()(const Cell& a, const Cell& b) const noexcept { return a.bound > b.bound; }
  };

  void open_nearest_cell() {
    std::pop_heap(cells_.begin(), cells_.end(), FartherCell{});
    Cell cell = std::move(cells_.back());
    cells_.pop_back();
    for (;; ++cell.depth) {
      const detail::Range leaves = detail::TreeAccess::layout(*tree_).leaves_below(cell.depth, cell.slot);
      if (leaves.size() == 1) {
        Work work;
        return detail::TreeAccess::scan_leaf(*tree_, leaves.begin, query_.data(), hits_, work);
      }
      const auto& split = detail::TreeAccess::split(*tree_, cell.depth, cell.slot);
      const Real offset = query_[split.axis] - static_cast<Real>(split.value);
      const std::size_t near = 2 * cell.slot + (offset < 0 ? 0 : 1);
      const Real across = detail::offset_across(tree_->metric(), query_[split.axis],
                                                static_cast<Real>(split.value), split.axis);
      queue_far_side(cell, split.axis, across, near ^ 1U);
      cell.slot = near;
    }
  }

  void queue_far_side(const Cell& cell, std::uint32_t axis, Real offset, std::size_t slot) {
    Cell far{cell.bound, cell.depth + 1, slot, cell.offsets};
    auto at =
        std::find_if(far.offsets.begin(), far.offsets.end(), [&](const Offset& o) { return o.axis == axis; });
    const Real old = at == far.offsets.end() ? Real{0} : at->offset;
    far.bound = detail::moved_bound(tree_->metric(), cell.bound, old, offset, axis);
    if (at == far.offsets.end())
      far.offsets.push_back({axis, offset});
    else
      at->offset = offset;
    cells_.push_back(std::move(far));
    std::push_heap(cells_.begin(), cells_.end(), FartherCell{});
  }

  const Tree* tree_;
  std::vector<Real> query_;
  std::vector<Cell> cells_;
  detail::HitQueue<Hit> hits_;
};
template <class Tree, QueryPoint Query>
NearestFirst(const Tree&, const Query&) -> NearestFirst<Tree>;

/// The same of BruteForce: the first call costs O(n), each further one O(log n).
template <class Scalar, std::size_t Dim, class M>
class NearestFirst<BruteForce<Scalar, Dim, M>> {
public:
  using Index = BruteForce<Scalar, Dim, M>;
  using Real = typename Index::Real;
  using Hit = typename Index::Hit;

  template <QueryPoint Query>
  NearestFirst(const Index& index, const Query& query) : metric_(index.metric()) {
    index.search(query, hits_);
  }

  std::optional<Hit> next() {
    if (hits_.empty()) return std::nullopt;
    const Hit hit = hits_.pop();
    return Hit{hit.id, metric_.restore(hit.distance)};
  }

private:
  [[no_unique_address]] M metric_;
  detail::HitQueue<Hit> hits_;
};

}}  // namespace cairn::CAIRN_ABI
