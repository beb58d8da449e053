// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// From product codes in memory to estimates of distances, and from those to who may be near: a block of
/// sixteen points at a time, one function for each kind of processor.
///
/// A block is `lines` lines of 64 bytes with codes, for eight groups each, and one with the points' numbers.
/// Byte 16 j + i of line l holds two codes of point i, so that sixteen look-ups are one shuffle of a
/// register:
///
///   line l    j = 0: points 0 ... 15 | j = 1 | j = 2 | j = 3      low half: group 8 l + j
///                                                                 high half: group 8 l + 4 + j
///   the last  sixteen numbers of 16 bits (32 bytes) | sixteen |e| of 8 | sixteen f of 8
///
/// Sums of entries have 16 bits. The formula in floats is the same on all paths; where a processor joins a
/// product and a sum into one rounding, CodeTables::rounding() covers it. O(lines) a block.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/code_tables.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Blocks in memory, for the kernels.
struct CodeBlockRange {
  const std::uint8_t* blocks;
  std::size_t lines;
  std::size_t count;
  [[nodiscard]] std::size_t stride() const noexcept { return (lines + 1) * code_line; }
};

/// What a search asks of estimates: a point is possible where the estimate less proven * |e| + rounding is
/// below `below`, and likely where it is less likely * |e|.
struct CodeLimits {
  float likely;
  float proven;
  float rounding;
  float below;
};

/// Of a block's sixteen points, a bit each.
struct CodeVerdict {
  unsigned likely;
  unsigned possible;
};

/// An |e| of which nothing is known: more than any distance, and no infinity, which there may be among the
/// estimates, of no point.
inline constexpr float unknown_missed = 1e30F;
/// The byte that stands for it.
inline constexpr float nothing_known = 255;

/// From a sum of entries to an estimate: base + f * (offset + step * sum) + unit * number.
struct CodeScale {
  float base;
  float offset;
  float step;
  float unit;
};

#if defined(__x86_64__)
/// From sums of points 0, 2 ... 14 and 1, 3 ... 15.
[[CAIRN_TARGET(AVX2), gnu::always_inline]] inline void finish_estimates(const __m128i& even,
                                                                        const __m128i& odd,
                                                                        const std::uint8_t* numbers,
                                                                        const CodeScale& scale,
                                                                        float* to) noexcept {
  const __m128i eights[] = {_mm_unpacklo_epi16(even, odd), _mm_unpackhi_epi16(even, odd)};
  for (int i = 0; i < 2; ++i) {
    const __m128i own = _mm_loadu_si128(reinterpret_cast<const __m128i*>(numbers + 16 * i));
    const __m128i factor = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(numbers + 48 + 8 * i));
    const __m256 sums = _mm256_add_ps(
        _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(eights[i])), _mm256_set1_ps(scale.step)),
        _mm256_set1_ps(scale.offset));
    const __m256 factors = _mm256_add_ps(
        _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(factor)), _mm256_set1_ps(factor_unit)),
        _mm256_set1_ps(1.0F));
    const __m256 others =
        _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(own)), _mm256_set1_ps(scale.unit));
    _mm256_storeu_ps(
        to + 8 * i,
        _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(sums, factors), _mm256_set1_ps(scale.base)), others));
  }
}

[[CAIRN_TARGET(AVX512)]] inline void code_estimates_avx512(const CodeBlockRange& range,
                                                           const std::uint8_t* tables, const CodeScale& scale,
                                                           float* to) noexcept {
  const __m512i low_half = _mm512_set1_epi8(15);
  const std::uint8_t* block = range.blocks;
  for (std::size_t b = 0; b < range.count; ++b, block += range.stride(), to += block_size) {
    // Even and odd bytes are points of their own: `all` holds even + 256 odd, modulo 2^16.
    __m512i all = _mm512_setzero_si512(), odd = _mm512_setzero_si512();
    const std::uint8_t* table = tables;
    for (std::size_t line = 0; line < range.lines; ++line, table += 2 * code_line) {
      const __m512i codes = _mm512_loadu_si512(block + line * code_line);
      const __m512i first = _mm512_shuffle_epi8(_mm512_loadu_si512(table), _mm512_and_si512(codes, low_half));
      const __m512i second = _mm512_shuffle_epi8(_mm512_loadu_si512(table + code_line),
                                                 _mm512_and_si512(_mm512_srli_epi16(codes, 4), low_half));
      all = _mm512_add_epi16(all, _mm512_add_epi16(first, second));
      odd =
          _mm512_add_epi16(odd, _mm512_add_epi16(_mm512_srli_epi16(first, 8), _mm512_srli_epi16(second, 8)));
    }
    const __m512i even = _mm512_sub_epi16(all, _mm512_slli_epi16(odd, 8));
    __m128i evens[4], odds[4];
    std::memcpy(evens, &even, sizeof(even));
    std::memcpy(odds, &odd, sizeof(odd));
    finish_estimates(_mm_add_epi16(_mm_add_epi16(evens[0], evens[1]), _mm_add_epi16(evens[2], evens[3])),
                     _mm_add_epi16(_mm_add_epi16(odds[0], odds[1]), _mm_add_epi16(odds[2], odds[3])),
                     block + range.lines * code_line, scale, to);
  }
}

