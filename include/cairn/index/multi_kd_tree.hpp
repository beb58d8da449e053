// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A kd-tree that grows: a few static trees of geometrically growing size (the logarithmic method of Bentley
/// and Saxe, "Decomposable searching problems I", J. Algorithms 1, 1980), with one rule for all levels:
///
///   tree i holds at most n1 q^(i-1) points, and is empty or holds more than tree i - 1 may hold
///
/// New points go into tree 1; a tree that would exceed its maximum is poured into the next. With m insertions
/// and s queries a step that costs O(m q p log n) amortised, p <= log_q(n / n1) + 2 trees, against O(n log n)
/// for rebuilding one tree; a query costs less than p searches, since all trees share one bound. Erased
/// points are marked, and dropped at the next merge, or when half of all are dead. The binary counter is to
/// be had as well, and merging that takes no step long (multi_tree_shape.hpp).
///
/// ```cpp
/// cairn::MultiKdTree<float, 3> map;
/// const cairn::PointId first = map.insert(points);           // numbered first, first + 1, ...
/// map.erase(first);                                          // found by nothing from here on
/// const auto hits = map.nearest(query, 10);                  // within(query, radius): as of a KdTree
/// decltype(map)::Scratch scratch;                            // under a budget; keep one for many searches
/// map.search(query, collector, {.budget = {.leaves = 24}}, scratch);
/// for (const cairn::PointId id : cairn::inside(map, low, high)) use(id);  // and NearestFirst(map, query)
/// ```
///
/// Const methods may run at the same time, on any threads, also while a merge is under way in the background;
/// not during a call of insert, erase, rebuild or finish_merges. To go on answering during those, answer from
/// a copy: copies share the trees, so making one takes a byte a point.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/index/detail/answers.hpp>
#include <cairn/index/detail/forest_queries.hpp>
#include <cairn/index/detail/lockstep_search.hpp>
#include <cairn/index/detail/logarithmic_forest.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/multi_tree_shape.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// What stands for the coordinates where nobody said their type.
struct Unsaid {};

}  // namespace detail

/// Arguments as KdTree. Ids stay valid until erased, and are never given twice. What is erased is found by no
/// search from then on.
template <class Scalar = float, std::size_t Dim = dynamic_dim, class M = L2>
class MultiKdTree {
public:
  static_assert(!std::is_same_v<Scalar, detail::Unsaid>,
                "say what coordinates are kept as: MultiKdTree<float> or MultiKdTree<double>");
  using Tree = KdTree<Scalar, Dim, M>;
  using Real = typename Tree::Real;
  using Hit = typename Tree::Hit;
  using Coordinate = Scalar;
  using Measure = M;
  using Scratch = BestBinFirst<MultiKdTree>;  ///< what a search under a budget needs
  static constexpr std::size_t fixed_dimension = Dim;

  /// An empty index; with dynamic_dim the first point inserted fixes the dimension.
  explicit MultiKdTree(MultiTreeShape shape = {}, M metric = {})
      : metric_(std::move(metric)), forest_(shape) {
    detail::check_shape(shape);
  }

  /// Points that are stored and not erased.
  [[nodiscard]] std::size_t size() const noexcept { return live_; }
  [[nodiscard]] bool empty() const noexcept { return size() == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return Dim != dynamic_dim ? Dim : dim_; }
  [[nodiscard]] const M& metric() const noexcept { return metric_; }
  [[nodiscard]] const MultiTreeShape& shape() const noexcept { return forest_.shape(); }
  /// How many points each tree holds, smallest first, none of them 0; trees that are being merged stand for
  /// the result, and erased points count until a merge drops them.
  [[nodiscard]] std::vector<std::size_t> tree_sizes() const {
    std::vector<std::size_t> sizes;
    for (const Tree* tree : forest_.trees()) sizes.push_back(tree->size());
    return sizes;
  }
  [[nodiscard]] std::size_t tree_count() const noexcept { return forest_.trees().size(); }
  /// Merges that were started and whose result is not yet in use.
  [[nodiscard]] std::size_t merges_under_way() const noexcept { return forest_.merges_under_way(); }
  /// Points written into trees so far, by insertions and merges: the work of updating.
  [[nodiscard]] std::uint64_t points_moved() const noexcept { return forest_.points_moved(); }
  [[nodiscard]] bool contains(PointId id) const noexcept {
    return id < state_.size() && state_[id] == PointState::live;
  }
  /// Memory held, the points included, without that of merges under way.
  [[nodiscard]] std::size_t bytes() const noexcept {
    std::size_t bytes = state_.capacity();
    for (const Tree* tree : forest_.trees()) bytes += tree->bytes();
    return bytes;
  }

