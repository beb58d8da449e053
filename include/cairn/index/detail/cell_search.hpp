// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A search among the cells of byte_cells.hpp: the nearest cells first, all their points by bytes, or, where
/// points have codes (product_codes.hpp), by those, and by bytes whoever they make likely. Who is possible
/// but not likely is written down, and looked at once nothing else is left.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/byte_blocks.hpp>
#include <cairn/index/detail/byte_cells.hpp>
#include <cairn/index/detail/byte_kernels.hpp>
#include <cairn/index/detail/code_kernels.hpp>
#include <cairn/index/detail/code_tables.hpp>
#include <cairn/index/detail/smallest_first.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Keep one for many searches, one a thread.
class CellSearch {
public:
  /// Offers points (byte_offer.hpp) until none can be nearer than the limit or so many blocks were looked at.
  /// `query` has the bytes of one. Returns true where nothing was left out.
  template <class Offer>
  bool search(const ByteCells& cells, const std::vector<std::uint8_t>& query, std::size_t blocks,
              Offer& offer, Work& done) {
    query_.set(query.data(), query.size());
    order_.resize(cells.size());
    const ByteBlocks& means = cells.means();
    means.distances(0, means.blocks(), query_, order_.keys());
    order_.reset();
    done.nodes += means.blocks();
    pending_.clear();
    doubts_.clear();
    looked_at_ = 0;
    if (cells.coded()) cells.points().codebook().make_tables(query.data(), tables_);
    const bool all = scan_cells(cells, blocks, offer, done);
    measure_pending(cells, offer);
    if (all) {
      settle_doubts(cells, offer);
      offer.settle();
    }
    return all;
  }

  /// Points of the last search whose bytes were looked at, where points have codes.
  [[nodiscard]] std::size_t looked_at() const noexcept { return looked_at_; }

private:
  template <class Offer>
  bool scan_cells(const ByteCells& cells, std::size_t left, Offer& offer, Work& done) {
    auto cell = order_.next();
    while (cell.place != SmallestFirst::none) {
      if (left == 0) return false;
      const auto after = order_.next();
      if (after.place != SmallestFirst::none) prefetch(cells, after.place);
      if (offer.may_hold_nearer(std::sqrt(static_cast<float>(cell.key)) - cells.radius(cell.place))) {
        const std::size_t begin = cells.first_block(cell.place);
        const std::size_t blocks = cells.blocks_of(cell.place);
        const std::size_t scanned = std::min(left, blocks);
        if (cells.coded())
          scan_codes(cells, cell, scanned, offer);
        else
          scan(cells, begin, scanned, offer);
        done.leaves += scanned;
        done.distances += scanned * block_size;
        left -= scanned;
        if (scanned < blocks) return false;
      }
      cell = after;
    }
    return true;
  }

  template <class Offer>
  void scan(const ByteCells& cells, std::size_t block, std::size_t count, Offer& offer) const {
    std::int32_t distances[at_once * block_size];
    for (const std::size_t end = block + count; block < end;) {
      const std::size_t now = std::min(at_once, end - block);
      const PointId* ids = cells.ids_of(block);
      cells.points().members().distances(block, now, query_, distances);
      if (offer.unlimited()) {
        for (std::size_t i = 0; i < now * block_size; ++i)
          if (ids[i] == no_point) distances[i] = std::numeric_limits<std::int32_t>::max();
        find_limit(distances, now, offer,
                   [&](std::size_t i, std::int32_t nearest) { offer.one(nearest, ids[i]); });
      }
      offer.blocks(distances, ids, now);
      block += now;
    }
  }

  static void prefetch(const ByteCells& cells, std::size_t cell) noexcept {
    const std::size_t first = cells.first_block(cell), count = cells.blocks_of(cell);
    if (cells.coded()) {
      cells.points().codes().prefetch(first, count);
    } else {
      cells.points().members().prefetch(first, count);
    }
  }

  /// Asks for the bytes of likely points, and looks at those of the blocks before: they have come
  /// meanwhile. Points that are possible but not likely are written down.
  template <class Offer>
  void scan_codes(const ByteCells& cells, SmallestFirst::Item cell, std::size_t count, Offer& offer) {
    const std::size_t points = cells.members_of(cell.place).size();
    std::size_t block = cells.first_block(cell.place);
    const std::size_t end_of_points = block * block_size + points;
    float estimates[at_once * block_size];
    CodeVerdict verdicts[at_once];
    for (const std::size_t end = block + count; block < end;) {
      const std::size_t now = std::min(at_once, end - block);
      cells.points().codes().estimates(block, now, tables_, scale_of(cells, cell.key), estimates);
      for (std::size_t place = end_of_points; place < (block + now) * block_size; ++place)
        estimates[place - block * block_size] = std::numeric_limits<float>::infinity();
      measure_pending(cells, offer);
      if (offer.unlimited())
        find_limit(estimates, now, offer, [&](std::size_t i, float) {
          pending_.push_back(static_cast<std::uint32_t>(block * block_size + i));
          measure_pending(cells, offer);
        });
      cells.points().codes().verdicts(block, now, estimates, limits_of(cells, cell.key, offer), verdicts);
      for (std::size_t i = 0; i < now; ++i, ++block) {
        ask_for(cells, block, verdicts[i].likely);
        if (const unsigned doubtful = verdicts[i].possible & ~verdicts[i].likely)
          doubts_.push_back({static_cast<std::uint32_t>(block), doubtful, cell.key});
      }
    }
  }

