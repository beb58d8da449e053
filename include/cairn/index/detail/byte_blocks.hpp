// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Points of one byte a coordinate, sixteen to a block, and their squared distances in whole numbers.
///
/// A block holds four coordinates of the first point, the same four of the second, and so on, then the next
/// four: each lane of 32 bits belongs to one point. Where the processor multiplies and adds bytes (AVX-512
/// VNNI), |p - q|^2 = |p|^2 + |q|^2 - 2 p.q takes one instruction for four coordinates of sixteen points;
/// elsewhere differences are squared in 16 bits. Whole numbers: every path gives the same bits.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <cairn/core/sizes.hpp>
#include <cairn/index/detail/block_lanes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Most coordinates whose squared distances fit 32 bits, on all ways to them.
inline constexpr std::size_t most_byte_axes = 16384;

/// What one lane of a block holds.
inline constexpr std::size_t lane_axes = 4;

/// Writes sixteen whole numbers from 0 to 255 as bytes, in two steps: gcc 12 takes them apart one by one.
[[gnu::always_inline]] inline void store_bytes(const Block<std::int32_t>& numbers,
                                               std::uint8_t* to) noexcept {
#if defined(__x86_64__)
  __m128i quarter[4];
  std::memcpy(quarter, &numbers, sizeof(numbers));
  const __m128i low = _mm_packs_epi32(quarter[0], quarter[1]);
  const __m128i high = _mm_packs_epi32(quarter[2], quarter[3]);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm_packus_epi16(low, high));
#else
  const auto halves = __builtin_convertvector(numbers, Block<std::int16_t>);
  const auto bytes = __builtin_convertvector(halves, Block<std::uint8_t>);
  std::memcpy(to, &bytes, sizeof(bytes));
#endif
}

/// A point that distances are taken from.
class ByteQuery {
public:
  ByteQuery() = default;

  void set(const std::uint8_t* codes, std::size_t dim) {
    const std::size_t padded = (dim + block_size - 1) / block_size * block_size;
    codes_.resize(padded);
    shifted_.resize(padded);
    std::uint8_t* own = codes_.data();
    std::int8_t* shifted = shifted_.data();
    std::fill(own + dim, own + padded, std::uint8_t{0});
    std::memcpy(own, codes, dim);
    std::int32_t square = 0;
    with_widest_lanes([&]() CAIRN_INLINED {
      Block<std::int32_t> squares{};
      for (std::size_t a = 0; a < padded; a += block_size) {
        Block<std::int32_t> numbers;
        Block<std::uint8_t> bytes;
        load_block<std::int32_t>(own + a, numbers);
        std::memcpy(&bytes, own + a, sizeof(bytes));
        squares += numbers * numbers;
        bytes ^= 128;  // less 128
        std::memcpy(shifted + a, &bytes, sizeof(bytes));
      }
      for (std::size_t i = 0; i < block_size; ++i) square += squares[i];
    });
    square_ = square;
  }

  [[nodiscard]] const std::uint8_t* codes() const noexcept { return codes_.data(); }
  /// Less 128: the signed operand of byte products.
  [[nodiscard]] const std::int8_t* shifted() const noexcept { return shifted_.data(); }
  [[nodiscard]] std::int32_t square() const noexcept { return square_; }

private:
  std::vector<std::uint8_t> codes_;
  std::vector<std::int8_t> shifted_;
  std::int32_t square_ = 0;
};

/// Blocks in memory, for the kernels: `groups` lines of 64 bytes each, and |p|^2 - 256 (sum of p) a point.
struct ByteBlockRange {
  const std::uint8_t* codes;
  const std::int32_t* constants;
  std::size_t groups;
  std::size_t count;
};

#if defined(__x86_64__)
/// Four coordinates of the query in every lane.
[[nodiscard, gnu::always_inline]] inline std::int32_t lane_of(const void* coordinates,
                                                              std::size_t group) noexcept {
  std::int32_t four = 0;
  std::memcpy(&four, static_cast<const char*>(coordinates) + group * lane_axes, sizeof(four));
  return four;
}

