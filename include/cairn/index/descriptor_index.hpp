// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// An index of descriptors (tens to hundreds of numbers) for a search under a budget: one byte a coordinate,
/// in cells around means, and the caller's points for the last word.
///
/// ```cpp
/// const cairn::DescriptorIndex index(descriptors);           // refers to them; a quarter of their memory
/// decltype(index)::Scratch scratch;                          // one a thread
/// cairn::NearestTwo<float> two;
/// index.search(query, two, {.budget = {.leaves = 64}}, scratch);
/// if (const auto hit = index.nearest(query, {.leaves = 64})) use(hit->id, hit->distance);
/// ```
///
/// The cells begin as those of a kd-tree and are moved to their means (k_means.hpp). A query asks for its
/// distance from all means and scans the nearest cells first (an inverted file: Jegou, Douze, Schmid,
/// "Product quantization for nearest neighbor search", IEEE PAMI 33, 2011, section IV): in so many dimensions
/// the distance from a cell's middle says more about where near points are than that from its border.
///
/// A coordinate is kept as a byte (byte_scale.hpp), and how far bytes are from their points is known: whoever
/// may be nearer than the collector's limit by that much is measured again, exactly; where the bytes are the
/// points (SIFT), nobody is. Without a budget the answers are those of BruteForce. Euclidean distances only.
///
/// Large sets of many coordinates have codes of half a byte for four coordinates as well (product_codes.hpp):
/// a search reads those, an eighth of the bytes, and looks at the bytes only of points that the codes make
/// likely. Who is unlikely, but not proven farther than the limit, is looked at as well before an answer is
/// called exact: what a budget leaves no time for. So codes change what a budget finds a little, and no exact
/// answer.
///
/// The index grows and shrinks with the caller's set: cells that have become too full split. The bytes'
/// step and range are those of the points of the build: of others, far outside, the bytes say little, and
/// they are measured. descriptor_file.hpp saves it.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/reset_on_move.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/answers.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/byte_cells.hpp>
#include <cairn/index/detail/byte_kernels.hpp>
#include <cairn/index/detail/byte_offer.hpp>
#include <cairn/index/detail/byte_scale.hpp>
#include <cairn/index/detail/cell_search.hpp>
#include <cairn/index/detail/k_means.hpp>
#include <cairn/index/metric.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Whether points have product codes of four bits, beside their bytes.
enum class DescriptorCodes {
  automatic,  ///< where they save time: large sets of many coordinates
  off,
  on
};

struct DescriptorIndexOptions {
  /// Mean number of points in a cell, up to a factor of 1.5. 0: sqrt(n) / 5, but at least 32, where scanning
  /// the means costs about as much as scanning the cells; sqrt(n) / 3.5 where points have codes, which are
  /// scanned faster than means.
  std::size_t points_in_cell = 0;
  unsigned rounds = 5;   ///< of moving the cells to their means; 0 leaves the kd-tree's
  unsigned threads = 1;  ///< of the build; the index is the same for any number (0 counts as 1)
  DescriptorCodes codes = DescriptorCodes::automatic;
};

namespace detail {
struct DescriptorAccess;
}

/// Const methods may run at the same time. Points that are in the index must stay as they are; the set itself
/// may grow.
template <PointSet Points>
class DescriptorIndex {
public:
  using Real = float;
  using Hit = Neighbor<float>;
  using Coordinate = float;
  using Measure = L2;
  class Search;
  using Scratch = Search;  ///< what a search needs
  static constexpr std::size_t fixed_dimension = dynamic_dim;

