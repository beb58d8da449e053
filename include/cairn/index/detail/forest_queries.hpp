// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Searches of a growing set beside its own: under a budget, in a box, nearest first. Erased points stay in
/// its trees until a merge drops them, so whatever goes through the trees asks who is live.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/box_query.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/tree_merge.hpp>
#include <cairn/index/nearest_first.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

template <class Scalar, std::size_t Dim, class M>
class MultiKdTree;  // multi_kd_tree.hpp

namespace detail {

template <class Index>
inline constexpr bool is_multi_kd_tree = false;
template <class Scalar, std::size_t Dim, class M>
inline constexpr bool is_multi_kd_tree<MultiKdTree<Scalar, Dim, M>> = true;

/// Passes on to a collector what is not erased; everything where `state` is null, so that a search is
/// compiled once for both.
template <class Real, class C>
struct OnlyLive {
  const PointState* state;
  C* collector;
  [[nodiscard]] Real limit() const { return static_cast<Real>(collector->limit()); }
  void offer(PointId id, Real reduced) {
    if (state == nullptr || state[id] == PointState::live) collector->offer(id, reduced);
  }

  /// Leaves are sifted as a whole (leaf_blocks.hpp). Whether anything may be held back.
  [[nodiscard]] bool sifting() const noexcept { return state != nullptr; }
  /// Which points of a leaf, of those in a mask, are not erased. Without a branch for each: who is erased
  /// cannot be predicted.
  [[nodiscard, gnu::always_inline]] unsigned live(unsigned mask, const PointId* ids) const noexcept {
    unsigned live = 0;
    for (; mask != 0; mask &= mask - 1) {
      const auto lane = static_cast<unsigned>(std::countr_zero(mask));
      const PointId id = ids[lane];
      if (id != no_point) live |= static_cast<unsigned>(state[id] == PointState::live) << lane;
    }
    return live;
  }
};
template <class Real, class C>
inline constexpr bool keeps_one<OnlyLive<Real, C>> = keeps_one<C>;
template <class Real, class C>
inline constexpr bool sifts<OnlyLive<Real, C>> = true;

/// For searches of other headers: the trees of a multi-kd-tree, which hold erased points too, and who is not.
struct ForestAccess {
  template <class Index>
  [[nodiscard]] static auto trees(const Index& index) noexcept {
    return index.forest_.trees();
  }
  template <class Index>
  [[nodiscard]] static bool all_live(const Index& index) noexcept {
    return index.live_ == index.forest_.stored();
  }
  /// A collector's view of what is not erased.
  template <class Index, class C>
  [[nodiscard]] static auto only_live(const Index& index, C& collector) noexcept {
    return OnlyLive<typename Index::Real, C>{all_live(index) ? nullptr : states(index).data(), &collector};
  }
  template <class Index>
  [[nodiscard]] static const std::vector<PointState>& states(const Index& index) noexcept {
    return index.state_;
  }
  /// After loading: which ids were given. Those that the index holds must be live in `states` too.
  template <class Index>
  static void set_states(Index& index, std::vector<PointState> states) noexcept {
    index.state_ = std::move(states);
  }
};

}  // namespace detail

/// Best-bin-first search through all trees of a growing set at once; keep one for many searches, one a
/// thread.
template <class Scalar, std::size_t Dim, class M>
class BestBinFirst<MultiKdTree<Scalar, Dim, M>> {
public:
  using Index = MultiKdTree<Scalar, Dim, M>;
  using Real = typename Index::Real;

  /// Offers points that are not erased, until nothing nearer can be left or the budget, which is for all
  /// trees together, is spent. A leaf counts whether its points are erased or not: where many are, rebuild().
  /// Throws Error where the query is not finite or of another dimension. Returns true where the answer is
  /// exact.
  template <Point Query, Collector<Real> C>
  bool search(const Index& index, const Query& query, C& collector, Budget budget = {},
              Work* work = nullptr) {
    detail::check_collector<C, M>();
    if (index.empty()) return true;
    row_.resize(index.dimension());
    detail::copy_point<Real>(query, row_.size(), row_.data(), {"BestBinFirst: query", 0});
    const auto trees = detail::ForestAccess::trees(index);
    trees_.assign(trees.rbegin(), trees.rend());  // the largest first: its nearest rule out most of the rest
    auto only_live = detail::ForestAccess::only_live(index, collector);
    return search_.search(std::span<const Tree* const>(trees_), row_.data(), only_live, budget, work);
  }

private:
  using Tree = typename Index::Tree;

  BestBinFirst<Tree> search_;
  std::vector<const Tree*> trees_;
  std::vector<Real> row_;
};

/// The points of a growing set that are not erased, nearest first; the set must not change meanwhile. Of the
/// trees the one with the nearest next point gives it.
template <class Scalar, std::size_t Dim, class M>
class NearestFirst<MultiKdTree<Scalar, Dim, M>> {
public:
  using Index = MultiKdTree<Scalar, Dim, M>;
  using Real = typename Index::Real;
  using Hit = typename Index::Hit;

  /// Throws Error where the query is not finite or of another dimension.
  template <Point Query>
  NearestFirst(const Index& index, const Query& query) : index_(&index) {
    for (const auto* tree : detail::ForestAccess::trees(index)) {
      orders_.emplace_back(*tree, query);
      heads_.push_back(next_of(orders_.back()));
    }
  }
  template <Point Query>
  NearestFirst(const Index&&, const Query&) = delete;  ///< would be gone

  /// The next nearest point, with its true distance; nothing when all have been given.
  std::optional<Hit> next() {
    const auto less = [](const std::optional<Hit>& a, const std::optional<Hit>& b) {
      return a && (!b || nearer(*a, *b));
    };
    const auto head = std::min_element(heads_.begin(), heads_.end(), less);
    if (head == heads_.end()) return std::nullopt;
    const std::optional<Hit> hit = *head;
    if (hit) *head = next_of(orders_[static_cast<std::size_t>(head - heads_.begin())]);
    return hit;
  }

private:
  using Order = NearestFirst<typename Index::Tree>;

  [[nodiscard]] std::optional<Hit> next_of(Order& order) const {
    std::optional<Hit> hit = order.next();
    while (hit && !index_->contains(hit->id)) hit = order.next();
    return hit;
  }

  const Index* index_;
  std::vector<Order> orders_;
  std::vector<std::optional<Hit>> heads_;
};

/// As visit_inside() of a KdTree, for the points that are not erased, tree by tree.
template <class Scalar, std::size_t Dim, class M, Point Low, Point High, class Visit>
void visit_inside(const MultiKdTree<Scalar, Dim, M>& index, const Low& low, const High& high, Visit&& visit) {
  for (const auto* tree : detail::ForestAccess::trees(index))
    visit_inside(*tree, low, high, [&](PointId id) {
      if (index.contains(id)) visit(id);
    });
}

/// Their ids.
template <class Scalar, std::size_t Dim, class M, Point Low, Point High>
[[nodiscard]] std::vector<PointId> inside(const MultiKdTree<Scalar, Dim, M>& index, const Low& low,
                                          const High& high) {
  std::vector<PointId> found;
  visit_inside(index, low, high, [&](PointId id) { found.push_back(id); });
  return found;
}

}}  // namespace cairn::CAIRN_ABI