[[CAIRN_TARGET(AVX512_VNNI)]] inline void byte_distances_vnni(const ByteBlockRange& blocks,
                                                              const ByteQuery& query,
                                                              std::int32_t* distances) noexcept {
  const std::uint8_t* line = blocks.codes;
  const __m512i square = _mm512_set1_epi32(query.square());
  for (std::size_t block = 0; block < blocks.count; ++block) {
    __m512i product = _mm512_setzero_si512();  // two sums, to hide the latency of one
    __m512i other = _mm512_setzero_si512();
    std::size_t group = 0;
    for (; group + 1 < blocks.groups; group += 2, line += 128) {
      product = _mm512_dpbusd_epi32(product, _mm512_loadu_si512(line),
                                    _mm512_set1_epi32(lane_of(query.shifted(), group)));
      other = _mm512_dpbusd_epi32(other, _mm512_loadu_si512(line + 64),
                                  _mm512_set1_epi32(lane_of(query.shifted(), group + 1)));
    }
    if (group < blocks.groups) {
      product = _mm512_dpbusd_epi32(product, _mm512_loadu_si512(line),
                                    _mm512_set1_epi32(lane_of(query.shifted(), group)));
      line += 64;
    }
    product = _mm512_add_epi32(product, other);
    const __m512i constant = _mm512_loadu_si512(blocks.constants + block * block_size);
    _mm512_storeu_si512(distances + block * block_size, _mm512_sub_epi32(_mm512_add_epi32(constant, square),
                                                                         _mm512_add_epi32(product, product)));
  }
}

/// Squared differences of eight points' four coordinates from the query's.
[[nodiscard, CAIRN_TARGET(AVX2), gnu::always_inline]] inline __m256i byte_squares_avx2(
    const std::uint8_t* line, const __m256i& even_from, const __m256i& odd_from) noexcept {
  const __m256i codes = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(line));
  const __m256i even = _mm256_sub_epi16(_mm256_and_si256(codes, _mm256_set1_epi16(255)), even_from);
  const __m256i odd = _mm256_sub_epi16(_mm256_srli_epi16(codes, 8), odd_from);
  return _mm256_add_epi32(_mm256_madd_epi16(even, even), _mm256_madd_epi16(odd, odd));
}

[[CAIRN_TARGET(AVX2)]] inline void byte_distances_avx2(const ByteBlockRange& blocks, const ByteQuery& query,
                                                       std::int32_t* distances) noexcept {
  const std::uint8_t* line = blocks.codes;
  for (std::size_t block = 0; block < blocks.count; ++block) {
    __m256i low = _mm256_setzero_si256(), high = _mm256_setzero_si256();
    for (std::size_t group = 0; group < blocks.groups; ++group, line += 64) {
      const __m256i from = _mm256_set1_epi32(lane_of(query.codes(), group));
      const __m256i even_from = _mm256_and_si256(from, _mm256_set1_epi16(255));
      const __m256i odd_from = _mm256_srli_epi16(from, 8);
      low = _mm256_add_epi32(low, byte_squares_avx2(line, even_from, odd_from));
      high = _mm256_add_epi32(high, byte_squares_avx2(line + 32, even_from, odd_from));
    }
    std::int32_t* to = distances + block * block_size;
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), low);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + 8), high);
  }
}
#endif

inline void byte_distances_plain(const ByteBlockRange& blocks, const ByteQuery& query,
                                 std::int32_t* distances) noexcept {
  using Halves = Lanes<std::uint16_t, 2 * block_size>;
  using Wholes = Block<std::uint32_t>;
  const std::uint8_t* line = blocks.codes;
  for (std::size_t block = 0; block < blocks.count; ++block) {
    Wholes sums{};
    for (std::size_t group = 0; group < blocks.groups; ++group, line += 64) {
      const std::uint8_t* from = query.codes() + group * lane_axes;
      Wholes lanes;
      std::memcpy(&lanes, line, sizeof(lanes));
      const Wholes even_from = Wholes{} + (from[0] | std::uint32_t{from[2]} << 16);
      const Wholes odd_from = Wholes{} + (from[1] | std::uint32_t{from[3]} << 16);
      // No difference of bytes exceeds 255: its square fits 16 bits, whatever the sign that was lost.
      const Halves even = Halves(lanes & 0x00ff00ffU) - Halves(even_from);
      const Halves odd = Halves((lanes >> 8) & 0x00ff00ffU) - Halves(odd_from);
      const Wholes even_squares = Wholes(even * even);
      const Wholes odd_squares = Wholes(odd * odd);
      sums += (even_squares & 0xffffU) + (even_squares >> 16) + (odd_squares & 0xffffU) + (odd_squares >> 16);
    }
    std::memcpy(distances + block * block_size, &sums, sizeof(sums));
  }
}

