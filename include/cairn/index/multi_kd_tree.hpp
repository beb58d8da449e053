// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A kd-tree that grows: a few static trees of geometrically growing size (the logarithmic method of Bentley
/// and Saxe, "Decomposable searching problems I", J. Algorithms 1, 1980), with the thesis's rule.
///
///   tree i holds at most n1 q^(i-1) points, and is empty or holds more than tree i - 1 may hold
///
/// New points go into tree 1; a tree that would exceed its maximum is poured into the next. With m insertions
/// and s queries a step that costs O(m q p log n) amortised, p <= log_q(n / n1) + 2 trees, against O(n log n)
/// for rebuilding one tree; a query costs less than p searches, since all trees share one bound. Erased
/// points are marked, and dropped at the next merge, or when half of all are dead.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/kd_tree.hpp>

namespace cairn::inline CAIRN_ABI {

/// Sizes of the trees: the first holds up to first_size (n1), each further one `growth` (q) times more.
struct MultiTreeShape {
  std::size_t first_size = 4096;
  std::size_t growth = 2;
};

/// Arguments as KdTree. Ids stay valid until erased, and are never given twice. Const methods may run at the
/// same time.
template <class Scalar = float, std::size_t Dim = dynamic_dim, class M = L2>
class MultiKdTree {
public:
  using Tree = KdTree<Scalar, Dim, M>;
  using Real = typename Tree::Real;
  using Hit = typename Tree::Hit;

  /// An empty index; with dynamic_dim the first point inserted fixes the dimension.
  explicit MultiKdTree(MultiTreeShape shape = {}, M metric = {}) : shape_(shape), metric_(std::move(metric)) {
    CAIRN_EXPECTS(shape.first_size >= 1, "MultiKdTree: the first tree must have room for a point");
    CAIRN_EXPECTS(shape.growth >= 2, "MultiKdTree: trees must grow by a factor of at least 2");
  }

  /// Points that are stored and not erased.
  [[nodiscard]] std::size_t size() const noexcept { return live_; }
  [[nodiscard]] bool empty() const noexcept { return size() == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return Dim != dynamic_dim ? Dim : dim_; }
  [[nodiscard]] const M& metric() const noexcept { return metric_; }
  [[nodiscard]] const MultiTreeShape& shape() const noexcept { return shape_; }
  /// The trees, smallest first; some may be empty.
  [[nodiscard]] std::span<const Tree> trees() const noexcept { return trees_; }
  /// Points written into trees so far, by insertions and merges: the work of updating.
  [[nodiscard]] std::uint64_t points_moved() const noexcept { return points_moved_; }
  [[nodiscard]] bool contains(PointId id) const noexcept { return id < state_.size() && state_[id] == live; }

  /// Largest size of tree i (the first is 0); the largest number for trees that nothing can overflow.
  [[nodiscard]] std::size_t capacity(std::size_t i) const noexcept {
    std::size_t capacity = shape_.first_size;
    for (; i > 0; --i) {
      if (capacity > std::numeric_limits<std::size_t>::max() / shape_.growth)
        return std::numeric_limits<std::size_t>::max();
      capacity *= shape_.growth;
    }
    return capacity;
  }

  /// Adds points under new consecutive ids; returns the first. Throws as KdTree does, leaving the index as it
  /// was.
  template <PointSet Points>
  PointId insert(const Points& points) {
    std::vector<PointId> ids(static_cast<std::size_t>(points.size()));
    const auto first = static_cast<PointId>(state_.size());
    for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = first + static_cast<PointId>(i);
    insert(points, ids);
    return first;
  }

  /// Adds points under the caller's ids. An id must not have been used before (also not erased).
  template <PointSet Points>
  void insert(const Points& points, std::span<const PointId> ids) {
    CAIRN_EXPECTS(ids.size() == points.size(), "MultiKdTree::insert: there must be one id a point");
    if (ids.empty()) return;
    const std::size_t dim = dimension() != 0 ? dimension() : detail::dimension_of<Dim>(points);
    std::vector<Scalar> rows = detail::copy_points<Scalar>(points, dim, "MultiKdTree: point");
    Entering marks(state_, ids);
    pour(std::move(rows), {ids.begin(), ids.end()}, dim);
    marks.commit();
    live_ += ids.size();
  }

  /// Forgets a point; false where there is none of that id. O(1), and O(n log n) each time half are dead.
  bool erase(PointId id) {
    if (!contains(id)) return false;
    state_[id] = erased;
    --live_;
    if (2 * live_ < stored_) rebuild();
    return true;
  }

  /// Drops what is erased and puts all points into one tree.
  void rebuild() {
    std::vector<Scalar> rows;
    std::vector<PointId> ids;
    for (const Tree& tree : trees_) take_live(tree, rows, ids);
    place(rows, ids, dimension(), trees_.size());
  }

