// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Cells around means that take in points, lose them and split: where in memory the points of which cell are.
///
/// A cell has a few blocks of sixteen places, one after the other, the last one filled up with no_point, and
/// room for more behind them:
///
///   blocks     | cell 0 ... (room) | cell 2 ... | (of no cell) | cell 1 ... (room) | ...
///   Extent     first, count, room, radius: of each cell     ids_: of each place
///   block_of_  of each id     cell_of_: of each block     (from the first change on)
///
/// A cell that outgrows its room moves behind all others, with a quarter more; what is left empty is given up
/// once it is a quarter of all. So an insertion is O(cells dim), which finding the nearest mean takes, and
/// now and then O(most dim) for a split; an erasure O(1). Where a point stands is written down from the first
/// change on: an index that never changes pays nothing for it. What stands at the places is
/// cell_points.hpp's.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <cairn/index/collectors.hpp>
#include <cairn/index/detail/byte_blocks.hpp>
#include <cairn/index/detail/byte_kernels.hpp>
#include <cairn/index/detail/cell_codes.hpp>
#include <cairn/index/detail/cell_points.hpp>
#include <cairn/index/detail/k_means.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

class ByteCells {
public:
  ByteCells() = default;

  /// Point i of `rows`, of `dim` bytes each, has the id ids[i].
  ByteCells(std::size_t dim, const std::vector<std::uint8_t>& rows, std::span<const PointId> ids,
            const KMeans& cells, bool coded, unsigned threads)
      : dim_(dim) {
    const auto mean_of = [&](std::size_t cell) { return &cells.means[cell * dim]; };
    means_ = ByteBlocks::of_rows(dim, cells.size(), mean_of);
    std::size_t blocks = 0;
    for (std::size_t c = 0; c < cells.size(); ++c) {
      const std::size_t count = cells.first[c + 1] - cells.first[c];
      extents_.push_back({static_cast<std::uint32_t>(blocks), static_cast<std::uint32_t>(count),
                          static_cast<std::uint32_t>(blocks_for(count)), 0});
      blocks += blocks_for(count);
    }
    ids_.assign(blocks * block_size, no_point);
    std::vector<const std::uint8_t*> row_at(ids_.size());
    for (std::size_t c = 0; c < cells.size(); ++c)
      for (std::size_t i = 0; i < extents_[c].count; ++i) {
        const std::size_t point = cells.order[cells.first[c] + i];
        ids_[extents_[c].place() + i] = ids[point];
        row_at[extents_[c].place() + i] = &rows[point * dim];
      }
    const auto row_of = [&](std::size_t place, std::uint8_t*) { return row_at[place]; };
    if (coded) {
      points_ = CellPoints(dim, learn_codes(*this, row_of, threads));
    } else {
      points_ = CellPoints(dim, blocks);
      for (std::size_t c = 0; c < cells.size(); ++c)
        for (std::size_t i = 0; i < extents_[c].count; ++i)
          points_.set(first_place(c) + i, row_at[first_place(c) + i], means_, c);
    }
    for (std::size_t c = 0; c < cells.size(); ++c) {
      mean_.set(mean_of(c), dim);
      measure_radius(c);
    }
  }