  /// Adds points under new consecutive ids, the first of which it returns: one more than any id so far.
  /// Throws as KdTree does, leaving the index as it was.
  template <class Points>
    requires(PointSet<Points> || detail::explain_points<Points>)
  PointId insert(const Points& points) {
    const auto count = static_cast<std::size_t>(points.size());
    if (count > no_point - state_.size())
      raise("MultiKdTree::insert: " + std::to_string(count) + " points after " +
            std::to_string(state_.size()) + " ids given, at most 2^32 - 1 can be");
    std::vector<PointId> ids(count);
    const auto first = static_cast<PointId>(state_.size());
    for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = first + static_cast<PointId>(i);
    insert(points, ids);
    return first;
  }

  /// Adds points under the caller's ids, each of them new: not given before (also if erased since), not twice
  /// here, not no_point. A byte is kept for every number up to the largest id. Whatever is thrown, by a
  /// violation handler too, leaves the index as it was.
  template <PointSet Points>
  void insert(const Points& points, std::span<const PointId> ids) {
    CAIRN_EXPECTS(ids.size() == points.size(), "MultiKdTree::insert: there must be one id a point");
    if (ids.empty()) return;
    const std::size_t dim = dimension() != 0 ? dimension() : detail::dimension_of<Dim>(points);
    std::vector<Scalar> rows = detail::copy_points<Scalar>(points, dim, "MultiKdTree: point");
    Entering marks(state_, ids);
    marks.set();
    const std::uint64_t now = updates_ + ids.size();
    forest_.advance(now);
    forest_.add({std::move(rows), {ids.begin(), ids.end()}}, {dim, metric_, state_, live_, now});
    marks.commit();
    dim_ = dim;
    live_ += ids.size();
    updates_ = now;
  }

  /// Forgets a point; false where there is none of that id. Where memory runs out nothing has changed. O(1),
  /// and O(n log n) each time half are dead, or as a merge where merges are not done at once.
  bool erase(PointId id) {
    if (!contains(id)) return false;
    Leaving mark{state_[id]};
    const std::uint64_t now = updates_ + 1;
    forest_.advance(now);
    if (2 * (live_ - 1) < forest_.stored()) forest_.shrink({dimension(), metric_, state_, live_ - 1, now});
    mark.committed = true;
    --live_;
    updates_ = now;
    return true;
  }

  /// Drops what is erased and puts all points into one tree.
  void rebuild() { forest_.rebuild({dimension(), metric_, state_, live_, updates_}); }

  /// Ends all merges under way.
  void finish_merges() { forest_.finish_merges(); }

  /// The nearest point; nothing where there is none.
  template <QueryPoint Query>
  [[nodiscard]] std::optional<Hit> nearest(const Query& query) const {
    return detail::nearest_of<Real>(metric_, [&](auto& collector) { search(query, collector); });
  }
  /// The nearest of those that a search under a budget meets.
  template <QueryPoint Query>
  [[nodiscard]] std::optional<Hit> nearest(const Query& query, Budget budget) const {
    return detail::nearest_of<Real>(metric_,
                                    [&](auto& collector) { search(query, collector, {.budget = budget}); });
  }

