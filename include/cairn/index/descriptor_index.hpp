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
/// A coordinate x of axis a is kept as round(s (x - low[a])) with one s for all axes, so that distances keep
/// their proportions. How far bytes are from their points is known: whoever may be nearer than the
/// collector's limit by that much is measured again, exactly; where the bytes are the points (SIFT), nobody
/// is. Without a budget the answers are those of BruteForce. Euclidean distances only.
///
/// Large sets of many coordinates have codes of half a byte for four coordinates as well (product_codes.hpp):
/// a search reads those, an eighth of the bytes, and looks at the bytes only of points that the codes make
/// likely. Who is unlikely, but not proven farther than the limit, is looked at as well before an answer is
/// called exact: what a budget leaves no time for. So codes change what a budget finds a little, and no exact
/// answer.
///
/// The index grows and shrinks with the caller's set: cells that have become too full split. s and low are
/// those of the points of the build: of others, far outside, the bytes say little, and they are measured.
/// descriptor_file.hpp saves it.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/answers.hpp>
#include <cairn/index/detail/byte_blocks.hpp>
#include <cairn/index/detail/byte_cells.hpp>
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
  /// the means costs about as much as scanning the cells.
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
    low_.resize(detail::dimension_of<dynamic_dim>(points));
    check_dimension();
    std::vector<PointId> ids(count);
    std::iota(ids.begin(), ids.end(), PointId{0});
    build(detail::copy_points<float>(points, dimension(), "DescriptorIndex: point"), ids);
  }
  explicit DescriptorIndex(const Points&&, const DescriptorIndexOptions& = {}) = delete;  ///< would be gone

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return low_.size(); }
  [[nodiscard]] L2 metric() const noexcept { return {}; }
  [[nodiscard]] std::size_t cells() const noexcept { return cells_.size(); }
  /// Whether a search looks at codes first.
  [[nodiscard]] bool coded() const noexcept { return cells_.coded(); }
  /// True where every coordinate is a byte's value exactly, so that distances of bytes are distances.
  [[nodiscard]] bool bytes_are_exact() const noexcept { return error_ == 0; }
  /// Memory held, the caller's points not included.
  [[nodiscard]] std::size_t bytes() const noexcept {
    return cells_.bytes() + low_.capacity() * sizeof(float);
  }

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
      built.low_.resize(dim);
      built.check_dimension();
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
      codes_.resize(index.dimension());
      detail::copy_point<float>(query, row_.size(), row_.data(), {"DescriptorIndex: query", 0});
      const float error = index.encode(row_.data(), codes_.data());
      query_.set(codes_.data(), codes_.size());
      cells_.resize(index.cells());
      const detail::ByteBlocks& means = index.cells_.means();
      means.distances(0, means.blocks(), query_, cells_.keys());
      cells_.reset();
      Offer<C> offer(index, row_.data(), error, collector);
      Work done{.nodes = means.blocks()};
      pending_.clear();
      doubts_.clear();
      looked_at_ = 0;
      if (index.coded()) index.cells_.codebook().make_tables(codes_.data(), tables_);
      bool all = scan_cells(index, offer, budget.leaves, done);
      measure_pending(index, offer);
      if (all) settle_doubts(index, offer);
      if (work != nullptr) *work += done;
      if (measured != nullptr) *measured += offer.measured();
      return all;
    }

    /// Points of the last search whose bytes were looked at, where points have codes.
    [[nodiscard]] std::size_t looked_at() const noexcept { return looked_at_; }

  private:
    template <class O>
    bool scan_cells(const DescriptorIndex& index, O& offer, std::size_t left, Work& done) {
      auto cell = cells_.next();
      while (cell.place != detail::SmallestFirst::none) {
        if (left == 0) return false;
        const auto after = cells_.next();
        if (after.place != detail::SmallestFirst::none) prefetch(index, after.place);
        if (offer.may_hold_nearer(std::sqrt(static_cast<float>(cell.key)) -
                                  index.cells_.radius(cell.place))) {
          const std::size_t begin = index.cells_.first_block(cell.place);
          const std::size_t blocks = index.cells_.blocks_of(cell.place);
          const std::size_t scanned = std::min(left, blocks);
          if (index.coded())
            scan_codes(index, cell, scanned, offer);
          else
            scan(index, begin, scanned, offer);
          done.leaves += scanned;
          done.distances += scanned * detail::block_size;
          left -= scanned;
          if (scanned < blocks) return false;
        }
        cell = after;
      }
      return true;
    }

    template <class O>
    void scan(const DescriptorIndex& index, std::size_t block, std::size_t count, O& offer) const {
      std::int32_t distances[at_once * detail::block_size];
      for (const std::size_t end = block + count; block < end;) {
        const std::size_t now = std::min(at_once, end - block);
        index.cells_.members().distances(block, now, query_, distances);
        for (std::size_t i = 0; i < now; ++i, ++block)
          offer.block(distances + i * detail::block_size, index.cells_.ids_of(block));
      }
    }

    static void prefetch(const DescriptorIndex& index, std::size_t cell) noexcept {
      const std::size_t first = index.cells_.first_block(cell), count = index.cells_.blocks_of(cell);
      if (index.coded()) {
        index.cells_.codes().prefetch(first, count);
      } else {
        index.cells_.members().prefetch(first, count);
      }
    }

    static constexpr std::size_t at_once = 8;  ///< blocks whose estimates are made together

    /// Asks for the bytes of likely points, and looks at those of the blocks before: they have come
    /// meanwhile. Points that are possible but not likely are written down.
    template <class O>
    void scan_codes(const DescriptorIndex& index, detail::SmallestFirst::Item cell, std::size_t count,
                    O& offer) {
      const std::size_t points = index.cells_.members_of(cell.place).size();
      std::size_t block = index.cells_.first_block(cell.place);
      const std::size_t end_of_points = block * detail::block_size + points;
      float estimates[at_once * detail::block_size];
      detail::CodeVerdict verdicts[at_once];
      for (const std::size_t end = block + count; block < end;) {
        const std::size_t now = std::min(at_once, end - block);
        index.cells_.codes().estimates(block, now, tables_, scale_of(index, cell.key), estimates);
        for (std::size_t place = end_of_points; place < (block + now) * detail::block_size; ++place)
          estimates[place - block * detail::block_size] = std::numeric_limits<float>::infinity();
        measure_pending(index, offer);
        if (offer.unlimited()) find_limit(index, block, now, estimates, offer);
        index.cells_.codes().verdicts(block, now, estimates, limits_of(index, cell.key, offer), verdicts);
        for (std::size_t i = 0; i < now; ++i, ++block) {
          ask_for(index, block, verdicts[i].likely);
          if (const unsigned doubtful = verdicts[i].possible & ~verdicts[i].likely)
            doubts_.push_back({static_cast<std::uint32_t>(block), doubtful, cell.key});
        }
      }
    }

    /// Without a limit everyone is likely: the points with the smallest estimates give one.
    template <class O>
    void find_limit(const DescriptorIndex& index, std::size_t block, std::size_t count, float* estimates,
                    O& offer) {
      constexpr float done = std::numeric_limits<float>::infinity();
      while (offer.unlimited()) {
        const float* least = std::min_element(estimates, estimates + count * detail::block_size);
        if (*least == done) return;
        const auto place = static_cast<std::size_t>(least - estimates);
        estimates[place] = done;
        pending_.push_back(static_cast<std::uint32_t>(block * detail::block_size + place));
        measure_pending(index, offer);
      }
    }

    /// Measures whoever is still possible of those that were not likely.
    template <class O>
    void settle_doubts(const DescriptorIndex& index, O& offer) {
      float estimates[detail::block_size];
      detail::CodeVerdict verdict{};
      for (const Doubt& doubt : doubts_) {
        index.cells_.codes().estimates(doubt.block, 1, tables_, scale_of(index, doubt.key), estimates);
        index.cells_.codes().verdicts(doubt.block, 1, estimates, limits_of(index, doubt.key, offer),
                                      &verdict);
        if (pending_.size() >= at_once) measure_pending(index, offer);
        ask_for(index, doubt.block, verdict.possible & doubt.lanes);
      }
      measure_pending(index, offer);
    }

    [[nodiscard]] detail::CodeScale scale_of(const DescriptorIndex& index, std::int32_t key) const noexcept {
      return index.cells_.codes().scale(static_cast<float>(key), tables_);
    }
    template <class O>
    [[nodiscard]] detail::CodeLimits limits_of(const DescriptorIndex& index, std::int32_t key,
                                               const O& offer) const noexcept {
      const float proven = 2 * std::sqrt(static_cast<float>(key)) * 1.00001F + 0.001F;
      const float likely = std::clamp(likely_spreads * index.cells_.spread(), 0.001F, 1.0F) * proven;
      return {likely, proven, index.cells_.codes().rounding(static_cast<float>(key), tables_),
              static_cast<float>(offer.below()) * 1.000001F};
    }

    void ask_for(const DescriptorIndex& index, std::size_t block, unsigned lanes) {
      for (; lanes != 0; lanes &= lanes - 1) {
        const std::size_t place =
            block * detail::block_size + static_cast<std::size_t>(std::countr_zero(lanes));
        index.cells_.rows().prefetch(place);
        pending_.push_back(static_cast<std::uint32_t>(place));
      }
    }

    template <class O>
    void measure_pending(const DescriptorIndex& index, O& offer) {
      if (pending_.empty()) return;
      looked_at_ += pending_.size();
      distances_.resize(pending_.size());
      index.cells_.rows().distances(pending_.data(), pending_.size(), query_, distances_.data());
      for (std::size_t i = 0; i < pending_.size(); ++i)
        if (distances_[i] < offer.below()) offer.one(distances_[i], index.cells_.id_of(pending_[i]));
      pending_.clear();
    }

    /// Points of a block that are possible but were not likely.
    struct Doubt {
      std::uint32_t block;
      std::uint32_t lanes;
      std::int32_t key;  ///< squared distance from the cell's mean
    };

    std::vector<float> row_;
    std::vector<std::uint8_t> codes_;
    detail::ByteQuery query_;
    detail::SmallestFirst cells_;
    detail::CodeTables tables_;
    std::vector<std::uint32_t> pending_;  ///< places
    std::vector<std::int32_t> distances_;
    std::vector<Doubt> doubts_;
    std::size_t looked_at_ = 0;
  };

