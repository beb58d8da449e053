// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A static balanced kd-tree, built once, that owns its points in leaf order.
///
/// ```cpp
/// const cairn::KdTree<float, 3> tree(points);  // any PointSet; KdTree tree(points) keeps its numbers
/// if (const auto hit = tree.nearest(query)) use(hit->id, hit->distance);
/// for (const auto& [id, distance] : tree.nearest(query, 10)) use(id, distance);
/// for (const auto& [id, distance] : tree.within(query, 0.5F)) use(id, distance);
/// tree.search(query, my_collector);
/// tree.search(query, my_collector, {.budget = {.leaves = 24}});  // not more than 24 leaves
/// ```
///
/// Up to eight dimensions exact search runs over nodes of sixteen boxes (box_tree.hpp); above, over single
/// splits with the distance to the cell kept up to date (Arya and Mount, "Algorithms for fast vector
/// quantization", DCC 1993); for a budget instead of exactness see best_bin_first.hpp. Ids are the positions
/// of the points in the set, or the caller's own: different numbers, not no_point. Depth is ceil(log2(n /
/// 16)) whatever the points. Const methods may run at the same time. Searching allocates nothing up to 160
/// dimensions.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/answers.hpp>
#include <cairn/index/detail/box_tree.hpp>
#include <cairn/index/detail/kd_builder.hpp>
#include <cairn/index/detail/kd_layout.hpp>
#include <cairn/index/detail/leaf_blocks.hpp>
#include <cairn/index/detail/point_ids.hpp>
#include <cairn/index/detail/tree_access.hpp>
#include <cairn/index/metric.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// How a tree is built. The tree is the same for any number of threads (0 counts as 1).
struct BuildOptions {
  unsigned threads = 1;
};

/// Scalar: float or double coordinates, or whole numbers of up to four bytes. Dim: number of coordinates, or
/// dynamic_dim. Distances are float; double for coordinates that are double or whole numbers of four bytes.
template <class Scalar = float, std::size_t Dim = dynamic_dim, class M = L2>
class KdTree {
public:
  using Real = detail::RealOf<Scalar>;
  using Hit = Neighbor<Real>;
  using Coordinate = Scalar;
  using Measure = M;
  using Scratch = BestBinFirst<KdTree>;  ///< what a search under a budget needs
  static constexpr std::size_t fixed_dimension = Dim;
  static_assert(detail::is_coordinate<Scalar>,
                "coordinates are kept as float, double or whole numbers of up to four bytes");
  static_assert(Metric<M, Real>, "the third argument of KdTree must satisfy cairn::Metric");

  /// A tree of nothing: every search comes back empty.
  KdTree() = default;

  /// Builds from a set of points, ids 0 ... n - 1. Throws Error, naming the point, for a coordinate that is
  /// not finite (or so large that squares overflow; or, for whole Scalars, none of theirs) and for points of
  /// different dimensions. O(n log n).
  template <class Points>
    requires(PointSet<Points> || detail::explain_points<Points>)
  explicit KdTree(const Points& points, M metric = {}, BuildOptions options = {})
      : KdTree(detail::copy_points<Scalar>(points, detail::dimension_of<Dim>(points), "KdTree: point"), {},
               detail::dimension_of<Dim>(points), std::move(metric), options.threads) {}

  /// The same with the caller's ids, one a point, all different, none of them no_point.
  template <PointSet Points>
  KdTree(const Points& points, std::span<const PointId> ids, M metric = {}, BuildOptions options = {})
      : KdTree(detail::copy_points<Scalar>(points, detail::dimension_of<Dim>(points), "KdTree: point"),
               checked(ids, static_cast<std::size_t>(points.size())), detail::dimension_of<Dim>(points),
               std::move(metric), options.threads) {}

  /// The same from rows of `dim` numbers that are known to be usable; ids, known to be so, as above, or empty
  /// for 0 ... n - 1.
  [[nodiscard]] static KdTree from_rows(std::vector<Scalar> rows, std::size_t dim,
                                        std::span<const PointId> ids = {}, M metric = {},
                                        BuildOptions options = {}) {
    CAIRN_EXPECTS(Dim == dynamic_dim || dim == Dim, "KdTree::from_rows: the dimension is fixed by the type");
    CAIRN_EXPECTS(rows.empty() || (dim > 0 && rows.size() % dim == 0),
                  "KdTree::from_rows: the numbers must be whole rows");
    CAIRN_EXPECTS(ids.empty() || ids.size() == rows.size() / dim, "KdTree: there must be one id a point");
    return KdTree(std::move(rows), ids, dim, std::move(metric), options.threads);
  }