  /// Throws Error, naming the point, for coordinates that are not finite, for points of different dimensions,
  /// and for more than 16384 dimensions. O(n log n + cells^2).
  explicit DescriptorIndex(const Points& points, const DescriptorIndexOptions& options = {})
      : points_(&points), options_(options) {
    const auto count = static_cast<std::size_t>(points.size());
    if (count == 0) return;
    detail::check_count(count, "DescriptorIndex: point");
    set_dimension(detail::dimension_of<dynamic_dim>(points));
    std::vector<PointId> ids(count);
    std::iota(ids.begin(), ids.end(), PointId{0});
    build(detail::copy_points<float>(points, dimension(), "DescriptorIndex: point"), ids);
  }
  explicit DescriptorIndex(const Points&&, const DescriptorIndexOptions& = {}) = delete;  ///< would be gone

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return scale_.dimension(); }
  [[nodiscard]] L2 metric() const noexcept { return {}; }
  [[nodiscard]] std::size_t cells() const noexcept { return cells_.size(); }
  /// Whether a search looks at codes first.
  [[nodiscard]] bool coded() const noexcept { return cells_.coded(); }
  /// True where every coordinate is a byte's value exactly, so that distances of bytes are distances.
  [[nodiscard]] bool bytes_are_exact() const noexcept { return error_ == 0; }
  /// Memory held, the caller's points not included.
  [[nodiscard]] std::size_t bytes() const noexcept { return cells_.bytes() + scale_.bytes(); }

  /// Takes in points first ... first + count - 1 of the caller's set, which may have grown, or in which
  /// points that were erased have been written anew. Throws Error, naming the point, where one is already
  /// there, is none of the set, not finite or of another dimension; the index is as it was then. Into an
  /// index without cells: a build. O(cells) a point and a split now and then.
  void insert(PointId first, std::size_t count = 1) {
    const auto known = static_cast<std::size_t>(points_->size());
    if (first > known || count > known - first)
      raise("DescriptorIndex::insert: points " + std::to_string(first) + " ... " +
            std::to_string(std::uint64_t{first} + count) + " (excluded) of a set of " +
            std::to_string(known));
    if (count == 0) return;
    detail::check_count(known, "DescriptorIndex: point");
    const bool fresh = cells() == 0;
    const std::size_t dim = fresh ? detail::size_of_point((*points_)[first], 0) : dimension();
    std::vector<float> rows(detail::room_for(count, dim, "DescriptorIndex: point"));
    for (std::size_t i = 0; i < count; ++i)
      detail::copy_point<float>((*points_)[first + i], dim, rows.data() + i * dim,
                                {"DescriptorIndex: point", first + i});
    std::vector<PointId> ids(count);
    std::iota(ids.begin(), ids.end(), first);
    if (fresh) {
      DescriptorIndex built(points_, options_);
      built.set_dimension(dim);
      built.build(rows, ids);
      *this = std::move(built);
    } else {
      insert_rows(rows, ids);
    }
  }

  /// Takes a point out, whose coordinates are not looked at; returns whether it was there. O(1), but for the
  /// first change of an index: O(n). Memory is given back by later insertions.
  bool erase(PointId id) {
    if (empty()) return false;
    cells_.number_places(0);
    if (!cells_.contains(id)) return false;
    cells_.erase(id);
    --size_;
    return true;
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

  /// As Search; `scratch` keeps memory from search to search. Returns true where nothing nearer was left out.
  template <Point Query, Collector<float> C>
  bool search(const Query& query, C& collector, const SearchOptions& options, Scratch& scratch) const {
    return scratch.search(*this, query, collector, options.budget, options.work);
  }
  template <Point Query, Collector<float> C>
  bool search(const Query& query, C& collector, const SearchOptions& options = {}) const {
    Scratch scratch;
    return search(query, collector, options, scratch);
  }

  /// Calls visit(id, std::span<const float>) for every point, by ascending id; the span is valid during the
  /// call.
  template <class Visit>
  void for_each(Visit&& visit) const {
    std::vector<PointId> ids;
    ids.reserve(size());
    for (std::size_t c = 0; c < cells(); ++c)
      ids.insert(ids.end(), cells_.members_of(c).begin(), cells_.members_of(c).end());
    std::sort(ids.begin(), ids.end());
    std::vector<float> row(dimension());
    for (const PointId id : ids) {
      detail::copy_point<float>((*points_)[id], row.size(), row.data(), {"DescriptorIndex: point", id});
      visit(id, std::span<const float>(row));
    }
  }

  /// Searches under a budget; keep one for many searches, one a thread.
  class Search {
  public:
    /// Offers points with their exact reduced distances, until none can be nearer than the collector's limit
    /// or the budget is spent, whose leaves are blocks of sixteen points. Returns true where nothing was left
    /// out. Throws Error where the query is not finite or of another dimension. `measured`, where given,
    /// counts distances of floats.
    template <Point Query, Collector<float> C>
    bool search(const DescriptorIndex& index, const Query& query, C& collector, Budget budget = {},
                Work* work = nullptr, std::size_t* measured = nullptr) {
      detail::check_collector<C, L2>();
      if (index.empty()) return true;
      row_.resize(index.dimension());
      bytes_.resize(index.dimension());
      detail::copy_point<float>(query, row_.size(), row_.data(), {"DescriptorIndex: query", 0});
      const auto missed = index.scale_.encode(row_.data(), bytes_.data());
      const Exact exact{index, row_.data()};
      byte_doubts_.clear();
      byte_asked_.clear();
      detail::ByteOffer offer({index.dimension(), index.scale_.unit(), missed.rounding, index.error_,
                               index.inside_ ? missed.outside_squared : 0},
                              exact, collector, byte_doubts_, byte_asked_);
      Work done;
      const bool all = cells_.search(index.cells_, bytes_, budget.leaves, offer, done);
      if (work != nullptr) *work += done;
      if (measured != nullptr) *measured += offer.measured();
      return all;
    }

    /// Points of the last search whose bytes were looked at, where points have codes.
    [[nodiscard]] std::size_t looked_at() const noexcept { return cells_.looked_at(); }

  private:
    std::vector<float> row_;
    std::vector<std::uint8_t> bytes_;
    std::vector<detail::ByteDoubt> byte_doubts_, byte_asked_;
    detail::CellSearch cells_;
  };

private:
  friend struct detail::DescriptorAccess;

  /// Distances of the caller's points from a query.
  struct Exact {
    const DescriptorIndex& index;
    const float* query;
    [[nodiscard]] float operator()(PointId id) const { return index.reduced_distance(query, id); }
    void prefetch(PointId id) const noexcept { index.prefetch_point(id); }
  };

  DescriptorIndex(const Points* points, const DescriptorIndexOptions& options)
      : points_(points), options_(options) {}

  /// How often the points are halved for so many in a cell.
  [[nodiscard]] unsigned depth_for(std::size_t in_cell) const noexcept {
    const double cells = static_cast<double>(size_) / static_cast<double>(in_cell);
    const auto wished = static_cast<unsigned>(std::lround(std::log2(std::max(1.0, cells))));
    return std::min(wished, static_cast<unsigned>(std::bit_width(size())) - 1);
  }

  void set_dimension(std::size_t dim) {
    if (dim == 0) raise("DescriptorIndex: point: a point needs at least one coordinate");
    if (dim > detail::most_byte_axes)
      raise("DescriptorIndex: a point may have 16384 coordinates at most, got " + std::to_string(dim));
    scale_ = detail::ByteScale(std::vector<float>(dim));
  }

  void build(const std::vector<float>& rows, std::span<const PointId> ids) {
    size_ = ids.size();
    const auto [codes, error] = scale_.learn(rows);
    error_ = error;
    detail::KMeansBuilder builder(codes, dimension(), options_.threads);
    cells_ = detail::ByteCells(dimension(), codes, ids, builder.build(depth_for(in_cell()), options_.rounds),
                               codes_pay(size_), options_.threads);
  }

  /// All or, where memory ends, none.
  void insert_rows(const std::vector<float>& rows, std::span<const PointId> ids) {
    const std::size_t dim = dimension();
    std::vector<std::uint8_t> codes(rows.size());
    float error = error_;
    bool inside = inside_;
    for (std::size_t i = 0; i < rows.size(); i += dim) {
      const auto missed = scale_.encode(&rows[i], &codes[i]);
      error = std::max(error, missed.rounding);
      inside = inside && missed.outside_squared == 0;
    }
    cells_.number_places(ids.back());
    for (const PointId id : ids)
      if (cells_.contains(id))
        raise("DescriptorIndex::insert: point " + std::to_string(id) + " is in the index already");
    if (!coded() && codes_pay(size_ + ids.size())) cells_.take_codes(options_.threads);
    // Nothing is in where one could not be put in; a guard, for those who compile without exceptions.
    struct Insertion {
      DescriptorIndex& index;
      std::span<const PointId> ids;
      std::size_t done = 0;

      Insertion(DescriptorIndex& into, std::span<const PointId> of) : index(into), ids(of) {}
      Insertion(const Insertion&) = delete;
      Insertion& operator=(const Insertion&) = delete;
      ~Insertion() {
        if (done == ids.size()) return;
        --index.size_;
        while (done > 0) {
          index.cells_.erase(ids[--done]);
          --index.size_;
        }
      }
    } insertion(*this, ids);
    for (; insertion.done < ids.size(); ++insertion.done) {
      ++size_;
      cells_.insert(ids[insertion.done], &codes[insertion.done * dim], 2 * in_cell());
    }
    error_ = error;
    inside_ = inside;
  }

  /// Whether a set of so many points is searched faster by codes: below, bytes are in the cache anyhow. Of 64
  /// coordinates codes with their numbers are three lines of 64 bytes where the bytes are sixteen, which pays
  /// once the bytes outgrow the last cache.
  [[nodiscard]] bool codes_pay(std::size_t count) const noexcept {
    if (options_.codes != DescriptorCodes::automatic) return options_.codes == DescriptorCodes::on;
    const std::size_t bytes = count * dimension();
    return (dimension() >= 96 && bytes >= std::size_t{1} << 22U) ||
           (dimension() >= 64 && bytes >= std::size_t{1} << 25U);
  }

  [[nodiscard]] std::size_t in_cell() const noexcept {
    if (options_.points_in_cell > 0) return options_.points_in_cell;
    const double share = coded() || codes_pay(size_) ? 3.5 : 5;
    return std::max<std::size_t>(2 * detail::block_size,
                                 static_cast<std::size_t>(std::sqrt(static_cast<double>(size_)) / share));
  }

  /// Asks for the coordinates of a point, where it has them in memory.
  void prefetch_point(PointId id) const noexcept {
    using Member = decltype((*points_)[id]);
    constexpr bool stays =
        std::is_lvalue_reference_v<Member> || std::ranges::enable_borrowed_range<std::remove_cv_t<Member>>;
    if constexpr (stays && requires { *(*points_)[id].data(); }) {
      const auto* first = (*points_)[id].data();
      const std::size_t in_line = std::max<std::size_t>(1, 64 / sizeof(*first));
      for (std::size_t axis = 0; axis < dimension(); axis += in_line) __builtin_prefetch(first + axis);
      __builtin_prefetch(first + dimension() - 1);  // rows need not begin on a line
    }
  }

  /// Sixteen sums side by side.
  [[nodiscard]] float reduced_distance(const float* query, PointId id) const {
    const auto& point = (*points_)[id];
    float sum = 0;
    detail::with_widest_lanes([&]() CAIRN_INLINED {
      float sums[detail::block_size] = {};
      std::size_t axis = 0;
      for (; axis + detail::block_size <= dimension(); axis += detail::block_size)
        for (std::size_t i = 0; i < detail::block_size; ++i) {
          const float difference = query[axis + i] - detail::coordinate<float>(point, axis + i);
          sums[i] += difference * difference;
        }
      for (std::size_t i = 0; axis < dimension(); ++i, ++axis) {
        const float difference = query[axis] - detail::coordinate<float>(point, axis);
        sums[i] += difference * difference;
      }
      for (std::size_t i = 0; i < detail::block_size; ++i) sum += sums[i];
    });
    return sum;
  }

  const Points* points_;
  DescriptorIndexOptions options_;
  ResetOnMove<std::size_t> size_;
  detail::ByteScale scale_;
  float error_ = 0;     ///< what rounding misses of any point at most, in bytes
  bool inside_ = true;  ///< whether all points are in the box of bytes
  detail::ByteCells cells_;
};

}}  // namespace cairn::CAIRN_ABI
