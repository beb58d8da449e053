// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Several kd-trees of the same descriptors, each along axes of its own, searched with one queue and one
/// budget (Silpa-Anan and Hartley, "Optimised KD-trees for fast image descriptor matching", CVPR 2008).
///
/// ```cpp
/// const cairn::KdForest<64> forest(descriptors, {.trees = 2});
/// cairn::KdForest<64>::Scratch scratch;  // one a thread
/// cairn::NearestTwo<float> two;
/// forest.search(query, two, {.budget = {.leaves = 64}}, scratch);
/// ```
///
/// The first tree splits along the principal axes; the others turn the foremost of them by random rotations,
/// so that a point that one tree hides behind a split is in front in another. Each tree holds all points:
/// memory and build grow with their number, a search's work does not. Where it pays, and where it does not:
/// docs/descriptors.md.
///
/// Turned coordinates are rounded, which moves a point by up to a known length. Therefore points are turned
/// about their mean, trees are searched that much farther than the collector's limit, and whoever is met
/// there is measured by the coordinates given as floats, as BruteForce<float> does: doubles, which
/// descriptors need not be, are rounded. The rounding of a rotation is bounded in Higham, "Accuracy and
/// stability of numerical algorithms", 2nd ed., section 3.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/index/best_bin_first.hpp>
#include <cairn/index/detail/answers.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/principal_axes.hpp>

namespace cairn { inline namespace CAIRN_ABI {

struct KdForestOptions {
  std::size_t trees = 4;
  std::size_t turned_axes = 24;  ///< how many principal axes the further trees mix; at most the dimension
  std::uint64_t seed = 1;        ///< the same seed gives the same forest
};

namespace detail {
struct KdForestAccess;
}  // namespace detail

/// Const methods may run at the same time.
template <std::size_t Dim = dynamic_dim>
class KdForest {
public:
  using Real = float;
  using Hit = Neighbor<float>;
  using Coordinate = float;
  using Measure = L2;
  using Scratch = BestBinFirst<KdForest>;  ///< what a search needs
  static constexpr std::size_t fixed_dimension = Dim;

  KdForest() = default;

