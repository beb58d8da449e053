// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Points of bytes in cells around means that take in points, lose them and split.
///
/// The points of a cell stand in blocks of its own, one after the other, the last one filled up with
/// no_point. A cell that outgrows its blocks moves behind all others; what is left empty is given up once it
/// is a quarter of all. With codes (product_codes.hpp) the blocks hold those, and the bytes stand in the same
/// order point by point: they are asked for one by one. Where a point stands is written down from the first
/// change on: an index that never changes pays nothing for it.
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
#include <cairn/index/detail/k_means.hpp>
#include <cairn/index/detail/product_codes.hpp>

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
      learn_codes(row_of, threads);
    } else {
      members_ = ByteBlocks(dim, blocks);
      for (std::size_t place = 0; place < ids_.size(); ++place)
        if (row_at[place] != nullptr) members_.set(place, row_at[place]);
    }
    for (std::size_t c = 0; c < cells.size(); ++c) {
      mean_.set(mean_of(c), dim);
      measure_radius(c);
    }
  }

  [[nodiscard]] std::size_t size() const noexcept { return extents_.size(); }
  [[nodiscard]] const ByteBlocks& means() const noexcept { return means_; }
  /// Of all places, where there are no codes.
  [[nodiscard]] const ByteBlocks& members() const noexcept { return members_; }
  [[nodiscard]] bool coded() const noexcept { return !codebook_.empty(); }
  [[nodiscard]] const ProductCodebook& codebook() const noexcept { return codebook_; }
  /// Of all places, where there are codes.
  [[nodiscard]] const CodeBlocks& codes() const noexcept { return codes_; }
  /// Of all places, where there are codes.
  [[nodiscard]] const ByteRows& rows() const noexcept { return rows_; }
  /// Root mean square of (q - p).e over |q - p| |e| (product_codes.hpp).
  [[nodiscard]] float spread() const noexcept { return spread_; }
  /// Reads the bytes of point i of a cell.
  void get(std::size_t cell, std::size_t i, std::uint8_t* row) const noexcept {
    get_at(extents_[cell].place() + i, row);
  }
  [[nodiscard]] std::size_t first_block(std::size_t cell) const noexcept { return extents_[cell].first; }
  [[nodiscard]] std::size_t blocks_of(std::size_t cell) const noexcept {
    return blocks_for(extents_[cell].count);
  }
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
    return members_.bytes() + codes_.bytes() + rows_.bytes() + codebook_.bytes() + means_.bytes() +
           ids_.capacity() * sizeof(PointId) + extents_.capacity() * sizeof(Extent) +
           (block_of_.capacity() + cell_of_.capacity()) * sizeof(std::uint32_t);
  }

  /// Makes codes for all points, which have none yet. A call that throws changes nothing.
  void take_codes(unsigned threads) {
    learn_codes(
        [this](std::size_t place, std::uint8_t* row) {
          members_.get(place, row);
          return static_cast<const std::uint8_t*>(row);
        },
        threads);
    members_ = ByteBlocks();
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
      copy(last, place);
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

  [[nodiscard]] std::size_t blocks() const noexcept { return ids_.size() / block_size; }

  void get_at(std::size_t place, std::uint8_t* row) const noexcept {
    if (coded())
      std::copy_n(rows_.row(place), dim_, row);
    else
      members_.get(place, row);
  }
  void copy(std::size_t from, std::size_t to) noexcept {
    if (coded()) {
      codes_.copy_from(codes_, from, to);
      rows_.set(to, rows_.row(from));
    } else {
      members_.copy(from, to);
    }
  }

  /// Codes of all points; row_of(place, scratch) gives the bytes of one.
  template <class RowOf>
  void learn_codes(const RowOf& row_of, unsigned threads);
  /// What points of the index meet in the nearest cell that is not theirs.
  struct Spread {
    float of_products = 1;     ///< root mean square of (q - p).e over |q - p| |e|
    float largest_number = 1;  ///< and half as much again
    float largest_missed = 1;
  };
  template <class RowOf>
  [[nodiscard]] Spread measure_spread(const ProductCodebook& codebook, const RowOf& row_of) const;

  /// From mean_, the cell's.
  void measure_radius(std::size_t cell) {
    keys_.resize(blocks_of(cell) * block_size);
    std::uint32_t place = static_cast<std::uint32_t>(extents_[cell].place());
    if (coded())
      for (std::size_t i = 0; i < extents_[cell].count; ++i, ++place)
        rows_.distances(&place, 1, mean_, &keys_[i]);
    else
      members_.distances(extents_[cell].first, blocks_of(cell), mean_, keys_.data());
    extents_[cell].radius = radius_of(
        *std::max_element(keys_.begin(), keys_.begin() + static_cast<std::ptrdiff_t>(extents_[cell].count)));
  }

  void put(std::size_t cell, PointId id, const std::uint8_t* codes) noexcept {
    const std::size_t place = extents_[cell].place() + extents_[cell].count++;
    if (coded()) {
      rows_.set(place, codes);
      means_.get(cell, coder_.mean.data());
      coder_.encode(codebook_, codes);
      codes_.set(place, coder_.point);
    } else {
      members_.set(place, codes);
    }
    ids_[place] = id;
    block_of_[id] = static_cast<std::uint32_t>(place / block_size);
  }

  /// Empty blocks behind all others, and the memory that a move needs. Returns the first.
  std::uint32_t append_blocks(std::size_t count) {
    const std::size_t first = blocks();
    reserve(first + count);
    reserve_ahead(ids_, (first + count) * block_size);
    reserve_ahead(cell_of_, first + count);
    if (coded()) {
      codes_.resize(first + count);
      rows_.resize((first + count) * block_size);
    } else {
      members_.resize(first + count);
    }
    ids_.resize((first + count) * block_size, no_point);
    cell_of_.resize(first + count, nowhere);
    return static_cast<std::uint32_t>(first);
  }

  void reserve(std::size_t blocks) {
    if (coded()) {
      codes_.reserve(blocks);
      rows_.reserve(blocks * block_size);
    } else {
      members_.reserve(blocks);
    }
  }

  /// For one more point.
  void make_room(std::size_t cell) {
    if (extents_[cell].count < extents_[cell].room * block_size) return;
    if (unused_ > blocks() / 4) compact();
    const std::uint32_t room = extents_[cell].room + extents_[cell].room / 4 + 1;
    const std::uint32_t first = append_blocks(room);
    Extent& extent = extents_[cell];
    for (std::size_t i = 0; i < extent.count; ++i) {
      copy(extent.place() + i, std::size_t{first} * block_size + i);
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
    ByteBlocks members(dim_, coded() ? 0 : left);
    CodeBlocks codes = codes_.of_size(coded() ? left : 0);
    ByteRows rows(dim_, coded() ? left * block_size : 0);
    std::vector<PointId> ids(left * block_size, no_point);
    std::vector<std::uint32_t> cell_of(left);
    std::size_t next = 0;
    for (std::size_t c = 0; c < size(); ++c) {
      Extent& extent = extents_[c];
      for (std::size_t i = 0; i < extent.count; ++i) {
        if (coded()) {
          codes.copy_from(codes_, extent.place() + i, next * block_size + i);
          rows.set(next * block_size + i, rows_.row(extent.place() + i));
        } else {
          members.copy_from(members_, extent.place() + i, next * block_size + i);
        }
        ids[next * block_size + i] = ids_[extent.place() + i];
        block_of_[ids[next * block_size + i]] = static_cast<std::uint32_t>(next + i / block_size);
      }
      extent.first = static_cast<std::uint32_t>(next);
      std::fill_n(cell_of.begin() + static_cast<std::ptrdiff_t>(next), extent.room,
                  static_cast<std::uint32_t>(c));
      next += extent.room;
    }
    members_ = std::move(members);
    codes_ = std::move(codes);
    rows_ = std::move(rows);
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
  ByteBlocks members_;
  ProductCodebook codebook_;
  CodeBlocks codes_;
  ByteRows rows_;
  float spread_ = 1;
  std::vector<PointId> ids_;  ///< of each place; no_point where there is none
  std::vector<Extent> extents_;
  std::vector<std::uint32_t> block_of_;  ///< of each id
  std::vector<std::uint32_t> cell_of_;   ///< of each block
  std::size_t unused_ = 0;               ///< blocks of no cell

  // What insert() works with.
  ByteQuery mean_;
  std::vector<std::int32_t> keys_;
  std::vector<std::uint8_t> split_;
  CodeWriter coder_;
  std::vector<PointId> moving_;
  KMeans halves_;
  Extent spare_{};
};

template <class RowOf>
void ByteCells::learn_codes(const RowOf& row_of, unsigned threads) {
  constexpr std::size_t most = 4096;  // differences to learn from
  std::size_t points = 0;
  for (const Extent& extent : extents_) points += extent.count;
  const std::size_t step = std::max<std::size_t>(1, points / most);
  std::vector<float> origin(dim_, 0), sample;
  std::vector<std::uint8_t> mean(dim_), scratch(dim_);
  std::size_t counted = 0;
  for (std::size_t c = 0; c < size(); ++c) {
    means_.get(c, mean.data());
    for (std::size_t a = 0; a < dim_; ++a)
      origin[a] += static_cast<float>(mean[a]) / static_cast<float>(size());
    for (std::size_t i = 0; i < extents_[c].count; ++i)
      if (counted++ % step == 0) {
        const std::uint8_t* row = row_of(extents_[c].place() + i, scratch.data());
        for (std::size_t a = 0; a < dim_; ++a) sample.push_back(static_cast<float>(row[a] - mean[a]));
      }
  }
  ProductCodebook codebook(dim_, origin, sample, threads);
  CodeWriter writer(codebook);
  Spread spread = measure_spread(codebook, row_of);
  CodeBlocks codes(codebook.groups(), blocks(), spread.largest_number, spread.largest_missed);
  ByteRows rows(dim_, ids_.size());
  parallel_for(size(), threads, [&](std::size_t begin, std::size_t end) {
    CodeWriter mine(codebook);
    std::vector<std::uint8_t> bytes(dim_);
    for (std::size_t c = begin; c < end; ++c) {
      means_.get(c, mine.mean.data());
      for (std::size_t i = 0; i < extents_[c].count; ++i) {
        const std::size_t place = extents_[c].place() + i;
        const std::uint8_t* row = row_of(place, bytes.data());
        mine.encode(codebook, row);
        codes.set(place, mine.point);
        rows.set(place, row);
      }
    }
  });
  codebook_ = std::move(codebook);
  codes_ = std::move(codes);
  rows_ = std::move(rows);
  coder_ = std::move(writer);
  spread_ = spread.of_products;
}

template <class RowOf>
ByteCells::Spread ByteCells::measure_spread(const ProductCodebook& codebook, const RowOf& row_of) const {
  constexpr std::size_t queries = 64;
  CodeWriter writer(codebook);
  ByteQuery query;
  std::vector<std::uint8_t> row(dim_), bytes(dim_);
  std::vector<std::int32_t> keys(means_.blocks() * block_size);
  double sum = 0, terms = 0;
  Spread spread;
  for (std::size_t i = 0; i < std::min(queries, size()); ++i) {
    const std::size_t own = i * size() / std::min(queries, size());
    const std::uint8_t* point = row_of(extents_[own].place(), row.data());
    query.set(point, dim_);
    means_.distances(0, means_.blocks(), query, keys.data());
    if (size() > 1) keys[own] = std::numeric_limits<std::int32_t>::max();
    const auto next = static_cast<std::size_t>(
        std::min_element(keys.begin(), keys.begin() + static_cast<std::ptrdiff_t>(size())) - keys.begin());
    means_.get(next, writer.mean.data());
    for (std::size_t k = 0; k < extents_[next].count; ++k) {
      const std::uint8_t* other = row_of(extents_[next].place() + k, bytes.data());
      writer.encode(codebook, other);
      spread.largest_number = std::max(spread.largest_number, 1.5F * std::abs(writer.point.number));
      spread.largest_missed = std::max(spread.largest_missed, 1.5F * writer.point.missed);
      double product = 0, square = 0;
      for (std::size_t a = 0; a < dim_; ++a) {
        const double apart = point[a] - other[a];
        product += apart * double{writer.missed()[codebook.place_of(a)]};
        square += apart * apart;
      }
      const double both = square * double{writer.point.missed} * double{writer.point.missed};
      if (both > 0) sum += product * product / both;
      terms += both > 0;
    }
  }
  if (terms > 0) spread.of_products = static_cast<float>(std::sqrt(sum / terms));
  return spread;
}

}}}  // namespace cairn::CAIRN_ABI::detail