  [[nodiscard]] std::size_t size() const noexcept { return parts_.layout->points(); }
  [[nodiscard]] bool empty() const noexcept { return size() == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return Dim != dynamic_dim ? Dim : dim_; }
  [[nodiscard]] std::size_t leaves() const noexcept { return parts_.layout->leaves(); }
  [[nodiscard]] unsigned depth() const noexcept { return parts_.layout->depth(); }
  [[nodiscard]] const M& metric() const noexcept { return metric_; }
  /// Memory held, the points included.
  [[nodiscard]] std::size_t bytes() const noexcept {
    return parts_.blocks.bytes() + parts_.boxes.bytes() +
           parts_.splits.capacity() * sizeof(detail::Split<Scalar>);
  }

  /// The nearest point; nothing where the tree is empty.
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

  /// The k nearest points, nearest first; all of them where there are fewer. O(k) for each point kept.
  template <QueryPoint Query>
  [[nodiscard]] std::vector<Hit> nearest(const Query& query, std::size_t k) const {
    std::vector<Hit> found(std::min(k, size()));
    found.resize(nearest(query, std::span<Hit>(found)));
    return found;
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

  /// Shows a collector every point nearer than its limit (and perhaps others), near ones early. Adds to
  /// `work` what was done. Throws Error where a coordinate of the query is not finite. Returns true: nothing
  /// is left out.
  template <QueryPoint Query, Collector<Real> C>
  bool search(const Query& query, C& collector, Work* work = nullptr) const {
    detail::check_collector<C, M>();
    if (empty()) return true;
    detail::Scratch<Real> row(dimension());
    detail::copy_point<Real>(query, dimension(), row.data(), {"KdTree: query", 0});
    detail::wrap_row(metric_, dimension(), row.data());
    Work done;
    search_row(row.data(), collector, done);
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

  /// Calls visit(id, std::span<const Scalar>) for every point, in leaf order.
  template <class Visit>
  void for_each(Visit&& visit) const {
    parts_.blocks.for_each({0, leaves()}, visit);
  }

private:
  friend struct detail::TreeAccess;

  /// The caller's ids, one for each of `count` points.
  static std::span<const PointId> checked(std::span<const PointId> ids, std::size_t count) {
    CAIRN_EXPECTS(ids.size() == count, "KdTree: there must be one id a point");
    CAIRN_EXPECTS(!detail::bad_id(ids), "KdTree: an id can be given only once, and no_point is none");
    return ids;
  }

  KdTree(std::vector<Scalar> rows, std::span<const PointId> ids, std::size_t dim, M metric, unsigned threads);

  [[nodiscard]] bool use_boxes() const noexcept { return dimension() <= detail::few_axes; }

  /// Exact search for checked numbers.
  template <class C>
  void search_row(const Real* row, C& collector, Work& work) const;
  template <class C>
  void search_boxes(const Real* row, C& collector, Work& work) const {
    detail::with_widest_lanes([&]() CAIRN_INLINED {
      parts_.boxes.search(parts_.blocks, row, dimension(), metric_, collector, work);
    });
  }

  template <class C>
  void scan_leaf(std::size_t leaf, const Real* query, C& collector, Work& work) const {
    ++work.leaves;
    work.distances += detail::block_size;
    detail::with_widest_lanes(
        [&]() CAIRN_INLINED { parts_.blocks.scan(leaf, query, dimension(), metric_, collector); });
  }

  /// Depth first over single splits; `offsets` holds the distance to the current cell along each axis.
  template <class C>
  void search_splits(const Real* query, C& collector, Work& work) const {
    detail::Scratch<Real> offsets(dimension());
    std::fill_n(offsets.data(), dimension(), Real{0});
    descend(0, 0, Real{0}, query, offsets.data(), collector, work);
  }

  template <class C>
  void descend(unsigned depth, std::size_t slot, Real bound, const Real* query, Real* offsets, C& collector,
               Work& work) const {
    const detail::Range leaves = parts_.layout->leaves_below(depth, slot);
    if (leaves.size() == 1) return scan_leaf(leaves.begin, query, collector, work);
    ++work.nodes;
    const detail::Split<Scalar>& here = parts_.splits[detail::KdLayout::split_at(depth, slot)];
    const Real offset = query[here.axis] - static_cast<Real>(here.value);
    const std::size_t near = 2 * slot + (offset < 0 ? 0 : 1);
    descend(depth + 1, near, bound, query, offsets, collector, work);
    const Real old = offsets[here.axis];
    const Real across =
        detail::offset_across(metric_, query[here.axis], static_cast<Real>(here.value), here.axis);
    const Real far_bound = detail::moved_bound(metric_, bound, old, across, here.axis);
    if (!(far_bound < static_cast<Real>(collector.limit()))) return;
    offsets[here.axis] = across;
    descend(depth + 1, near ^ 1U, far_bound, query, offsets, collector, work);
    offsets[here.axis] = old;
  }

  [[no_unique_address]] M metric_{};
  std::size_t dim_ = 0;
  detail::KdParts<Scalar> parts_;
};

// Outside of the class, and so not inline: cairn::compiled may hold them (below).
template <class Scalar, std::size_t Dim, class M>
KdTree<Scalar, Dim, M>::KdTree(std::vector<Scalar> rows, std::span<const PointId> ids, std::size_t dim,
                               M metric, unsigned threads)
    : metric_(std::move(metric)), dim_(dim) {
  if (rows.empty()) return;
  detail::check_metric(metric_, dimension());
  if constexpr (detail::HasPeriods<M>) {
    static_assert(std::floating_point<Scalar>, "coordinates on circles must be floating point numbers");
    rows = detail::wrapped_rows(metric_, dimension(), std::move(rows));
  }
  detail::KdBuilder<Scalar, Dim> builder(dimension());
  builder.take(std::move(rows), ids, threads);
  parts_ = builder.finish(threads);
}

template <class Scalar, std::size_t Dim, class M>
template <class C>
void KdTree<Scalar, Dim, M>::search_row(const Real* row, C& collector, Work& work) const {
  constexpr bool may_be_few = Dim == dynamic_dim || Dim <= detail::few_axes;
  if constexpr (may_be_few)
    if (Dim != dynamic_dim || use_boxes()) return search_boxes(row, collector, work);
  if constexpr (!may_be_few || Dim == dynamic_dim) search_splits(row, collector, work);
}

namespace detail {

template <class Tree>
inline constexpr bool is_kd_tree = false;
template <class Scalar, std::size_t Dim, class M>
inline constexpr bool is_kd_tree<KdTree<Scalar, Dim, M>> = true;

}  // namespace detail

/// Without arguments in <> a tree keeps coordinates as the points have them: doubles stay doubles.
template <class Points, class M = L2>
  requires((PointSet<Points> || detail::explain_points<Points>) &&
           !std::convertible_to<M, std::span<const PointId>>)
KdTree(const Points&, M = {}, BuildOptions = {}) -> KdTree<detail::CoordinateOf<Points>, dynamic_dim, M>;
template <PointSet Points, class M = L2>
KdTree(const Points&, std::span<const PointId>, M = {}, BuildOptions = {})
    -> KdTree<detail::CoordinateOf<Points>, dynamic_dim, M>;
template <PointSet Points, std::convertible_to<std::span<const PointId>> Ids, class M = L2>
KdTree(const Points&, const Ids&, M = {}, BuildOptions = {})
    -> KdTree<detail::CoordinateOf<Points>, dynamic_dim, M>;

}}  // namespace cairn::CAIRN_ABI