private:
  friend struct detail::DescriptorAccess;

  DescriptorIndex(const Points* points, const DescriptorIndexOptions& options)
      : points_(points), options_(options) {}

  /// Passes on to a collector whoever the bytes cannot exclude.
  template <class C>
  class Offer {
  public:
    Offer(const DescriptorIndex& index, const float* query, float error, C& collector)
        : index_(index),
          query_(query),
          collector_(collector),
          slack_(error + index.error_),
          growth_(1.0001F + static_cast<float>(index.dimension()) * std::numeric_limits<float>::epsilon()) {
      tighten();
    }

    [[nodiscard]] std::size_t measured() const noexcept { return measured_; }

    /// Whether a point that is so far away, in bytes, may be below the limit.
    [[nodiscard]] bool may_hold_nearer(float bytes) const noexcept { return bytes < reach_; }

    /// In bytes: only who is nearer, squared, may be below the limit.
    [[nodiscard]] std::int32_t below() const noexcept { return below_; }
    [[nodiscard]] bool unlimited() const noexcept { return reach_ == std::numeric_limits<float>::infinity(); }

    void one(std::int32_t distance, PointId id) {
      if (distance < below_ && id != no_point) point(distance, id);
    }

    void block(const std::int32_t* distances, const PointId* ids) {
      unsigned mask = 0;
      const std::int32_t below = below_;
      detail::with_widest_lanes([&]() CAIRN_INLINED {
        detail::Block<std::int32_t> numbers;
        detail::load_block<std::int32_t>(distances, numbers);
        mask = detail::mask_below<std::int32_t>(numbers, below);
      });
      for (; mask != 0; mask &= mask - 1) {
        const auto lane = static_cast<unsigned>(std::countr_zero(mask));
        if (distances[lane] < below_ && ids[lane] != no_point) point(distances[lane], ids[lane]);
      }
    }

  private:
    void point(std::int32_t bytes, PointId id) {
      float reduced = 0;
      if (slack_ == 0) {
        reduced = static_cast<float>(bytes) * index_.unit_ * index_.unit_;
      } else {
        ++measured_;
        reduced = index_.reduced_distance(query_, id);
      }
      if (!(reduced < static_cast<float>(collector_.limit()))) return;
      collector_.offer(id, reduced);
      tighten();
    }

    /// The collector's limit in the units of the bytes, and what rounding can hide.
    void tighten() {
      const float distance = std::sqrt(static_cast<float>(collector_.limit())) / index_.unit_;
      reach_ = distance * growth_ + slack_;
      const float square = reach_ * reach_ + 1;
      constexpr float most = 2147483520.0F;  // the largest float below 2^31
      below_ =
          square < most ? static_cast<std::int32_t>(square) + 1 : std::numeric_limits<std::int32_t>::max();
    }

    const DescriptorIndex& index_;
    const float* query_;
    C& collector_;
    float slack_;   ///< how far the bytes of query and point together may be from them, in bytes
    float growth_;  ///< covers the rounding of sums
    float reach_ = 0;
    std::int32_t below_ = 0;
    std::size_t measured_ = 0;
  };

  /// How often the points are halved for so many in a cell.
  [[nodiscard]] unsigned depth_for(std::size_t in_cell) const noexcept {
    const double cells = static_cast<double>(size_) / static_cast<double>(in_cell);
    const auto wished = static_cast<unsigned>(std::lround(std::log2(std::max(1.0, cells))));
    return std::min(wished, static_cast<unsigned>(std::bit_width(size_)) - 1);
  }

  /// Learns low_, unit_ and error_, and returns the bytes of all points.
  [[nodiscard]] std::vector<std::uint8_t> encode(const std::vector<float>& rows) {
    const std::size_t dim = dimension();
    low_.assign(rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(dim));
    std::vector<float> high = low_;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      low_[i % dim] = std::min(low_[i % dim], rows[i]);
      high[i % dim] = std::max(high[i % dim], rows[i]);
    }
    float range = 0;
    for (std::size_t a = 0; a < dim; ++a) range = std::max(range, high[a] - low_[a]);
    const float finest = range > 1e-18F ? range / 255 : 1;  // nearer points are all zeros, and measured
    std::vector<std::uint8_t> codes(rows.size());
    // Whole numbers, and their halves and quarters, are met exactly by the next power of two.
    for (const float unit : {std::exp2(std::ceil(std::log2(finest))), finest}) {
      unit_ = unit;
      error_ = 0;
      for (std::size_t i = 0; i < rows.size(); i += dim) {
        const float error = encode(&rows[i], &codes[i]);
        if (error > 0 && unit > finest) {
          error_ = error;
          break;
        }
        error_ = std::max(error_, error);
      }
      if (error_ == 0) break;
    }
    return codes;
  }

  /// Writes the bytes of a point; returns how far they are from it, in bytes, rounded up.
  float encode(const float* row, std::uint8_t* codes) const noexcept {
    float sum = 0;
    bool exact = true;
    detail::with_widest_lanes([&]() CAIRN_INLINED {
      detail::Block<float> sums{};
      detail::Block<std::int32_t> misses{};
      std::size_t axis = 0;
      for (; axis + detail::block_size <= dimension(); axis += detail::block_size)
        encode_block(row + axis, low_.data() + axis, codes + axis, sums, misses);
      if (const std::size_t left = dimension() - axis; left > 0) {
        float numbers[detail::block_size] = {}, low[detail::block_size] = {};
        std::uint8_t bytes[detail::block_size];
        std::copy_n(row + axis, left, numbers);
        std::copy_n(low_.data() + axis, left, low);
        encode_block(numbers, low, bytes, sums, misses);
        std::copy_n(bytes, left, codes + axis);
      }
      for (std::size_t i = 0; i < detail::block_size; ++i) sum += sums[i];
      for (std::size_t i = 0; i < detail::block_size; ++i) exact = exact && misses[i] == 0;
    });
    return exact ? 0 : std::sqrt(sum) * 1.001F + 1e-3F;
  }
  /// Sixteen coordinates; what is missed is not zero.
  [[gnu::always_inline]] void encode_block(const float* row, const float* low, std::uint8_t* codes,
                                           detail::Block<float>& sums,
                                           detail::Block<std::int32_t>& misses) const noexcept {
    detail::Block<float> numbers, from;
    detail::load_block<float>(row, numbers);
    detail::load_block<float>(low, from);
    // A query may be far away: then it is moved nearer to all bytes alike.
    const detail::Block<float> zero{}, far = zero + 1e15F, top = zero + 255.0F;
    detail::Block<float> scaled = (numbers - from) / unit_;
    scaled = scaled < -far ? -far : scaled;
    scaled = scaled > far ? far : scaled;
    detail::Block<float> inside = scaled < zero ? zero : scaled;
    inside = inside > top ? top : inside;
    const auto whole = __builtin_convertvector(inside + 0.5F, detail::Block<std::int32_t>);
    const auto code = __builtin_convertvector(whole, detail::Block<float>);
    detail::store_bytes(whole, codes);
    sums += (scaled - code) * (scaled - code);
    // A difference may be rounded to a byte's value, and the point not be there.
    // Compared by their bits, which gcc 12 does side by side; adding zero makes minus zero plus zero.
    const detail::Block<float> there = from + code * unit_, here = numbers + zero;
    detail::Block<std::int32_t> bits[4];
    std::memcpy(&bits[0], &scaled, sizeof(scaled));
    std::memcpy(&bits[1], &code, sizeof(code));
    std::memcpy(&bits[2], &there, sizeof(there));
    std::memcpy(&bits[3], &here, sizeof(here));
    misses |= (bits[0] ^ bits[1]) | (bits[2] ^ bits[3]);
  }

  void check_dimension() const {
    if (dimension() > detail::most_byte_axes)
      raise("DescriptorIndex: a point may have 16384 coordinates at most, got " +
            std::to_string(dimension()));
  }

  void build(const std::vector<float>& rows, std::span<const PointId> ids) {
    size_ = ids.size();
    const std::vector<std::uint8_t> codes = encode(rows);
    detail::KMeansBuilder builder(codes, dimension(), options_.threads);
    cells_ = detail::ByteCells(dimension(), codes, ids, builder.build(depth_for(in_cell()), options_.rounds),
                               codes_pay(size_), options_.threads);
  }

  /// All or, where memory ends, none.
  void insert_rows(const std::vector<float>& rows, std::span<const PointId> ids) {
    const std::size_t dim = dimension();
    std::vector<std::uint8_t> codes(rows.size());
    float error = error_;
    for (std::size_t i = 0; i < rows.size(); i += dim) error = std::max(error, encode(&rows[i], &codes[i]));
    if (!coded() && codes_pay(size_ + ids.size())) cells_.take_codes(options_.threads);
    cells_.number_places(ids.back());
    for (const PointId id : ids)
      if (cells_.contains(id))
        raise("DescriptorIndex::insert: point " + std::to_string(id) + " is in the index already");
    std::size_t done = 0;
    try {
      for (; done < ids.size(); ++done) {
        ++size_;
        cells_.insert(ids[done], &codes[done * dim], 2 * in_cell());
      }
    } catch (...) {
      --size_;
      while (done > 0) {
        cells_.erase(ids[--done]);
        --size_;
      }
      throw;
    }
    error_ = error;
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
    return std::max<std::size_t>(2 * detail::block_size,
                                 static_cast<std::size_t>(std::sqrt(static_cast<double>(size_)) / 5));
  }

  [[nodiscard]] float reduced_distance(const float* query, PointId id) const {
    const auto& point = (*points_)[id];
    float sum = 0;
    for (std::size_t a = 0; a < dimension(); ++a)
      L2::accumulate(sum, query[a] - detail::coordinate<float>(point, a), a);
    return sum;
  }

  /// How many spreads an estimate may err to the one side before a point that is near is taken for far: 3.5
  /// leave out one of some hundreds.
  static constexpr float likely_spreads = 3.5F;

  const Points* points_;
  DescriptorIndexOptions options_;
  std::size_t size_ = 0;
  std::vector<float> low_;
  float unit_ = 1;   ///< what a byte's step is worth
  float error_ = 0;  ///< how far the bytes of any point are from it at most, in bytes
  detail::ByteCells cells_;
};

}}  // namespace cairn::CAIRN_ABI