  /// Throws Error for points that are not finite or of different dimensions.
  template <class Points>
    requires(PointSet<Points> || detail::explain_points<Points>)
  explicit KdForest(const Points& points, const KdForestOptions& options = {}) {
    CAIRN_EXPECTS(options.trees >= 1, "KdForest: there must be a tree");
    if (points.size() == 0) return;
    const std::size_t dim = detail::dimension_of<Dim>(points);
    rows_ = detail::copy_points<float>(points, dim, "KdForest: point");
    axes_.emplace_back(Rows<float>(rows_, dim));
    std::vector<float> turned(rows_.size());
    for (std::size_t i = 0; i < rows_.size(); i += dim) {
      axes_.front().turn_about_mean(&rows_[i], &turned[i]);
      radius_ = std::max(radius_, distance_from_mean(&rows_[i]));
    }
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
  [[nodiscard]] L2 metric() const noexcept { return {}; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    std::size_t sum = rows_.capacity() * sizeof(float);
    for (const Tree& tree : trees_) sum += tree.bytes();
    return sum;
  }

  /// The nearest point, of all or of those that a search under a budget meets.
  template <QueryPoint Query>
  [[nodiscard]] std::optional<Hit> nearest(const Query& query, Budget budget = {}) const {
    return detail::nearest_of<float>(L2{},
                                     [&](auto& collector) { search(query, collector, {.budget = budget}); });
  }
  /// The k nearest, nearest first.
  template <QueryPoint Query>
  [[nodiscard]] std::vector<Hit> nearest(const Query& query, std::size_t k, Budget budget = {}) const {
    return detail::k_nearest_of<float>(
        k, size(), L2{}, [&](auto& collector) { search(query, collector, {.budget = budget}); });
  }
  template <QueryPoint Query>
  void nearest(const Query&, std::floating_point auto) const = delete;  ///< a radius? within(query, radius)
  /// Writes the nearest points, nearest first, as many as `found` has room for; returns how many.
  template <QueryPoint Query>
  std::size_t nearest(const Query& query, std::span<Hit> found) const {
    return detail::nearest_into(found, L2{}, [&](auto& collector) { search(query, collector); });
  }
  /// All points at most `radius` away, nearest first. Throws Error where that is negative or NaN.
  template <QueryPoint Query>
  [[nodiscard]] std::vector<Hit> within(const Query& query, float radius) const {
    return detail::all_within(radius, L2{}, [&](auto& collector) { search(query, collector); });
  }

  /// As BestBinFirst; `scratch` keeps memory from search to search. Returns true where nothing nearer was
  /// left out.
  template <QueryPoint Query, Collector<float> C>
  bool search(const Query& query, C& collector, const SearchOptions& options, Scratch& scratch) const {
    return scratch.search(*this, query, collector, options.budget, options.work);
  }
  template <QueryPoint Query, Collector<float> C>
  bool search(const Query& query, C& collector, const SearchOptions& options = {}) const {
    Scratch scratch;
    return search(query, collector, options, scratch);
  }

  /// Calls visit(id, std::span<const float>) for every point, in the order of the set.
  template <class Visit>
  void for_each(Visit&& visit) const {
    const std::size_t dim = dimension();
    for (std::size_t i = 0; i < size(); ++i)
      visit(static_cast<PointId>(i), std::span<const float>(rows_.data() + i * dim, dim));
  }

private:
  friend struct detail::KdForestAccess;
  using Tree = KdTree<float, Dim>;

  /// Writes the query (dimension() numbers) as each tree sees it, one after the other.
  void turn(const float* query, float* turned) const noexcept {
    const std::size_t dim = dimension();
    axes_.front().turn_about_mean(query, turned);
    for (std::size_t t = 1; t < trees_.size(); ++t) mix(t, turned, turned + t * dim, dim);
  }
  /// How far the distance of a turned query from any turned point may be from that of the two as given.
  [[nodiscard]] float rounding(const float* query) const noexcept {
    // A product with a rotation of n axes moves a vector by at most (n + 1) sqrt(n) roundings of its length.
    const auto share_of_length = [](std::size_t axes) {
      const auto n = static_cast<float>(axes);
      return (n + 1) * std::sqrt(n) * std::numeric_limits<float>::epsilon() / 2;
    };
    const float share =
        share_of_length(dimension()) + share_of_length(mixed_) + 2 * std::numeric_limits<float>::epsilon();
    return 1.01F * share * (radius_ + distance_from_mean(query));
  }
  /// The square of a query's distance from a point, by the coordinates given. Never inlined: within the scan
  /// of a leaf, compiled for wider registers, products would be fused for some collectors and not for others.
  [[nodiscard, gnu::noinline]] float reduced_distance(const float* query, PointId id) const noexcept {
    const std::size_t dim = dimension();
    const float* point = rows_.data() + std::size_t{id} * dim;
    float sum = 0;
    for (std::size_t a = 0; a < dim; ++a) L2::accumulate(sum, query[a] - point[a], a);
    return sum;
  }

  [[nodiscard]] float distance_from_mean(const float* point) const noexcept {
    const std::span<const float> mean = axes_.front().mean();
    float sum = 0;
    for (std::size_t a = 0; a < mean.size(); ++a) L2::accumulate(sum, point[a] - mean[a], a);
    return std::sqrt(sum);
  }

  /// Row by row an orthonormal basis from normal draws (Gram-Schmidt, twice for accuracy).
  [[nodiscard]] std::vector<float> random_rotation(Random& random) const {
    std::vector<double> rows(detail::room_for(mixed_, mixed_, "KdForest"));
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

  std::vector<float> rows_;          ///< the points as given
  std::vector<PrincipalAxes> axes_;  ///< one, or none while there are no points
  float radius_ = 0;                 ///< how far a point is from the mean at most
  std::size_t mixed_ = 0;
  std::vector<std::vector<float>> rotations_;
  std::vector<Tree> trees_;
};

namespace detail {

struct KdForestAccess {
  template <class Forest>
  using TreeOf = typename Forest::Tree;
  template <class Forest>
  [[nodiscard]] static auto trees(const Forest& forest) noexcept {
    return std::span<const TreeOf<Forest>>(forest.trees_);
  }
  template <class Forest>
  static void turn(const Forest& forest, const float* query, float* turned) noexcept {
    forest.turn(query, turned);
  }
  template <class Forest>
  [[nodiscard]] static float rounding(const Forest& forest, const float* query) noexcept {
    return forest.rounding(query);
  }
  template <class Forest>
  [[nodiscard]] static float reduced_distance(const Forest& forest, const float* query, PointId id) noexcept {
    return forest.reduced_distance(query, id);
  }
};

/// Which points a search has met: a number a point, so that nothing is cleared between searches.
class MetBefore {
public:
  void start(std::size_t points) {
    if (stamps_.size() != points || now_ == std::numeric_limits<std::uint32_t>::max()) {
      stamps_.assign(points, 0);
      now_ = 0;
    }
    ++now_;
  }
  /// False when asked for the first time.
  [[nodiscard]] bool operator()(PointId id) noexcept {
    const bool met = stamps_[id] == now_;
    stamps_[id] = now_;
    return met;
  }

private:
  std::vector<std::uint32_t> stamps_;
  std::uint32_t now_ = 0;
};

/// Passes on each point once, with its distance by the coordinates given. Trees hold it a rounding away, so
/// they are asked for all that is nearer than the limit and that much.
template <class Forest, class C>
class MeasuredOnce {
public:
  MeasuredOnce(const Forest& forest, const float* query, C& collector, MetBefore& met)
      : forest_(forest),
        query_(query),
        collector_(collector),
        met_(met),
        rounding_(KdForestAccess::rounding(forest, query)),
        // Sums of squares, and bounds of cells at up to 32 splits, are rounded too.
        growth_(1 + (static_cast<float>(forest.dimension()) + 160) * std::numeric_limits<float>::epsilon()) {
    met.start(forest.size());
    widen();
  }
  [[nodiscard]] float limit() const noexcept { return limit_; }
  void offer(PointId id, float turned) {
    if (!(turned < limit_) || met_(id)) return;  // the limit may have come down within a leaf
    const float reduced = KdForestAccess::reduced_distance(forest_, query_, id);
    if (!(reduced < static_cast<float>(collector_.limit()))) return;
    collector_.offer(id, reduced);
    widen();
  }

private:
  void widen() {
    const float reach = (std::sqrt(static_cast<float>(collector_.limit())) * growth_ + rounding_) * growth_;
    limit_ = reach * reach;
  }

  const Forest& forest_;
  const float* query_;
  C& collector_;
  MetBefore& met_;
  float rounding_;
  float growth_;
  float limit_ = 0;
};

}  // namespace detail

/// Best-bin-first search through all trees of a forest at once; keep one for many searches, one a thread.
template <std::size_t Dim>
class BestBinFirst<KdForest<Dim>> {
public:
  using Real = float;

  /// Offers each point at most once, with its distance as BruteForce computes it. Throws Error where the
  /// query is not finite or of another dimension. Returns true where the answer is exact. `budget` is for all
  /// trees together.
  template <QueryPoint Query, Collector<float> C>
  bool search(const KdForest<Dim>& forest, const Query& query, C& collector, Budget budget = {},
              Work* work = nullptr) {
    detail::check_collector<C, L2>();
    if (forest.empty()) return true;
    const std::size_t dim = forest.dimension();
    row_.resize(dim);
    detail::copy_point<float>(query, dim, row_.data(), {"BestBinFirst: query", 0});
    const auto trees = detail::KdForestAccess::trees(forest);
    turned_.resize(dim * trees.size());
    detail::KdForestAccess::turn(forest, row_.data(), turned_.data());
    trees_.clear();
    queries_.clear();
    for (const auto& tree : trees) {
      queries_.push_back(turned_.data() + trees_.size() * dim);
      trees_.push_back(&tree);
    }
    detail::MeasuredOnce<KdForest<Dim>, C> measured(forest, row_.data(), collector, met_);
    return search_.search(std::span<const Tree* const>(trees_), std::span<const float* const>(queries_),
                          measured, budget, work);
  }

private:
  using Tree = KdTree<float, Dim>;

  BestBinFirst<Tree> search_;
  std::vector<const Tree*> trees_;
  std::vector<const float*> queries_;
  std::vector<float> row_;
  std::vector<float> turned_;
  detail::MetBefore met_;
};

}}  // namespace cairn::CAIRN_ABI
