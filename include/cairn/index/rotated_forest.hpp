// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Several kd-trees of the same descriptors, each along axes of its own, searched with one queue and one
/// budget (Silpa-Anan and Hartley, "Optimised KD-trees for fast image descriptor matching", CVPR 2008).
///
/// ```cpp
/// const cairn::RotatedForest<64> forest(descriptors, {.trees = 2});
/// cairn::BestBinFirst<cairn::RotatedForest<64>> search;  // one a thread
/// cairn::NearestTwo<float> two;
/// search.search(forest, query, two, {.leaves = 64});
/// ```
///
/// The first tree splits along the principal axes; the others turn the foremost of them by random rotations,
/// so that a point that one tree hides behind a split is in front in another. Each tree holds all points:
/// memory and build grow with their number, a search's work does not. Where it pays, and where it does not:
/// docs/index.md.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/principal_axes.hpp>

namespace cairn::inline CAIRN_ABI {

struct RotatedForestOptions {
  std::size_t trees = 4;
  std::size_t turned_axes = 24;  ///< how many principal axes the further trees mix; at most the dimension
  std::uint64_t seed = 1;        ///< the same seed gives the same forest
};

/// Const methods may run at the same time.
template <std::size_t Dim = dynamic_dim>
class RotatedForest {
public:
  using Tree = KdTree<float, Dim>;
  using Real = float;

  RotatedForest() = default;

  /// Throws Error for points that are not finite or of different dimensions.
  template <PointSet Points>
  explicit RotatedForest(const Points& points, const RotatedForestOptions& options = {}) {
    CAIRN_EXPECTS(options.trees >= 1, "RotatedForest: there must be a tree");
    if (points.size() == 0) return;
    const std::size_t dim = detail::dimension_of<Dim>(points);
    const auto rows = detail::copy_points<float>(points, dim, "RotatedForest: point");
    axes_.emplace_back(Rows<float>(rows, dim));
    std::vector<float> turned(rows.size());
    for (std::size_t i = 0; i < rows.size(); i += dim) axes_.front().turn(&rows[i], &turned[i]);
    mixed_ = std::min(options.turned_axes, dim);
    Random random(options.seed);
    std::vector<float> mixed_rows;
    for (std::size_t t = 0; t < options.trees; ++t) {
      if (t == 0) {
        trees_.push_back(Tree::from_rows(turned, dim));
        continue;
      }
      rotations_.push_back(random_rotation(random));
      mixed_rows.resize(turned.size());
      for (std::size_t i = 0; i < turned.size(); i += dim) mix(t, &turned[i], &mixed_rows[i], dim);
      trees_.push_back(Tree::from_rows(mixed_rows, dim));
    }
  }

  [[nodiscard]] std::size_t size() const noexcept { return trees_.empty() ? 0 : trees_.front().size(); }
  [[nodiscard]] bool empty() const noexcept { return size() == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return empty() ? Dim : trees_.front().dimension(); }
  [[nodiscard]] std::span<const Tree> trees() const noexcept { return trees_; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    std::size_t sum = 0;
    for (const Tree& tree : trees_) sum += tree.bytes();
    return sum;
  }