  [[nodiscard]] std::size_t size() const noexcept { return extents_.size(); }
  [[nodiscard]] const ByteBlocks& means() const noexcept { return means_; }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  /// Of all places.
  [[nodiscard]] const CellPoints& points() const noexcept { return points_; }
  [[nodiscard]] bool coded() const noexcept { return points_.coded(); }
  /// Reads the bytes of point i of a cell.
  void get(std::size_t cell, std::size_t i, std::uint8_t* row) const noexcept {
    points_.get(first_place(cell) + i, row);
  }
  [[nodiscard]] std::size_t first_block(std::size_t cell) const noexcept { return extents_[cell].first; }
  [[nodiscard]] std::size_t first_place(std::size_t cell) const noexcept { return extents_[cell].place(); }
  [[nodiscard]] std::size_t blocks_of(std::size_t cell) const noexcept {
    return blocks_for(extents_[cell].count);
  }
  /// Of all cells, those of none among them.
  [[nodiscard]] std::size_t blocks() const noexcept { return ids_.size() / block_size; }
  [[nodiscard]] PointId id_of(std::size_t place) const noexcept { return ids_[place]; }
  /// Of a block's sixteen points; no_point where there is none.
  [[nodiscard]] const PointId* ids_of(std::size_t block) const noexcept {
    return ids_.data() + block * block_size;
  }
  [[nodiscard]] std::span<const PointId> members_of(std::size_t cell) const noexcept {
    return std::span(ids_).subspan(extents_[cell].place(), extents_[cell].count);
  }
  /// How far a cell's points are from its mean at most, in bytes.
  [[nodiscard]] float radius(std::size_t cell) const noexcept { return extents_[cell].radius; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return points_.bytes() + means_.bytes() + ids_.capacity() * sizeof(PointId) +
           extents_.capacity() * sizeof(Extent) +
           (block_of_.capacity() + cell_of_.capacity()) * sizeof(std::uint32_t);
  }

  /// Makes codes for all points, which have none yet. A call that throws changes nothing.
  void take_codes(unsigned threads) {
    const auto row_of = [this](std::size_t place, std::uint8_t* row) {
      points_.get(place, row);
      return static_cast<const std::uint8_t*>(row);
    };
    points_ = CellPoints(dim_, learn_codes(*this, row_of, threads));
  }

  /// Has to be called before contains(), insert() or erase(), and before ids up to `last` are inserted. A
  /// call that throws changes nothing.
  void number_places(PointId last) {
    if (cell_of_.empty()) {
      std::vector<std::uint32_t> cell_of(blocks(), nowhere), block_of;
      for (std::size_t c = 0; c < size(); ++c)
        for (std::size_t i = 0; i < extents_[c].count; ++i) {
          const std::size_t place = extents_[c].place() + i;
          cell_of[place / block_size] = static_cast<std::uint32_t>(c);
          if (ids_[place] >= block_of.size()) block_of.resize(std::size_t{ids_[place]} + 1, nowhere);
          block_of[ids_[place]] = static_cast<std::uint32_t>(place / block_size);
        }
      block_of_ = std::move(block_of);
      cell_of_ = std::move(cell_of);
    }
    if (last >= block_of_.size()) block_of_.resize(std::size_t{last} + 1, nowhere);
  }

  [[nodiscard]] bool contains(PointId id) const noexcept {
    return id < block_of_.size() && block_of_[id] != nowhere;
  }

  /// Puts a point into the cell of the nearest mean, which splits where it has more than `most` >= 1 points
  /// then. A call that throws changes nothing. O(cells dim), and O(most dim) for a split.
  void insert(PointId id, const std::uint8_t* codes, std::size_t most) {
    mean_.set(codes, dim_);
    keys_.resize(means_.blocks() * block_size);
    means_.distances(0, means_.blocks(), mean_, keys_.data());
    const auto nearest = std::min_element(keys_.begin(), keys_.begin() + static_cast<std::ptrdiff_t>(size()));
    const auto cell = static_cast<std::size_t>(nearest - keys_.begin());
    const float reach = radius_of(*nearest);
    make_room(cell);
    if (extents_[cell].count >= most) prepare_split(cell, codes);
    put(cell, id, codes);
    extents_[cell].radius = std::max(extents_[cell].radius, reach);
    if (extents_[cell].count > most) split(cell);
  }

  /// Takes out a point that is there. A cell without points goes.
  void erase(PointId id) noexcept {
    const std::size_t block = block_of_[id];
    const std::size_t cell = cell_of_[block];
    PointId* lanes = ids_.data() + block * block_size;
    const std::size_t place =
        block * block_size + static_cast<std::size_t>(std::find(lanes, lanes + block_size, id) - lanes);
    const std::size_t last = extents_[cell].place() + --extents_[cell].count;
    if (place != last) {
      points_.copy(last, place);
      ids_[place] = ids_[last];
      block_of_[ids_[place]] = static_cast<std::uint32_t>(block);
    }
    ids_[last] = no_point;
    block_of_[id] = nowhere;
    if (extents_[cell].count == 0) remove(cell);
  }

private:
  static constexpr std::uint32_t nowhere = std::numeric_limits<std::uint32_t>::max();

