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
#include <cstring>
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
    looked_at_ = 0;
    if (cells.coded()) prepare_codes(cells, query);
    const bool all = scan_cells(cells, blocks, offer, done);
    if (cells.coded()) finish_codes(cells, offer);
    if (all) {
      if (cells.coded()) settle_doubts(cells, offer);
      offer.settle();
    }
    return all;
  }

  /// Points of the last search whose bytes were looked at, where points have codes.
  [[nodiscard]] std::size_t looked_at() const noexcept { return looked_at_; }

private:
  void prepare_codes(const ByteCells& cells, const std::vector<std::uint8_t>& query) {
    cells.points().codebook().make_tables(query.data(), tables_);
    pending_.clear();
    doubts_.clear();
    parts_.clear();
    estimates_.resize(most_estimated * block_size);
    estimated_ = 0;
    few_ = first_few;
    lowest_ = std::numeric_limits<float>::infinity();
  }
  template <class Offer>
  void finish_codes(const ByteCells& cells, Offer& offer) {
    decide(cells, offer);
    measure_all(cells, offer);
  }

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
        if (cells.coded()) {
          scan_codes(cells, cell, scanned, offer);
          if (offer.unlimited() && may_end_before(cells, after)) decide(cells, offer);
        } else {
          scan(cells, begin, scanned, offer);
        }
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
      if (offer.unlimited()) find_limit(distances, ids, now, offer);
      offer.blocks(distances, ids, now);
      block += now;
    }
  }

  /// Without a limit all would be offered: the nearest ones, taken one by one, give one. Whoever is taken, or
  /// not there, has the largest number.
  template <class Offer>
  static void find_limit(std::int32_t* distances, const PointId* ids, std::size_t count, Offer& offer) {
    constexpr std::int32_t done = std::numeric_limits<std::int32_t>::max();
    for (std::size_t i = 0; i < count * block_size; ++i)
      if (ids[i] == no_point) distances[i] = done;
    while (offer.unlimited()) {
      std::int32_t* const least = std::min_element(distances, distances + count * block_size);
      if (*least == done) return;
      offer.one(std::exchange(*least, done), ids[least - distances]);
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

  /// Estimates, and meanwhile whoever was asked for at the last call comes and is measured. Without a limit
  /// everyone would be likely: then estimates are kept, and decided on once a few of the nearest, which are
  /// asked for, have given one.
  template <class Offer>
  void scan_codes(const ByteCells& cells, SmallestFirst::Item cell, std::size_t count, Offer& offer) {
    std::size_t block = cells.first_block(cell.place);
    const std::size_t end_of_points = block * block_size + cells.members_of(cell.place).size();
    for (const std::size_t end = block + count; block < end;) {
      if (estimated_ == most_estimated) decide(cells, offer);
      const std::size_t now = std::min(most_estimated - estimated_, end - block);
      float* const estimates = estimates_.data() + estimated_ * block_size;
      cells.points().codes().estimates(block, now, tables_, scale_of(cells, cell.key), estimates);
      for (std::size_t place = end_of_points; place < (block + now) * block_size; ++place)
        estimates[place - block * block_size] = std::numeric_limits<float>::infinity();
      parts_.push_back({static_cast<std::uint32_t>(block), static_cast<std::uint32_t>(now), cell.key});
      estimated_ += now;
      block += now;
      const bool waited = measure_pending(cells, offer);
      if (!offer.unlimited())
        decide(cells, offer);
      else if (!waited)
        ask_for_nearest(cells);
    }
  }

  /// Whether somebody has an estimate so small that perhaps nothing in a cell, the nearest one left, is
  /// nearer: then it is better to wait for a limit than to go on meanwhile.
  [[nodiscard]] bool may_end_before(const ByteCells& cells, SmallestFirst::Item cell) const noexcept {
    if (cell.place == SmallestFirst::none) return false;
    const auto key = static_cast<float>(cell.key);
    const float gap = std::sqrt(key) - cells.radius(cell.place);
    return gap >= 0 && lowest_ - cells.points().codes().rounding(key, tables_) <= gap * gap;
  }

  /// Asks for the bytes of the likely points of all estimates that are kept. Those that are possible but not
  /// likely are written down.
  template <class Offer>
  void decide(const ByteCells& cells, Offer& offer) {
    while (offer.unlimited())
      if (!measure_pending(cells, offer) && !ask_for_nearest(cells)) break;
    const float* estimates = estimates_.data();
    CodeVerdict verdicts[most_estimated];
    for (const Part& part : parts_) {
      cells.points().codes().verdicts(part.block, part.count, estimates, limits_of(cells, part.key, offer),
                                      verdicts);
      for (std::uint32_t i = 0; i < part.count; ++i) {
        ask_for(cells, part.block + i, verdicts[i].likely);
        if (const unsigned doubtful = verdicts[i].possible & ~verdicts[i].likely)
          doubts_.push_back({part.block + i, doubtful, part.key});
      }
      estimates += part.count * block_size;
    }
    parts_.clear();
    estimated_ = 0;
  }

  /// Asks for the bytes of a few points with the smallest estimates, twice as many each time. Whoever is
  /// taken, or not there, has an infinite estimate. Returns whether any was.
  bool ask_for_nearest(const ByteCells& cells) {
    constexpr float taken = std::numeric_limits<float>::infinity();
    unsigned masks[most_estimated];
    with_widest_lanes([&]() CAIRN_INLINED {
      // Of sixteen parts, the lanes, each has its smallest: so many estimates at least do not exceed the
      // one of that rank.
      Block<float> low = Block<float>{} + taken;
      for (std::size_t b = 0; b < estimated_; ++b) {
        Block<float> here;
        load_block<float>(estimates_.data() + b * block_size, here);
        low = here < low ? here : low;
      }
      lowest_ = std::min(lowest_, smallest<float>(low));
      float parts[block_size];
      std::memcpy(parts, &low, sizeof(low));
      Block<std::int32_t> below{};
      for (std::size_t i = 0; i < block_size; ++i) below -= Block<float>{} + parts[i] < low;
      const Block<float> ranked = below < Block<std::int32_t>{} + few_ ? -low : Block<float>{} + taken;
      const float least = std::max(smallest<float>(ranked), -std::numeric_limits<float>::max());
      for (std::size_t b = 0; b < estimated_; ++b) {
        Block<float> here;
        load_block<float>(estimates_.data() + b * block_size, here);
        here = -here;
        masks[b] = ~mask_below<float>(here, least) & 0xffffU;
      }
    });
    few_ = std::min(2 * few_, static_cast<std::int32_t>(block_size));
    const std::size_t before = pending_.size();
    std::size_t b = 0;
    for (const Part& part : parts_)
      for (std::uint32_t i = 0; i < part.count; ++i, ++b) {
        ask_for(cells, part.block + i, masks[b]);
        for (unsigned mask = masks[b]; mask != 0; mask &= mask - 1)
          estimates_[b * block_size + static_cast<std::size_t>(std::countr_zero(mask))] = taken;
      }
    return pending_.size() > before;
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
    measure_all(cells, offer);
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

  /// Offers whose coordinates were asked for at the last call, and measures the bytes of those that are
  /// pending: the likely ones have their coordinates asked for. Returns whether there was anybody.
  template <class Offer>
  bool measure_pending(const ByteCells& cells, Offer& offer) {
    const bool asked = offer.asked();
    if (pending_.empty()) return asked;
    looked_at_ += pending_.size();
    distances_.resize(pending_.size());
    cells.points().rows().distances(pending_.data(), pending_.size(), query_, distances_.data());
    for (std::size_t i = 0; i < pending_.size(); ++i)
      if (distances_[i] < offer.below()) offer.ask(distances_[i], cells.id_of(pending_[i]));
    pending_.clear();
    return true;
  }
  template <class Offer>
  void measure_all(const ByteCells& cells, Offer& offer) {
    while (measure_pending(cells, offer)) {
    }
  }

  /// Blocks of a cell whose points have estimates.
  struct Part {
    std::uint32_t block;
    std::uint32_t count;
    std::int32_t key;
  };

  /// Points of a block that are possible but were not likely.
  struct Doubt {
    std::uint32_t block;
    std::uint32_t lanes;
    std::int32_t key;  ///< squared distance from the cell's mean
  };

  static constexpr std::size_t at_once = 8;          ///< blocks that are looked at together
  static constexpr std::size_t most_estimated = 64;  ///< blocks whose estimates are kept
  static constexpr std::int32_t first_few = 5;       ///< points that are asked for without a limit
  /// How many spreads an estimate may err to the one side before a point that is near is taken for far: 3
  /// leave out one of a thousand.
  static constexpr float likely_spreads = 3;

  ByteQuery query_;
  SmallestFirst order_;  ///< of the cells, by the distance of their means
  CodeTables tables_;
  AlignedVector<float> estimates_;  ///< of the points of parts_
  std::size_t estimated_ = 0;       ///< blocks
  std::vector<Part> parts_;
  std::int32_t few_ = first_few;        ///< to ask for next
  float lowest_ = 0;                    ///< estimate without a limit
  std::vector<std::uint32_t> pending_;  ///< places
  std::vector<std::int32_t> distances_;
  std::vector<Doubt> doubts_;
  std::size_t looked_at_ = 0;
};

}}}  // namespace cairn::CAIRN_ABI::detail