  /// The k nearest points, nearest first; all of them where there are fewer.
  template <QueryPoint Query>
  [[nodiscard]] std::vector<Hit> nearest(const Query& query, std::size_t k) const {
    return detail::k_nearest_of<Real>(k, size(), metric_, [&](auto& collector) { search(query, collector); });
  }
  template <QueryPoint Query>
  [[nodiscard]] std::vector<Hit> nearest(const Query& query, std::size_t k, Budget budget) const {
    return detail::k_nearest_of<Real>(k, size(), metric_,
                                      [&](auto& collector) { search(query, collector, {.budget = budget}); });
  }
  template <QueryPoint Query>
  void nearest(const Query&, std::floating_point auto) const = delete;  ///< a radius? within(query, radius)

  /// Writes the nearest points, nearest first, as many as `found` has room for; returns how many.
  template <QueryPoint Query>
  std::size_t nearest(const Query& query, std::span<Hit> found) const {
    return detail::nearest_into(found, metric_, [&](auto& collector) { search(query, collector); });
  }

  /// All points at most `radius` away, nearest first. Throws Error where that is negative or NaN.
  template <QueryPoint Query>
  [[nodiscard]] std::vector<Hit> within(const Query& query, Real radius) const {
    return detail::all_within(radius, metric_, [&](auto& collector) { search(query, collector); });
  }

  /// Exact search through all trees, the largest first, with one collector and so one bound. Returns true:
  /// nothing is left out.
  template <QueryPoint Query, Collector<Real> C>
  bool search(const Query& query, C& collector, Work* work = nullptr) const {
    detail::check_collector<C, M>();
    if (forest_.trees().empty()) return true;
    detail::Scratch<Real> row(dimension());
    detail::copy_point<Real>(query, dimension(), row.data(), {"MultiKdTree: query", 0});
    detail::wrap_row(metric_, dimension(), row.data());
    Work done;
    auto only_live = detail::ForestAccess::only_live(*this, collector);
    search_row(row.data(), only_live, done);
    if (work != nullptr) *work += done;
    return true;
  }

  /// The same where there is no budget; under one as BestBinFirst, whose queue `scratch` keeps from search to
  /// search. Returns true where nothing nearer was left out.
  template <QueryPoint Query, Collector<Real> C>
  bool search(const Query& query, C& collector, const SearchOptions& options, Scratch& scratch) const {
    if (options.budget.unlimited()) return search(query, collector, options.work);
    return scratch.search(*this, query, collector, options.budget, options.work);
  }
  template <QueryPoint Query, Collector<Real> C>
  bool search(const Query& query, C& collector, const SearchOptions& options) const {
    Scratch scratch;
    return search(query, collector, options, scratch);
  }

  /// Calls visit(id, std::span<const Scalar>) for every point that is not erased, tree by tree.
  template <class Visit>
  void for_each(Visit&& visit) const {
    for (const Tree* tree : forest_.trees())
      tree->for_each([&](PointId id, std::span<const Scalar> row) {
        if (contains(id)) visit(id, row);
      });
  }

private:
  using PointState = detail::PointState;
  static_assert(sizeof(PointState) == 1);
  friend struct detail::ForestAccess;

  /// Exact search for checked numbers.
  template <class C>
  void search_row(const Real* row, C& collector, Work& work) const {
    const std::span<const Tree* const> trees = forest_.trees();
    constexpr bool may_be_few = Dim == dynamic_dim || Dim <= detail::few_axes;
    if constexpr (may_be_few)
      if (Dim != dynamic_dim || dimension() <= detail::few_axes)
        return detail::search_in_step(trees, row, collector, work);
    if constexpr (!may_be_few || Dim == dynamic_dim)
      for (std::size_t i = trees.size(); i-- > 0;)
        detail::TreeAccess::search_row(*trees[i], row, collector, work);
  }

  /// Marks the ids of an insertion; takes the marks back unless the insertion went through. The checks stand
  /// in a call of their own: where a violation handler throws, the marks set so far must have an owner.
  class Entering {
  public:
    Entering(std::vector<PointState>& state, std::span<const PointId> ids) noexcept
        : state_(state), ids_(ids), old_size_(state.size()) {}
    Entering(const Entering&) = delete;
    Entering& operator=(const Entering&) = delete;
    ~Entering() {
      for (const PointId id : ids_.first(marked_))
        state_[id] = committed_ ? PointState::live : PointState::unknown;
      if (!committed_) state_.resize(old_size_);  // so that the next insertion gets the same ids
    }