/// Memory for at least `count` numbers, so that many calls with a few more each cost O(1) a number.
template <class Numbers>
void reserve_ahead(Numbers& numbers, std::size_t count) {
  const std::size_t old = numbers.capacity();
  if (count > old) numbers.reserve(std::max(count, old + old / 4));
}

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
#if defined(__x86_64__)
    if (processor() >= Processor::avx512_vnni) return byte_distances_vnni(range, query, distances);
    if (processor() >= Processor::avx2) return byte_distances_avx2(range, query, distances);
#endif
    byte_distances_plain(range, query, distances);
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

/// Whole numbers in ascending order, one at a time, as many as are asked for; equal ones by their place.
class SmallestFirst {
public:
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  static constexpr std::int32_t taken = std::numeric_limits<std::int32_t>::max();

  /// Room for `count` numbers, all below `taken`, to be written to keys() before reset(). Up to a multiple of
  /// sixteen more may be written, and are forgotten.
  void resize(std::size_t count) {
    const std::size_t blocks = (count + block_size - 1) / block_size;
    keys_.resize(blocks * block_size);
    minima_.assign((blocks + block_size - 1) / block_size * block_size, taken);
    taken_keys_.resize(keys_.size() + block_size, 0);
    taken_places_.resize(keys_.size() + block_size);
    sorted_.resize(keys_.size());
    count_ = count;
  }
  [[nodiscard]] std::int32_t* keys() noexcept { return keys_.data(); }

  void reset() noexcept {
    for (std::size_t i = count_; i < keys_.size(); ++i) keys_[i] = taken;
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t b = 0; b < keys_.size() / block_size; ++b) minima_[b] = smallest_of(keys_, b);
    });
    sorted_count_ = 0;
    given_ = 0;
  }

  struct Item {
    std::size_t place;
    std::int32_t key;
  };
  /// The next; place is none where all were given. O(count / 256) and the share of a sort.
  [[nodiscard]] Item next() noexcept {
    if (given_ == sorted_count_) sort_some();
    if (given_ == sorted_count_) return {none, taken};
    return sorted_[given_++];
  }