  /// Writes the query (dimension() numbers) as each tree sees it, one after the other.
  void turn(const float* query, float* turned) const noexcept {
    const std::size_t dim = dimension();
    axes_.front().turn(query, turned);
    for (std::size_t t = 1; t < trees_.size(); ++t) mix(t, turned, turned + t * dim, dim);
  }

private:
  /// Row by row an orthonormal basis from normal draws (Gram-Schmidt, twice for accuracy).
  [[nodiscard]] std::vector<float> random_rotation(Random& random) const {
    std::vector<double> rows(mixed_ * mixed_);
    for (std::size_t r = 0; r < mixed_; ++r) {
      double* row = &rows[r * mixed_];
      double length = 0;
      while (!(length > 1e-3)) {
        for (std::size_t i = 0; i < mixed_; ++i) row[i] = random.normal();
        for (int pass = 0; pass < 2; ++pass)
          for (std::size_t other = 0; other < r; ++other) {
            double along = 0;
            for (std::size_t i = 0; i < mixed_; ++i) along += row[i] * rows[other * mixed_ + i];
            for (std::size_t i = 0; i < mixed_; ++i) row[i] -= along * rows[other * mixed_ + i];
          }
        length = 0;
        for (std::size_t i = 0; i < mixed_; ++i) length += row[i] * row[i];
        length = std::sqrt(length);
      }
      for (std::size_t i = 0; i < mixed_; ++i) row[i] /= length;
    }
    return {rows.begin(), rows.end()};
  }

  void mix(std::size_t tree, const float* from, float* to, std::size_t dim) const noexcept {
    const std::vector<float>& rotation = rotations_[tree - 1];
    std::fill_n(to, mixed_, 0.0F);
    for (std::size_t a = 0; a < mixed_; ++a)
      for (std::size_t i = 0; i < mixed_; ++i) to[i] += from[a] * rotation[a * mixed_ + i];
    std::copy(from + mixed_, from + dim, to + mixed_);
  }

  std::vector<PrincipalAxes> axes_;  ///< one, or none while there are no points
  std::size_t mixed_ = 0;
  std::vector<std::vector<float>> rotations_;
  std::vector<Tree> trees_;
};

namespace detail {

/// Passes on each point once. Only points nearer than the limit matter, so the list stays short.
template <class C>
class OnlyOnce {
public:
  OnlyOnce(C& collector, std::vector<PointId>& seen) : collector_(collector), seen_(seen) { seen_.clear(); }
  [[nodiscard]] auto limit() const noexcept { return collector_.limit(); }
  void offer(PointId id, float reduced) {
    if (!(reduced < static_cast<float>(collector_.limit()))) return;
    if (std::find(seen_.rbegin(), seen_.rend(), id) != seen_.rend()) return;
    seen_.push_back(id);
    collector_.offer(id, reduced);
  }

private:
  C& collector_;
  std::vector<PointId>& seen_;
};

}  // namespace detail

/// Best-bin-first search through all trees of a forest at once; keep one for many searches, one a thread.
template <std::size_t Dim>
class BestBinFirst<RotatedForest<Dim>> {
public:
  using Real = float;

  /// Offers each point at most once. Throws Error where the query is not finite or of another dimension.
  /// Returns true where the answer is exact, up to the rounding of the rotations. `budget` is for all trees
  /// together.
  template <Point Query, Collector<float> C>
  bool search(const RotatedForest<Dim>& forest, const Query& query, C& collector, Budget budget = {},
              Work* work = nullptr) {
    if (forest.empty()) return true;
    const std::size_t dim = forest.dimension();
    row_.resize(dim);
    detail::copy_point<float>(query, dim, row_.data(), {"BestBinFirst: query", 0});
    turned_.resize(dim * forest.trees().size());
    forest.turn(row_.data(), turned_.data());
    trees_.clear();
    queries_.clear();
    for (const auto& tree : forest.trees()) {
      queries_.push_back(turned_.data() + trees_.size() * dim);
      trees_.push_back(&tree);
    }
    using Tree = typename RotatedForest<Dim>::Tree;
    detail::OnlyOnce<C> once(collector, seen_);
    return search_.search(std::span<const Tree* const>(trees_), std::span<const float* const>(queries_), once,
                          budget, work);
  }

private:
  BestBinFirst<typename RotatedForest<Dim>::Tree> search_;
  std::vector<const typename RotatedForest<Dim>::Tree*> trees_;
  std::vector<const float*> queries_;
  std::vector<float> row_;
  std::vector<float> turned_;
  std::vector<PointId> seen_;
};

}  // namespace cairn::inline CAIRN_ABI
