// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// All points of a kd-tree inside an axis-parallel box, bounds included.
#pragma once

#include <cstddef>
#include <limits>
#include <type_traits>
#include <vector>

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

template <class Tree, class Visit>
class BoxQuery {
public:
  using Real = typename Tree::Real;

  BoxQuery(const Tree& tree, const Real* low, const Real* high, Visit& visit)
      : tree_(tree), low_(low), high_(high), visit_(visit) {}

  void descend(unsigned depth, std::size_t slot) const {
    const Range leaves = tree_.layout().leaves_below(depth, slot);
    if (leaves.size() == 1) return scan(leaves.begin);
    const auto& split = tree_.split(depth, slot);
    const auto value = static_cast<Real>(split.value);
    const bool around = goes_around(split.axis);
    if (around || low_[split.axis] <= value) descend(depth + 1, 2 * slot);
    if (around || high_[split.axis] >= value) descend(depth + 1, 2 * slot + 1);
  }

private:
  /// Whether the box holds the seam of a circle.
  [[nodiscard]] bool goes_around(std::size_t axis) const noexcept {
    if constexpr (HasPeriods<typename Tree::Measure>)
      return tree_.metric().period(axis) < std::numeric_limits<Real>::infinity() && high_[axis] < low_[axis];
    return false;
  }

  void scan(std::size_t leaf) const {
    const auto* block = tree_.blocks().block(leaf);
    const PointId* ids = tree_.blocks().ids(leaf);
    for (std::size_t lane = 0; lane < block_size && ids[lane] != no_point; ++lane) {
      bool inside = true;
      for (std::size_t a = 0; inside && a < tree_.dimension(); ++a) {
        const auto number = static_cast<Real>(block[a * block_size + lane]);
        inside = goes_around(a) ? low_[a] <= number || number <= high_[a]
                                : low_[a] <= number && number <= high_[a];
      }
      if (inside) visit_(ids[lane]);
    }
  }

  const Tree& tree_;
  const Real* low_;
  const Real* high_;
  Visit& visit_;
};

}  // namespace detail

/// Calls visit(id) for every point p of the tree with low[a] <= p[a] <= high[a] for all axes a, in leaf
/// order. Throws Error for corners that are not finite or have another dimension; a box whose low is above
/// its high holds nothing. On a circle low to high is the arc that begins at low, the whole circle where it
/// is a period long. O(n^(1 - 1/dim) + found).
template <class Scalar, std::size_t Dim, class M, Point Low, Point High, class Visit>
void visit_inside(const KdTree<Scalar, Dim, M>& tree, const Low& low, const High& high, Visit&& visit) {
  using Tree = KdTree<Scalar, Dim, M>;
  if (tree.empty()) return;
  std::vector<typename Tree::Real> corners(2 * tree.dimension());
  detail::copy_point(low, tree.dimension(), corners.data(), {"visit_inside: corner", 0});
  detail::copy_point(high, tree.dimension(), corners.data() + tree.dimension(), {"visit_inside: corner", 1});
  detail::wrap_box(tree.metric(), tree.dimension(), corners.data(), corners.data() + tree.dimension());
  detail::BoxQuery<Tree, std::remove_reference_t<Visit>> query(tree, corners.data(),
                                                               corners.data() + tree.dimension(), visit);
  query.descend(0, 0);
}

/// Their ids.
template <class Scalar, std::size_t Dim, class M, Point Low, Point High>
[[nodiscard]] std::vector<PointId> inside(const KdTree<Scalar, Dim, M>& tree, const Low& low,
                                          const High& high) {
  std::vector<PointId> found;
  visit_inside(tree, low, high, [&](PointId id) { found.push_back(id); });
  return found;
}

}}  // namespace cairn::CAIRN_ABI