  /// Without a limit everyone is likely: those with the smallest numbers give one, taken one by one. Whoever
  /// is taken, or not there, has the largest number.
  template <class Number, class Offer, class Take>
  static void find_limit(Number* numbers, std::size_t count, const Offer& offer, const Take& take) {
    constexpr Number done = std::numeric_limits<Number>::has_infinity
                                ? std::numeric_limits<Number>::infinity()
                                : std::numeric_limits<Number>::max();
    while (offer.unlimited()) {
      Number* const least = std::min_element(numbers, numbers + count * block_size);
      if (*least == done) return;
      const Number number = std::exchange(*least, done);
      take(static_cast<std::size_t>(least - numbers), number);
    }
  }

  /// Measures whoever is still possible of those that were not likely.
  template <class Offer>
  void settle_doubts(const ByteCells& cells, Offer& offer) {
    float estimates[block_size];
    CodeVerdict verdict{};
    for (const Doubt& doubt : doubts_) {
      cells.points().codes().estimates(doubt.block, 1, tables_, scale_of(cells, doubt.key), estimates);
      cells.points().codes().verdicts(doubt.block, 1, estimates, limits_of(cells, doubt.key, offer),
                                      &verdict);
      if (pending_.size() >= at_once) measure_pending(cells, offer);
      ask_for(cells, doubt.block, verdict.possible & doubt.lanes);
    }
    measure_pending(cells, offer);
  }

  [[nodiscard]] CodeScale scale_of(const ByteCells& cells, std::int32_t key) const noexcept {
    return cells.points().codes().scale(static_cast<float>(key), tables_);
  }
  template <class Offer>
  [[nodiscard]] CodeLimits limits_of(const ByteCells& cells, std::int32_t key,
                                     const Offer& offer) const noexcept {
    const float below = static_cast<float>(offer.below()) * 1.000001F;
    const float proven = 2 * std::sqrt(below) * 1.00001F;
    const float likely = std::clamp(likely_spreads * cells.points().spread(), 0.001F, 1.0F) * proven;
    return {likely, proven, cells.points().codes().rounding(static_cast<float>(key), tables_), below};
  }

  void ask_for(const ByteCells& cells, std::size_t block, unsigned lanes) {
    for (; lanes != 0; lanes &= lanes - 1) {
      const std::size_t place = block * block_size + static_cast<std::size_t>(std::countr_zero(lanes));
      cells.points().rows().prefetch(place);
      pending_.push_back(static_cast<std::uint32_t>(place));
    }
  }

  template <class Offer>
  void measure_pending(const ByteCells& cells, Offer& offer) {
    if (pending_.empty()) return;
    looked_at_ += pending_.size();
    distances_.resize(pending_.size());
    cells.points().rows().distances(pending_.data(), pending_.size(), query_, distances_.data());
    for (std::size_t i = 0; i < pending_.size(); ++i)
      if (distances_[i] < offer.below()) offer.prefetch(cells.id_of(pending_[i]));
    for (std::size_t i = 0; i < pending_.size(); ++i)
      if (distances_[i] < offer.below()) offer.one(distances_[i], cells.id_of(pending_[i]));
    pending_.clear();
  }

  /// Points of a block that are possible but were not likely.
  struct Doubt {
    std::uint32_t block;
    std::uint32_t lanes;
    std::int32_t key;  ///< squared distance from the cell's mean
  };

  static constexpr std::size_t at_once = 8;  ///< blocks that are looked at together
  /// How many spreads an estimate may err to the one side before a point that is near is taken for far: 3
  /// leave out one of a thousand.
  static constexpr float likely_spreads = 3;

  ByteQuery query_;
  SmallestFirst order_;  ///< of the cells, by the distance of their means
  CodeTables tables_;
  std::vector<std::uint32_t> pending_;  ///< places
  std::vector<std::int32_t> distances_;
  std::vector<Doubt> doubts_;
  std::size_t looked_at_ = 0;
};

}}}  // namespace cairn::CAIRN_ABI::detail
