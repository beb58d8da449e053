// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Squared distances of bytes in whole numbers: a query from sixteen points at a time, one function for each
/// kind of processor. Every one of them gives the same bits.
///
/// A block is `groups` lines of 64 bytes. Line g holds coordinates 4 g ... 4 g + 3 of its sixteen points, so
/// that each lane of 32 bits belongs to one point, and all a query has to be is the same four bytes in every
/// lane (p_a: coordinate a of point p; those beyond the dimension are 0):
///
///   line 0    0_0 0_1 0_2 0_3 | 1_0 1_1 1_2 1_3 | ... | 15_0 15_1 15_2 15_3
///   line 1    0_4 0_5 0_6 0_7 | 1_4 1_5 1_6 1_7 | ... | 15_4 15_5 15_6 15_7
///
/// - AVX-512 VNNI multiplies an unsigned byte by a signed one and adds four such products to a lane. With
///   s = q - 128, |p - q|^2 = (|p|^2 - 256 sum(p)) + |q|^2 - 2 p.s: the bracket is a number of the point that
///   is kept beside it, and four coordinates of sixteen points take one instruction.
/// - AVX2 and all others take differences of 16 bits, the even and the odd bytes of a lane for themselves.
///
/// O(groups) a block, reads each of its bytes once.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <cairn/index/detail/block_lanes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Most coordinates whose squared distances fit 32 bits, on all ways to them.
inline constexpr std::size_t most_byte_axes = 16384;

/// What one lane of a block holds.
inline constexpr std::size_t lane_axes = 4;

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
    const std::size_t whole = dim / block_size * block_size;
    std::fill(own + whole, own + padded, std::uint8_t{0});
    std::copy(codes + whole, codes + dim, own + whole);
    std::int32_t square = 0;
    with_widest_lanes([&]() CAIRN_INLINED {
      Block<std::int32_t> squares{};
      // Read by blocks, as they were written a moment ago: a wider load would wait until that is through.
      for (std::size_t a = 0; a < padded; a += block_size) {
        Block<std::uint8_t> bytes;
        std::memcpy(&bytes, a < whole ? codes + a : own + a, sizeof(bytes));
        // In two steps, which gcc 12 knows how to widen.
        const auto halves = __builtin_convertvector(bytes, Block<std::int16_t>);
        const auto numbers = __builtin_convertvector(halves, Block<std::int32_t>);
        squares += numbers * numbers;
        std::memcpy(own + a, &bytes, sizeof(bytes));
        bytes ^= 128;  // less 128
        std::memcpy(shifted + a, &bytes, sizeof(bytes));
      }
      square = sum_of(squares);
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

/// distances[i] = that of point i of the blocks, by what the processor has.
inline void byte_distances(const ByteBlockRange& blocks, const ByteQuery& query,
                           std::int32_t* distances) noexcept {
#if defined(__x86_64__)
  if (processor() >= Processor::avx512_vnni) return byte_distances_vnni(blocks, query, distances);
  if (processor() >= Processor::avx2) return byte_distances_avx2(blocks, query, distances);
#endif
  byte_distances_plain(blocks, query, distances);
}

}}}  // namespace cairn::CAIRN_ABI::detail