    void set() {
      const PointId last = *std::max_element(ids_.begin(), ids_.end());
      CAIRN_EXPECTS(last != no_point, "MultiKdTree::insert: no_point is not an id");
      if (last >= state_.size()) state_.resize(std::size_t{last} + 1, PointState::unknown);
      for (const PointId id : ids_) {
        CAIRN_EXPECTS(state_[id] == PointState::unknown, "MultiKdTree::insert: an id can be given only once");
        state_[id] = PointState::entering;
        ++marked_;
      }
    }
    void commit() noexcept { committed_ = true; }

  private:
    std::vector<PointState>& state_;
    std::span<const PointId> ids_;
    std::size_t old_size_;
    std::size_t marked_ = 0;
    bool committed_ = false;
  };

  /// Marks a point as erased; takes the mark back unless the erasure went through.
  struct Leaving {
    explicit Leaving(PointState& of) noexcept : state(of) { state = PointState::erased; }
    Leaving(const Leaving&) = delete;
    Leaving& operator=(const Leaving&) = delete;
    ~Leaving() {
      if (!committed) state = PointState::live;
    }
    PointState& state;
    bool committed = false;
  };

  [[no_unique_address]] M metric_;
  ResetOnMove<std::size_t> dim_;
  detail::LogarithmicForest<Tree> forest_;
  std::vector<PointState> state_;
  ResetOnMove<std::size_t> live_;
  ResetOnMove<std::uint64_t> updates_;  ///< points inserted and erased so far
};

/// Coordinates that nobody named would be rounded to some type's.
MultiKdTree(MultiTreeShape = {}) -> MultiKdTree<detail::Unsaid>;

}}  // namespace cairn::CAIRN_ABI

// What cairn::compiled holds: what merges and what searches the trees that it holds (kd_tree.hpp).
#ifdef CAIRN_INSTANCE

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

#define CAIRN_SEARCH_IN_STEP(Scalar, Dim, ...)                                                   \
  CAIRN_INSTANCE void search_in_step(std::span<const KdTree<Scalar, Dim>* const>, const Scalar*, \
                                     OnlyLive<Scalar, __VA_ARGS__>&, Work&);
#define CAIRN_MULTI_KD_TREE(Scalar, Dim)                                                            \
  CAIRN_INSTANCE void LogarithmicForest<KdTree<Scalar, Dim>>::add(NewPoints<Scalar>, const Facts&); \
  CAIRN_INSTANCE void LogarithmicForest<KdTree<Scalar, Dim>>::advance(std::uint64_t);               \
  CAIRN_INSTANCE void LogarithmicForest<KdTree<Scalar, Dim>>::shrink(const Facts&);                 \
  CAIRN_INSTANCE void LogarithmicForest<KdTree<Scalar, Dim>>::rebuild(const Facts&);                \
  CAIRN_INSTANCE void LogarithmicForest<KdTree<Scalar, Dim>>::finish_merges();                      \
  CAIRN_SEARCH_IN_STEP(Scalar, Dim, Nearest<Scalar>)                                                \
  CAIRN_SEARCH_IN_STEP(Scalar, Dim, KNearest<Scalar>)                                               \
  CAIRN_SEARCH_IN_STEP(Scalar, Dim, Within<Scalar>)

CAIRN_MULTI_KD_TREE(float, dynamic_dim)
CAIRN_MULTI_KD_TREE(float, 2)
CAIRN_MULTI_KD_TREE(float, 3)
CAIRN_MULTI_KD_TREE(double, dynamic_dim)
CAIRN_MULTI_KD_TREE(double, 2)
CAIRN_MULTI_KD_TREE(double, 3)

#undef CAIRN_MULTI_KD_TREE
#undef CAIRN_SEARCH_IN_STEP

}}}  // namespace cairn::CAIRN_ABI::detail

#endif