// What cairn::compiled holds: trees of float and double, of two, three and any number of coordinates, and
// their exact search with each collector of the library. It is what compiles longest; the rest is inlined
// anyway.
#ifdef CAIRN_INSTANCE

namespace cairn { inline namespace CAIRN_ABI {

#define CAIRN_SEARCHES_OF_KD_TREE(Scalar, Dim, ...) \
  CAIRN_INSTANCE void KdTree<Scalar, Dim>::search_row(const Scalar*, __VA_ARGS__&, Work&) const;
#define CAIRN_KD_TREE(Scalar, Dim)                                                                           \
  CAIRN_INSTANCE KdTree<Scalar, Dim>::KdTree(std::vector<Scalar>, std::span<const PointId>, std::size_t, L2, \
                                             unsigned);                                                      \
  CAIRN_SEARCHES_OF_KD_TREE(Scalar, Dim, Nearest<Scalar>)                                                    \
  CAIRN_SEARCHES_OF_KD_TREE(Scalar, Dim, KNearest<Scalar>)                                                   \
  CAIRN_SEARCHES_OF_KD_TREE(Scalar, Dim, Within<Scalar>)

CAIRN_KD_TREE(float, dynamic_dim)
CAIRN_KD_TREE(float, 2)
CAIRN_KD_TREE(float, 3)
CAIRN_KD_TREE(double, dynamic_dim)
CAIRN_KD_TREE(double, 2)
CAIRN_KD_TREE(double, 3)

#undef CAIRN_KD_TREE
#undef CAIRN_SEARCHES_OF_KD_TREE

}}  // namespace cairn::CAIRN_ABI

#endif