  /// All that a search asks of a cell, in one place.
  struct Extent {
    std::uint32_t first;  ///< block
    std::uint32_t count;  ///< points
    std::uint32_t room;   ///< blocks
    float radius;         ///< how far its points are from the mean at most, in bytes
    [[nodiscard]] std::size_t place() const noexcept { return std::size_t{first} * block_size; }
  };

  [[nodiscard]] static std::size_t blocks_for(std::size_t count) noexcept {
    return (count + block_size - 1) / block_size;
  }
  /// Of a squared distance; rounding makes no ball too small.
  [[nodiscard]] static float radius_of(std::int32_t square) noexcept {
    return std::sqrt(static_cast<float>(square)) * 1.0001F;
  }

  /// From mean_, the cell's.
  void measure_radius(std::size_t cell) {
    keys_.resize(blocks_of(cell) * block_size);
    points_.distances(first_place(cell), extents_[cell].count, mean_, keys_.data());
    extents_[cell].radius = radius_of(
        *std::max_element(keys_.begin(), keys_.begin() + static_cast<std::ptrdiff_t>(extents_[cell].count)));
  }

  void put(std::size_t cell, PointId id, const std::uint8_t* codes) noexcept {
    const std::size_t place = extents_[cell].place() + extents_[cell].count++;
    points_.set(place, codes, means_, cell);
    ids_[place] = id;
    block_of_[id] = static_cast<std::uint32_t>(place / block_size);
  }

  /// Empty blocks behind all others, and the memory that a move needs. Returns the first.
  std::uint32_t append_blocks(std::size_t count) {
    const std::size_t first = blocks();
    points_.reserve(first + count);
    reserve_ahead(ids_, (first + count) * block_size);
    reserve_ahead(cell_of_, first + count);
    points_.resize(first + count);
    ids_.resize((first + count) * block_size, no_point);
    cell_of_.resize(first + count, nowhere);
    return static_cast<std::uint32_t>(first);
  }

  /// For one more point.
  void make_room(std::size_t cell) {
    if (extents_[cell].count < extents_[cell].room * block_size) return;
    if (unused_ > blocks() / 4) compact();
    const std::uint32_t room = extents_[cell].room + extents_[cell].room / 4 + 1;
    const std::uint32_t first = append_blocks(room);
    Extent& extent = extents_[cell];
    for (std::size_t i = 0; i < extent.count; ++i) {
      points_.copy(extent.place() + i, std::size_t{first} * block_size + i);
      move_id(extent.place() + i, std::size_t{first} * block_size + i);
    }
    unused_ += extent.room;
    extent.first = first;
    extent.room = room;
    claim(cell);
  }

  void move_id(std::size_t from, std::size_t to) noexcept {
    ids_[to] = ids_[from];
    ids_[from] = no_point;
    block_of_[ids_[to]] = static_cast<std::uint32_t>(to / block_size);
  }
  void claim(std::size_t cell) noexcept {
    std::fill_n(cell_of_.begin() + static_cast<std::ptrdiff_t>(extents_[cell].first), extents_[cell].room,
                static_cast<std::uint32_t>(cell));
  }