[[CAIRN_TARGET(AVX2)]] inline void code_estimates_avx2(const CodeBlockRange& range,
                                                       const std::uint8_t* tables, const CodeScale& scale,
                                                       float* to) noexcept {
  const __m256i low_half = _mm256_set1_epi8(15);
  const auto at = [](const std::uint8_t* from) { return reinterpret_cast<const __m256i*>(from); };
  const std::uint8_t* block = range.blocks;
  for (std::size_t b = 0; b < range.count; ++b, block += range.stride(), to += block_size) {
    __m256i all = _mm256_setzero_si256(), odd = _mm256_setzero_si256();
    for (std::size_t half = 0; half < 2 * range.lines; ++half) {
      const std::uint8_t* table = tables + half / 2 * 2 * code_line + half % 2 * 32;
      const __m256i codes = _mm256_loadu_si256(at(block + half * 32));
      const __m256i first =
          _mm256_shuffle_epi8(_mm256_loadu_si256(at(table)), _mm256_and_si256(codes, low_half));
      const __m256i second = _mm256_shuffle_epi8(_mm256_loadu_si256(at(table + code_line)),
                                                 _mm256_and_si256(_mm256_srli_epi16(codes, 4), low_half));
      all = _mm256_add_epi16(all, _mm256_add_epi16(first, second));
      odd =
          _mm256_add_epi16(odd, _mm256_add_epi16(_mm256_srli_epi16(first, 8), _mm256_srli_epi16(second, 8)));
    }
    const __m256i even = _mm256_sub_epi16(all, _mm256_slli_epi16(odd, 8));
    finish_estimates(_mm_add_epi16(_mm256_castsi256_si128(even), _mm256_extracti128_si256(even, 1)),
                     _mm_add_epi16(_mm256_castsi256_si128(odd), _mm256_extracti128_si256(odd, 1)),
                     block + range.lines * code_line, scale, to);
  }
}

/// As code_verdicts().
[[CAIRN_TARGET(AVX512)]] inline void code_verdicts_avx512(const std::uint8_t* missed, float unit,
                                                          const CodeBlockRange& range, const float* estimates,
                                                          const CodeLimits& limits,
                                                          CodeVerdict* to) noexcept {
  constexpr __mmask16 all = 0xffff;
  for (std::size_t b = 0; b < range.count; ++b, missed += range.stride()) {
    const __m128i whole = _mm_loadu_si128(reinterpret_cast<const __m128i*>(missed));
    const __m512 known = _mm512_mul_ps(_mm512_maskz_cvtepi32_ps(all, _mm512_maskz_cvtepu8_epi32(all, whole)),
                                       _mm512_set1_ps(unit));
    const __m512 error = _mm512_mask_mov_ps(known, _mm_cmpeq_epi8_mask(whole, _mm_set1_epi8(-1)),
                                            _mm512_set1_ps(unknown_missed));
    const __m512 estimate = _mm512_loadu_ps(estimates + b * block_size);
    const __m512 likely = _mm512_sub_ps(estimate, _mm512_mul_ps(error, _mm512_set1_ps(limits.likely)));
    const __m512 least = _mm512_sub_ps(estimate, _mm512_mul_ps(error, _mm512_set1_ps(limits.proven)));
    to[b].likely = _mm512_cmp_ps_mask(likely, _mm512_set1_ps(limits.below), _CMP_LT_OQ);
    to[b].possible = _mm512_cmp_ps_mask(least, _mm512_set1_ps(limits.below + limits.rounding), _CMP_LT_OQ);
  }
}
#endif