  template <Point Query>
  [[nodiscard]] std::optional<Hit> nearest(const Query& query) const {
    Nearest<Real> collector;
    search(query, collector);
    if (collector.id() == no_point) return std::nullopt;
    return Hit{collector.id(), metric_.restore(collector.reduced())};
  }

  /// The k nearest points, nearest first; all of them where there are fewer.
  template <Point Query>
  [[nodiscard]] std::vector<Hit> nearest(const Query& query, std::size_t k) const {
    std::vector<Hit> found(std::min(k, size()));
    if (found.empty()) return found;
    KNearest<Real> collector(found.data(), found.size());
    search(query, collector);
    collector.restore(metric_);
    return found;
  }

  /// All points at most `radius` away, nearest first. radius >= 0.
  template <Point Query>
  [[nodiscard]] std::vector<Hit> within(const Query& query, Real radius) const {
    CAIRN_EXPECTS(radius >= 0, "MultiKdTree::within: a radius is not negative");
    std::vector<Hit> found;
    Within<Real> collector(found, metric_.reduce(radius));
    search(query, collector);
    for (Hit& hit : found) hit.distance = metric_.restore(hit.distance);
    std::sort(found.begin(), found.end(), nearer<Real>);
    return found;
  }

  /// Exact search through all trees, the largest first, with one collector and so one bound.
  template <Point Query, Collector<Real> C>
  void search(const Query& query, C& collector, Work* work = nullptr) const {
    if (live_ == stored_) return search_trees(query, collector, work);
    OnlyLive<C> only_live{&state_, &collector};
    search_trees(query, only_live, work);
  }

private:
  enum State : std::uint8_t { unknown, entering, live, erased };

  /// Passes on what is not erased.
  template <class C>
  struct OnlyLive {
    const std::vector<std::uint8_t>* state;
    C* collector;
    [[nodiscard]] Real limit() const { return static_cast<Real>(collector->limit()); }
    void offer(PointId id, Real reduced) {
      if ((*state)[id] == live) collector->offer(id, reduced);
    }
  };

  template <Point Query, class C>
  void search_trees(const Query& query, C& collector, Work* work) const {
    for (std::size_t i = trees_.size(); i-- > 0;) trees_[i].search(query, collector, work);
  }

  /// Marks the ids of an insertion; takes the marks back unless the insertion went through.
  class Entering {
  public:
    Entering(std::vector<std::uint8_t>& state, std::span<const PointId> ids) : state_(state), ids_(ids) {
      const PointId last = *std::max_element(ids.begin(), ids.end());
      CAIRN_EXPECTS(last != no_point, "MultiKdTree::insert: no_point is not an id");
      if (last >= state.size()) state.resize(std::size_t{last} + 1, unknown);
      for (const PointId id : ids) {
        CAIRN_EXPECTS(state[id] == unknown, "MultiKdTree::insert: an id can be given only once");
        state[id] = entering;
      }
    }
    Entering(const Entering&) = delete;
    Entering& operator=(const Entering&) = delete;
    ~Entering() {
      for (const PointId id : ids_) state_[id] = committed_ ? live : unknown;
    }
    void commit() noexcept { committed_ = true; }

  private:
    std::vector<std::uint8_t>& state_;
    std::span<const PointId> ids_;
    bool committed_ = false;
  };

  void take_live(const Tree& tree, std::vector<Scalar>& rows, std::vector<PointId>& ids) const {
    tree.for_each([&](PointId id, std::span<const Scalar> row) {
      if (state_[id] != live) return;
      ids.push_back(id);
      rows.insert(rows.end(), row.begin(), row.end());
    });
  }

  /// Collects the trees from the first on until the next has room for all that was collected.
  void pour(std::vector<Scalar> rows, std::vector<PointId> ids, std::size_t dim) {
    std::size_t taken = 0;
    while (taken < trees_.size()) {
      take_live(trees_[taken], rows, ids);
      if (ids.size() <= capacity(taken++)) break;
    }
    place(rows, ids, dim, taken);
  }

  /// Replaces the first `taken` trees by one of these points, where the invariant wants it.
  void place(const std::vector<Scalar>& rows, const std::vector<PointId>& ids, std::size_t dim,
             std::size_t taken) {
    std::size_t level = 0;
    while (capacity(level) < ids.size()) ++level;
    Tree merged = Tree::from_rows(rows, dim, ids, metric_);
    if (trees_.size() <= level) trees_.resize(level + 1);
    for (std::size_t i = 0; i < taken; ++i) trees_[i] = Tree();
    trees_[level] = std::move(merged);
    dim_ = dim;
    points_moved_ += ids.size();
    stored_ = 0;
    for (const Tree& tree : trees_) stored_ += tree.size();
  }

  MultiTreeShape shape_;
  [[no_unique_address]] M metric_;
  std::size_t dim_ = 0;
  std::vector<Tree> trees_;
  std::vector<std::uint8_t> state_;
  std::size_t stored_ = 0;
  std::size_t live_ = 0;
  std::uint64_t points_moved_ = 0;
};

}  // namespace cairn::inline CAIRN_ABI