  /// All cells one after the other again.
  void compact() {
    const std::size_t left = blocks() - unused_;
    std::vector<PointId> ids(left * block_size, no_point);
    std::vector<std::uint32_t> cell_of(left);
    points_.rearrange(left, [&](const auto& copy) {
      std::size_t next = 0;
      for (std::size_t c = 0; c < size(); ++c) {
        Extent& extent = extents_[c];
        for (std::size_t i = 0; i < extent.count; ++i) {
          const std::size_t from = extent.place() + i, to = next * block_size + i;
          copy(from, to);
          ids[to] = ids_[from];
          block_of_[ids[to]] = static_cast<std::uint32_t>(to / block_size);
        }
        extent.first = static_cast<std::uint32_t>(next);
        std::fill_n(cell_of.begin() + static_cast<std::ptrdiff_t>(next), extent.room,
                    static_cast<std::uint32_t>(c));
        next += extent.room;
      }
    });
    ids_ = std::move(ids);
    cell_of_ = std::move(cell_of);
    unused_ = 0;
  }

  /// Finds the halves of a cell with one point more, and all memory that split() needs.
  void prepare_split(std::size_t cell, const std::uint8_t* codes) {
    const std::size_t count = extents_[cell].count;
    split_.resize((count + 1) * dim_);
    for (std::size_t i = 0; i < count; ++i) get(cell, i, &split_[i * dim_]);
    std::copy_n(codes, dim_, split_.end() - static_cast<std::ptrdiff_t>(dim_));
    halves_ = KMeansBuilder(split_, dim_, 1).build(1, rounds);
    if (halves_.size() < 2) halves_ = KMeansBuilder(split_, dim_, 1).build(1, 0);
    moving_.resize(count + 1);
    keys_.resize((blocks_for(count + 1) + means_.blocks()) * block_size);
    reserve_ahead(extents_, size() + 1);
    means_.reserve(blocks_for(size() + 1));
    const std::size_t half = halves_.first[2] - halves_.first[1];
    const auto room = static_cast<std::uint32_t>(blocks_for(half + half / 4));
    spare_ = {append_blocks(room), 0, room, 0};
  }

  /// The first half stays, the second one gets the blocks made ready.
  void split(std::size_t cell) noexcept {
    const Extent old = extents_[cell];
    const std::size_t added = size();
    std::copy_n(ids_.begin() + static_cast<std::ptrdiff_t>(old.place()), old.count, moving_.begin());
    std::fill_n(ids_.begin() + static_cast<std::ptrdiff_t>(old.place()), old.count, no_point);
    extents_[cell].count = 0;
    extents_.push_back(spare_);
    means_.resize(blocks_for(size()));
    claim(added);
    for (std::size_t half = 0; half < 2; ++half) {
      const std::size_t to = half == 0 ? cell : added;
      means_.set(to, &halves_.means[half * dim_]);
      for (std::size_t i = halves_.first[half]; i < halves_.first[half + 1]; ++i)
        put(to, moving_[halves_.order[i]], &split_[halves_.order[i] * dim_]);
      mean_.set(&halves_.means[half * dim_], dim_);
      measure_radius(to);
    }
  }

  /// The last cell takes the number of one without points.
  void remove(std::size_t cell) noexcept {
    const Extent gone = extents_[cell];
    std::fill_n(cell_of_.begin() + static_cast<std::ptrdiff_t>(gone.first), gone.room, nowhere);
    unused_ += gone.room;
    if (cell + 1 < size()) {
      extents_[cell] = extents_.back();
      means_.copy(size() - 1, cell);
      claim(cell);
    }
    extents_.pop_back();
    means_.resize(blocks_for(size()));
  }

  static constexpr unsigned rounds = 5;  ///< of moving the halves of a split to their means

  std::size_t dim_ = 0;
  ByteBlocks means_;
  CellPoints points_;
  std::vector<PointId> ids_;  ///< of each place; no_point where there is none
  std::vector<Extent> extents_;
  std::vector<std::uint32_t> block_of_;  ///< of each id
  std::vector<std::uint32_t> cell_of_;   ///< of each block
  std::size_t unused_ = 0;               ///< blocks of no cell

  // What insert() works with.
  ByteQuery mean_;
  std::vector<std::int32_t> keys_;
  std::vector<std::uint8_t> split_;
  std::vector<PointId> moving_;
  KMeans halves_;
  Extent spare_{};
};

}}}  // namespace cairn::CAIRN_ABI::detail
