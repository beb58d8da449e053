// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// All points of an index inside an axis-parallel box, bounds included: of a kd-tree, of a growing one (as
/// multi_kd_tree.hpp says), of BruteForce.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include <cairn/index/brute_force.hpp>
#include <cairn/index/kd_tree.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// Brings an arc of a circle to coordinates as the tree holds them; low > high then says that it holds the
/// seam.
template <class M, class Real>
void wrap_box(const M& metric, std::size_t dim, Real* low, Real* high) noexcept {
  if constexpr (HasPeriods<M>)
    for (std::size_t a = 0; a < dim; ++a) {
      const auto period = static_cast<Real>(metric.period(a));
      if (!(period < std::numeric_limits<Real>::infinity())) continue;
      const bool whole = high[a] - low[a] >= period;
      low[a] = whole ? -period : wrap(low[a], period);
      high[a] = whole ? period : wrap(high[a], period);
    }
}

/// Whether a box, brought to the tree's coordinates, holds the seam of a circle.
template <class M, class Real>
[[nodiscard]] bool goes_around(const M& metric, const Real* low, const Real* high,
                               std::size_t axis) noexcept {
  if constexpr (HasPeriods<M>)
    return metric.period(axis) < std::numeric_limits<Real>::infinity() && high[axis] < low[axis];
  return false;
}

/// Whether a coordinate is between the box's bounds on its axis.
template <class M, class Real>
[[nodiscard]] bool is_between(const M& metric, const Real* low, const Real* high, std::size_t axis,
                              Real number) noexcept {
  return goes_around(metric, low, high, axis) ? low[axis] <= number || number <= high[axis]
                                              : low[axis] <= number && number <= high[axis];
}

template <class Tree, class Visit>
class BoxQuery {
public:
  using Real = typename Tree::Real;

  BoxQuery(const Tree& tree, const Real* low, const Real* high, Visit& visit)
      : tree_(tree), low_(low), high_(high), visit_(visit) {}

  void descend(unsigned depth, std::size_t slot) const {
    const Range leaves = TreeAccess::layout(tree_).leaves_below(depth, slot);
    if (leaves.size() == 1) return scan(leaves.begin);
    const auto& split = TreeAccess::split(tree_, depth, slot);
    const auto value = static_cast<Real>(split.value);
    const bool around = goes_around(tree_.metric(), low_, high_, split.axis);
    if (around || low_[split.axis] <= value) descend(depth + 1, 2 * slot);
    if (around || high_[split.axis] >= value) descend(depth + 1, 2 * slot + 1);
  }

private:
  void scan(std::size_t leaf) const {
    const auto* block = TreeAccess::blocks(tree_).block(leaf);
    const PointId* ids = TreeAccess::blocks(tree_).ids(leaf);
    for (std::size_t lane = 0; lane < block_size && ids[lane] != no_point; ++lane) {
      bool inside = true;
      for (std::size_t a = 0; inside && a < tree_.dimension(); ++a)
        inside = is_between(tree_.metric(), low_, high_, a, static_cast<Real>(block[a * block_size + lane]));
      if (inside) visit_(ids[lane]);
    }
  }

  const Tree& tree_;
  const Real* low_;
  const Real* high_;
  Visit& visit_;
};

/// The corners of a box, low before high, checked and brought to the index's coordinates.
template <class Index, QueryPoint Low, QueryPoint High>
[[nodiscard]] std::vector<typename Index::Real> corners_of(const Index& index, const Low& low,
                                                           const High& high) {
  const std::size_t dim = index.dimension();
  std::vector<typename Index::Real> corners(2 * dim);
  copy_point(low, dim, corners.data(), {"visit_inside: corner", 0});
  copy_point(high, dim, corners.data() + dim, {"visit_inside: corner", 1});
  wrap_box(index.metric(), dim, corners.data(), corners.data() + dim);
  return corners;
}

}  // namespace detail

/// Calls visit(id) for every point p of the tree with low[a] <= p[a] <= high[a] for all axes a, in leaf
/// order. Throws Error for corners that are not finite or have another dimension; a box whose low is above
/// its high holds nothing. On a circle low to high is the arc that begins at low, the whole circle where it
/// is a period long. O(n^(1 - 1/dim) + found).
template <class Scalar, std::size_t Dim, class M, QueryPoint Low, QueryPoint High, class Visit>
void visit_inside(const KdTree<Scalar, Dim, M>& tree, const Low& low, const High& high, Visit&& visit) {
  using Tree = KdTree<Scalar, Dim, M>;
  if (tree.empty()) return;
  const auto corners = detail::corners_of(tree, low, high);
  detail::BoxQuery<Tree, std::remove_reference_t<Visit>> query(tree, corners.data(),
                                                               corners.data() + tree.dimension(), visit);
  query.descend(0, 0);
}

/// The same of BruteForce, in the order of the set. O(n).
template <class Scalar, std::size_t Dim, class M, QueryPoint Low, QueryPoint High, class Visit>
void visit_inside(const BruteForce<Scalar, Dim, M>& index, const Low& low, const High& high, Visit&& visit) {
  using Real = typename BruteForce<Scalar, Dim, M>::Real;
  if (index.empty()) return;
  const auto corners = detail::corners_of(index, low, high);
  const Real* const first = corners.data();
  index.for_each([&](PointId id, std::span<const Scalar> row) {
    bool inside = true;
    for (std::size_t a = 0; inside && a < row.size(); ++a)
      inside = detail::is_between(index.metric(), first, first + row.size(), a, static_cast<Real>(row[a]));
    if (inside) visit(id);
  });
}

/// Their ids.
template <class Scalar, std::size_t Dim, class M, QueryPoint Low, QueryPoint High>
[[nodiscard]] std::vector<PointId> inside(const KdTree<Scalar, Dim, M>& tree, const Low& low,
                                          const High& high) {
  std::vector<PointId> found;
  visit_inside(tree, low, high, [&](PointId id) { found.push_back(id); });
  return found;
}

template <class Scalar, std::size_t Dim, class M, QueryPoint Low, QueryPoint High>
[[nodiscard]] std::vector<PointId> inside(const BruteForce<Scalar, Dim, M>& index, const Low& low,
                                          const High& high) {
  std::vector<PointId> found;
  visit_inside(index, low, high, [&](PointId id) { found.push_back(id); });
  return found;
}

}}  // namespace cairn::CAIRN_ABI