inline void code_estimates_plain(const CodeBlockRange& range, const std::uint8_t* tables,
                                 const CodeScale& scale, float* to) noexcept {
  const std::uint8_t* block = range.blocks;
  for (std::size_t b = 0; b < range.count; ++b, block += range.stride(), to += block_size) {
    std::uint16_t sums[block_size] = {};
#if defined(__ARM_NEON) && defined(__aarch64__)
    uint16x8_t low = vdupq_n_u16(0), high = vdupq_n_u16(0);
    for (std::size_t part = 0; part < 4 * range.lines; ++part) {
      const std::uint8_t* table = tables + part / 4 * 2 * code_line + part % 4 * codewords;
      const uint8x16_t codes = vld1q_u8(block + part * block_size);
      const uint8x16_t first = vqtbl1q_u8(vld1q_u8(table), vandq_u8(codes, vdupq_n_u8(15)));
      const uint8x16_t second = vqtbl1q_u8(vld1q_u8(table + code_line), vshrq_n_u8(codes, 4));
      low = vaddq_u16(low, vaddl_u8(vget_low_u8(first), vget_low_u8(second)));
      high = vaddq_u16(high, vaddl_high_u8(first, second));
    }
    vst1q_u16(sums, low);
    vst1q_u16(sums + 8, high);
#else
    for (std::size_t part = 0; part < 4 * range.lines; ++part) {
      const std::uint8_t* table = tables + part / 4 * 2 * code_line + part % 4 * codewords;
      for (std::size_t i = 0; i < block_size; ++i) {
        const unsigned codes = block[part * block_size + i];
        sums[i] = static_cast<std::uint16_t>(sums[i] + table[codes & 15U] + table[code_line + (codes >> 4U)]);
      }
    }
#endif
    std::int16_t numbers[block_size];
    std::memcpy(numbers, block + range.lines * code_line, sizeof(numbers));
    const std::uint8_t* factors = block + range.lines * code_line + 48;
    for (std::size_t i = 0; i < block_size; ++i) {
      const float sum = static_cast<float>(sums[i]) * scale.step + scale.offset;
      const float factor = static_cast<float>(factors[i]) * factor_unit + 1;
      to[i] = (sum * factor + scale.base) + static_cast<float>(numbers[i]) * scale.unit;
    }
  }
}

/// As code_verdicts().
inline void code_verdicts_plain(const std::uint8_t* missed, float unit, const CodeBlockRange& range,
                                const float* estimates, const CodeLimits& limits, CodeVerdict* to) noexcept {
  with_widest_lanes([&]() CAIRN_INLINED {
    for (std::size_t b = 0; b < range.count; ++b, missed += range.stride()) {
      Block<float> estimate, whole;
      std::memcpy(&estimate, estimates + b * block_size, sizeof(estimate));
      load_block<float>(missed, whole);
      const Block<float> unknown = Block<float>{} + unknown_missed;
      const Block<float> error = whole == Block<float>{} + nothing_known ? unknown : whole * unit;
      to[b].likely = mask_below<float>(estimate - error * limits.likely, limits.below);
      to[b].possible = mask_below<float>(estimate - error * limits.proven, limits.below + limits.rounding);
    }
  });
}

/// to[i] = the estimate of point i of the blocks, by what the processor has.
inline void code_estimates(const CodeBlockRange& range, const std::uint8_t* tables, const CodeScale& scale,
                           float* to) noexcept {
#if defined(__x86_64__)
  if (processor() >= Processor::avx512) return code_estimates_avx512(range, tables, scale, to);
  if (processor() >= Processor::avx2) return code_estimates_avx2(range, tables, scale, to);
#endif
  code_estimates_plain(range, tables, scale, to);
}

/// to[b] = what the estimates of block b make of its points, where |e| = unit * a byte. The bytes of the
/// first block stand at `missed`.
inline void code_verdicts(const std::uint8_t* missed, float unit, const CodeBlockRange& range,
                          const float* estimates, const CodeLimits& limits, CodeVerdict* to) noexcept {
#if defined(__x86_64__)
  if (processor() >= Processor::avx512)
    return code_verdicts_avx512(missed, unit, range, estimates, limits, to);
#endif
  code_verdicts_plain(missed, unit, range, estimates, limits, to);
}

}}}  // namespace cairn::CAIRN_ABI::detail
