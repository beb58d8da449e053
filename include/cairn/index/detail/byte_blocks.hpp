// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Points of one byte a coordinate, in memory in two ways: sixteen to a block where all are measured, each on
/// cache lines of its own where a few are picked out.
///
///   ByteBlocks   block 0: ceil(dim / 4) lines of 64 bytes (byte_kernels.hpp) | block 1 | ...
///                beside them a whole number a point, |p|^2 - 256 sum(p)
///   ByteRows     row 0, filled up to a multiple of 64 bytes | row 1 | ...
///
/// A point has a place: block place / 16, lane place % 16. Writing and reading one is O(dim), a distance
/// O(dim) over the sixteen that share its instructions.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include <cairn/core/sizes.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/byte_kernels.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Memory for at least `count` numbers, so that many calls with a few more each cost O(1) a number.
template <class Numbers>
void reserve_ahead(Numbers& numbers, std::size_t count) {
  const std::size_t old = numbers.capacity();
  if (count > old) numbers.reserve(std::max(count, old + old / 4));
}

/// Points of bytes, sixteen to a block.
class ByteBlocks {
public:
  ByteBlocks() = default;

  /// Room for some blocks, not yet written.
  ByteBlocks(std::size_t dim, std::size_t blocks)
      : dim_(dim),
        codes_(room_for(blocks, groups() * 64, "DescriptorIndex")),
        constants_(room_for(blocks, block_size, "DescriptorIndex")) {}

  /// Of `count` points, at least one, row_of(i) being the bytes of point i; the last block repeats the last.
  template <class RowOf>
  [[nodiscard]] static ByteBlocks of_rows(std::size_t dim, std::size_t count, const RowOf& row_of) {
    ByteBlocks result(dim, count / block_size + (count % block_size != 0));
    for (std::size_t place = 0; place < result.blocks() * block_size; ++place)
      result.set(place, row_of(std::min(place, count - 1)));
    return result;
  }

  [[nodiscard]] std::size_t blocks() const noexcept { return constants_.size() / block_size; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return codes_.capacity() + constants_.capacity() * sizeof(std::int32_t);
  }

  /// Writes point `place` (block place / 16, lane place % 16): dim bytes.
  void set(std::size_t place, const std::uint8_t* point) noexcept {
    std::uint8_t* lane = codes_.data() + first_byte(place);
    std::int32_t square = 0, sum = 0;
    for (std::size_t a = 0; a < groups() * lane_axes; ++a) {
      const std::uint8_t code = a < dim_ ? point[a] : std::uint8_t{0};
      lane[a / lane_axes * 64 + a % lane_axes] = code;
      square += code * code;
      sum += code;
    }
    constants_[place] = square - 256 * sum;
  }

  /// Reads the dim bytes of point `place`.
  void get(std::size_t place, std::uint8_t* point) const noexcept {
    for (std::size_t a = 0; a < dim_; ++a)
      point[a] = codes_[first_byte(place) + a / lane_axes * 64 + a % lane_axes];
  }

  /// Writes point `to` as point `from` of blocks of the same dimension.
  void copy_from(const ByteBlocks& other, std::size_t from, std::size_t to) noexcept {
    for (std::size_t group = 0; group < groups(); ++group)
      std::memcpy(&codes_[first_byte(to) + group * 64], &other.codes_[first_byte(from) + group * 64],
                  lane_axes);
    constants_[to] = other.constants_[from];
  }
  void copy(std::size_t from, std::size_t to) noexcept { copy_from(*this, from, to); }

  /// Memory for so many blocks, so that a resize() to them cannot throw.
  void reserve(std::size_t blocks) {
    reserve_ahead(codes_, room_for(blocks, groups() * 64, "DescriptorIndex"));
    reserve_ahead(constants_, room_for(blocks, block_size, "DescriptorIndex"));
  }
  /// Further blocks are zeros.
  void resize(std::size_t blocks) {
    codes_.resize(room_for(blocks, groups() * 64, "DescriptorIndex"));
    constants_.resize(blocks * block_size);
  }

  /// Squared distances of the points of blocks first ... first + count - 1.
  void distances(std::size_t first, std::size_t count, const ByteQuery& query,
                 std::int32_t* distances) const noexcept {
    const ByteBlockRange range{codes_.data() + first * groups() * 64, constants_.data() + first * block_size,
                               groups(), count};
    byte_distances(range, query, distances);
  }

  /// Asks for some blocks ahead of their use; the processor follows by itself from a few kilobytes on.
  void prefetch(std::size_t first, std::size_t count) const noexcept {
    const std::uint8_t* line = codes_.data() + first * groups() * 64;
    const std::size_t lines = std::min<std::size_t>(count * groups(), 64);
    for (std::size_t i = 0; i < lines; ++i) __builtin_prefetch(line + 64 * i);
  }

private:
  [[nodiscard]] std::size_t groups() const noexcept { return (dim_ + lane_axes - 1) / lane_axes; }
  [[nodiscard]] std::size_t first_byte(std::size_t place) const noexcept {
    return place / block_size * groups() * 64 + place % block_size * lane_axes;
  }

  std::size_t dim_ = 0;
  AlignedVector<std::uint8_t> codes_;
  AlignedVector<std::int32_t> constants_;
};

/// Points of bytes, each on cache lines of its own: for the few whose distance is asked for one by one.
class ByteRows {
public:
  ByteRows() = default;
  ByteRows(std::size_t dim, std::size_t count)
      : dim_(dim), data_(room_for(count, stride(), "DescriptorIndex")) {}

  [[nodiscard]] std::size_t bytes() const noexcept { return data_.capacity(); }
  void set(std::size_t place, const std::uint8_t* row) noexcept {
    std::memcpy(data_.data() + place * stride(), row, dim_);
  }
  [[nodiscard]] const std::uint8_t* row(std::size_t place) const noexcept {
    return data_.data() + place * stride();
  }
  void reserve(std::size_t count) { reserve_ahead(data_, room_for(count, stride(), "DescriptorIndex")); }
  void resize(std::size_t count) { data_.resize(count * stride()); }
  void prefetch(std::size_t place) const noexcept {
    for (std::size_t byte = 0; byte < stride(); byte += 64) __builtin_prefetch(row(place) + byte);
  }

  /// distances[i] = that of row places[i].
  void distances(const std::uint32_t* places, std::size_t count, const ByteQuery& query,
                 std::int32_t* distances) const noexcept {
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint8_t* here = row(places[i]);
        const std::uint8_t* there = query.codes();
        std::int32_t sum = 0;
        for (std::size_t a = 0; a < dim_; ++a) {
          const int difference = here[a] - there[a];
          sum += difference * difference;
        }
        distances[i] = sum;
      }
    });
  }

private:
  [[nodiscard]] std::size_t stride() const noexcept { return (dim_ + 63) / 64 * 64; }

  std::size_t dim_ = 0;
  AlignedVector<std::uint8_t> data_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
