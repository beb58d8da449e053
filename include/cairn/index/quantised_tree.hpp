// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A kd-tree that keeps one byte a coordinate and asks the caller's points for the last word.
///
///   const cairn::QuantisedTree tree(descriptors);        // refers to them; a quarter of the memory
///   cairn::QuantisedTree<...>::Search search;            // one a thread
///   cairn::NearestTwo<float> two;
///   search.search(tree, query, two, {.leaves = 64});
///
/// A coordinate x of axis a is kept as round(s (x - low[a])) with one s for all axes, so that distances keep
/// their proportions. A byte is off by at most 1/2, so a point's true distance differs from that of its bytes
/// by at most sqrt(dim) / (2 s): whoever may be nearer than the collector's limit by that much is measured
/// again, exactly. Without a budget the answers are those of a tree of floats. Euclidean distances only.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/kd_tree.hpp>

namespace cairn::inline CAIRN_ABI {

/// Const methods may run at the same time. The points must stay as they are while the tree is used.
template <class Points, std::size_t Dim = dynamic_dim>
class QuantisedTree {
public:
  using Tree = KdTree<std::uint8_t, Dim>;
  using Real = float;

  /// Throws Error for points that are not finite or of different dimensions. O(n log n).
  explicit QuantisedTree(const Points& points) : points_(&points), low_(detail::dimension_of<Dim>(points)) {
    if (points.size() == 0) return;
    const std::size_t dim = low_.size();
    detail::check_count(static_cast<std::size_t>(points.size()), "QuantisedTree: point");
    std::vector<std::uint8_t> codes(static_cast<std::size_t>(points.size()) * dim);
    learn(points);
    std::vector<float> row(dim);
    for (std::size_t i = 0; i < codes.size(); i += dim) {
      detail::copy_point<float>(points[i / dim], dim, row.data(), {"QuantisedTree: point", i / dim});
      for (std::size_t a = 0; a < dim; ++a)
        codes[i + a] = static_cast<std::uint8_t>(std::clamp(std::round(scaled(row[a], a)), 0.0F, 255.0F));
    }
    tree_ = Tree::from_rows(codes, dim);
  }
  explicit QuantisedTree(const Points&&) = delete;  ///< the points would be gone

  [[nodiscard]] std::size_t size() const noexcept { return tree_.size(); }
  [[nodiscard]] bool empty() const noexcept { return tree_.empty(); }
  [[nodiscard]] std::size_t dimension() const noexcept { return low_.size(); }
  [[nodiscard]] const Tree& codes() const noexcept { return tree_; }
  /// Memory held: the bytes and ids, not the caller's points.
  [[nodiscard]] std::size_t bytes() const noexcept { return tree_.bytes() + low_.capacity() * sizeof(float); }

  /// Searches under a budget; keep one for many searches, one a thread.
  class Search {
  public:
    /// Offers points with their exact reduced distances. Throws Error where the query is not finite or of
    /// another dimension. Returns true where the answer is exact. `measured`, where given, counts exact
    /// distances.
    template <Point Query, Collector<float> C>
    bool search(const QuantisedTree& index, const Query& query, C& collector, Budget budget = {},
                Work* work = nullptr, std::size_t* measured = nullptr) {
      if (index.empty()) return true;
      const std::size_t dim = index.dimension();
      row_.resize(dim);
      detail::copy_point<float>(query, dim, row_.data(), {"QuantisedTree: query", 0});
      scaled_.resize(dim);
      for (std::size_t a = 0; a < dim; ++a)  // moved nearer to all bytes, where at all
        scaled_[a] = std::clamp(index.scaled(row_[a], a), -1e15F, 1e15F);
      Again<C> again{&index, row_.data(), &collector};
      const Tree* const trees[] = {&index.tree_};
      const bool exact =
          search_.search(std::span<const Tree* const>(trees), scaled_.data(), again, budget, work);
      if (measured != nullptr) *measured += again.measured;
      return exact;
    }

  private:
    BestBinFirst<Tree> search_;
    std::vector<float> row_;
    std::vector<float> scaled_;
  };

private:
  /// Measures what the bytes cannot exclude.
  template <class C>
  struct Again {
    const QuantisedTree* index;
    const float* query;
    C* collector;
    std::size_t measured = 0;

    /// The collector's limit in the units of the bytes, and what rounding to bytes can hide.
    [[nodiscard]] float limit() const noexcept {
      const float distance = std::sqrt(static_cast<float>(collector->limit())) * index->scale_;
      const float reach = distance * index->rounding_ + index->slack_;
      return reach * reach;
    }
    void offer(PointId id, float reduced) {
      if (!(reduced < limit())) return;
      ++measured;
      const float exact = index->reduced_distance(query, id);
      if (exact < static_cast<float>(collector->limit())) collector->offer(id, exact);
    }
  };

  void learn(const Points& points) {
    const std::size_t dim = low_.size();
    std::vector<float> row(dim);
    std::vector<float> high(dim, -std::numeric_limits<float>::infinity());
    std::fill(low_.begin(), low_.end(), std::numeric_limits<float>::infinity());
    for (std::size_t i = 0; i < static_cast<std::size_t>(points.size()); ++i) {
      detail::copy_point<float>(points[i], dim, row.data(), {"QuantisedTree: point", i});
      for (std::size_t a = 0; a < dim; ++a) {
        low_[a] = std::min(low_[a], row[a]);
        high[a] = std::max(high[a], row[a]);
      }
    }
    float range = 0;
    for (std::size_t a = 0; a < dim; ++a) range = std::max(range, high[a] - low_[a]);
    scale_ = range > 1e-18F ? 255 / range : 1;  // nearer points are all zeros, and measured
    slack_ = 0.501F * std::sqrt(static_cast<float>(dim)) + 1e-3F;
    rounding_ = 1.0001F + static_cast<float>(dim) * std::numeric_limits<float>::epsilon();
  }

  [[nodiscard]] float scaled(float number, std::size_t axis) const noexcept {
    return (number - low_[axis]) * scale_;
  }

  [[nodiscard]] float reduced_distance(const float* query, PointId id) const {
    const auto& point = (*points_)[id];
    float sum = 0;
    for (std::size_t a = 0; a < dimension(); ++a)
      L2::accumulate(sum, query[a] - detail::coordinate<float>(point, a), a);
    return sum;
  }

  const Points* points_;
  std::vector<float> low_;
  float scale_ = 1;
  float slack_ = 0;     ///< how far a byte point may be from its point, in bytes
  float rounding_ = 1;  ///< covers the rounding of sums
  Tree tree_;
};

}  // namespace cairn::inline CAIRN_ABI