private:
  using Numbers = AlignedVector<std::int32_t>;
  static constexpr std::size_t some = 10;
  static constexpr std::size_t four = 4;

  [[gnu::always_inline]] static std::int32_t smallest_of(const Numbers& numbers, std::size_t block) noexcept {
    Block<std::int32_t> here;
    load_block<std::int32_t>(numbers.data() + block * block_size, here);
    return smallest<std::int32_t>(here);
  }

  /// Takes out all numbers up to one that at least `some` do not exceed, if so many are left: of the minima
  /// of sixteen parts the one of that rank. A few dozen as a rule.
  void sort_some() noexcept {
    sorted_count_ = 0;
    given_ = 0;
    with_widest_lanes([&]() CAIRN_INLINED {
      Block<std::int32_t> low = Block<std::int32_t>{} + taken;
      for (std::size_t g = 0; g < minima_.size(); g += block_size) {
        Block<std::int32_t> here;
        load_block<std::int32_t>(minima_.data() + g, here);
        low = here < low ? here : low;
      }
      Block<std::int32_t> below{};  // how many of the parts are below each
      std::int32_t part[block_size];
      std::memcpy(part, &low, sizeof(low));
      for (std::size_t i = 0; i < block_size; ++i) below -= Block<std::int32_t>{} + part[i] < low;
      const Block<std::int32_t> candidates =
          below < Block<std::int32_t>{} + static_cast<std::int32_t>(some) ? low : Block<std::int32_t>{} - 1;
      const std::int32_t most = std::min(-smallest<std::int32_t>(-candidates), taken - 1);
      for (std::size_t g = 0; g < minima_.size(); g += block_size) {
        Block<std::int32_t> here;
        load_block<std::int32_t>(minima_.data() + g, here);
        for (unsigned mask = mask_below<std::int32_t>(here, most + 1); mask != 0; mask &= mask - 1)
          take(g + static_cast<std::size_t>(std::countr_zero(mask)), most);
      }
      sort_taken();
    });
  }
  /// Four at a time, whether there are so many or not: who would ask after each is told wrong too often.
  [[gnu::always_inline]] void take(std::size_t block, std::int32_t most) noexcept {
    std::int32_t* const keys = keys_.data() + block * block_size;
    Block<std::int32_t> here;
    load_block<std::int32_t>(keys, here);
    const unsigned below = mask_below<std::int32_t>(here, most + 1);
    std::size_t to = sorted_count_;
    for (unsigned left = below; left != 0;)
      for (std::size_t i = 0; i < four; ++i, ++to, left &= left - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(left)) % block_size;
        taken_keys_[to] = keys[lane];
        taken_places_[to] = static_cast<std::uint32_t>(block * block_size + lane);
      }
    sorted_count_ += static_cast<std::size_t>(std::popcount(below));
    here = here < Block<std::int32_t>{} + (most + 1) ? Block<std::int32_t>{} + taken : here;
    std::memcpy(keys, &here, sizeof(here));
    minima_[block] = smallest<std::int32_t>(here);
  }
  /// By counting for each who comes before it, sixteen at a time and without a branch: they are few.
  [[gnu::always_inline]] void sort_taken() noexcept {
    if (sorted_count_ > 16 * block_size) {
      for (std::size_t i = 0; i < sorted_count_; ++i) sorted_[i] = {taken_places_[i], taken_keys_[i]};
      const auto before = [](const Item& a, const Item& b) {
        return a.key != b.key ? a.key < b.key : a.place < b.place;
      };
      std::sort(sorted_.begin(), sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_count_), before);
      return;
    }
    Block<std::int32_t> numbers;
    for (std::size_t i = 0; i < block_size; ++i) numbers[i] = static_cast<std::int32_t>(i);
    for (std::size_t begin = 0; begin < sorted_count_; begin += block_size) {
      Block<std::int32_t> keys, ranks{};
      load_block<std::int32_t>(taken_keys_.data() + begin, keys);
      // Of equals the one that was taken out first, whose place is lower.
      for (std::size_t j = 0; j < begin; ++j) ranks -= Block<std::int32_t>{} + taken_keys_[j] <= keys;
      for (std::size_t j = begin; j < std::min(begin + block_size, sorted_count_); ++j) {
        const Block<std::int32_t> later =
            numbers > Block<std::int32_t>{} + static_cast<std::int32_t>(j - begin);
        ranks -= Block<std::int32_t>{} + taken_keys_[j] < keys - later;
      }
      for (std::size_t j = begin + block_size; j < sorted_count_; ++j)
        ranks -= Block<std::int32_t>{} + taken_keys_[j] < keys;
      std::int32_t rank[block_size];
      std::memcpy(rank, &ranks, sizeof(ranks));
      const std::size_t size = std::min(block_size, sorted_count_ - begin);
      for (std::size_t i = 0; i < size; ++i)
        sorted_[static_cast<std::size_t>(rank[i])] = {taken_places_[begin + i], taken_keys_[begin + i]};
    }
  }

  std::size_t count_ = 0;
  Numbers keys_;
  Numbers minima_;      ///< of sixteen keys each
  Numbers taken_keys_;  ///< by place
  AlignedVector<std::uint32_t> taken_places_;
  std::vector<Item> sorted_;  ///< the same by key
  std::size_t sorted_count_ = 0;
  std::size_t given_ = 0;  ///< of them
};

}}}  // namespace cairn::CAIRN_ABI::detail
