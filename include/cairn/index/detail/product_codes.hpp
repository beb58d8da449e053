// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Codes of four bits for four coordinates, and the distances that they bound (product quantization: Jegou,
/// Douze, Schmid, "Product quantization for nearest neighbor search", IEEE PAMI 33, 2011; tables in
/// registers: Andre, Kermarrec, Le Scouarnec, "Cache locality is not enough", VLDB 9, 2015).
///
/// A point p of a cell with the mean m is kept as m + f c, where c is the codeword that is nearest to p - m
/// in each four coordinates, and f a number of the point; e = p - m - f c is what that misses. For a query q
/// and any origin o
///
///   |q - p|^2 = |q - m|^2 - 2 f (q - o).c + (|p - m|^2 + 2 f (m - o).c - 2 (p - m).e) - 2 (q - p).e
///
/// The first term is known from the choice of cells, the second one is a sum over sixteen-entry tables that a
/// query makes once for all cells (that is what o is for: it makes them small), the third one is a number of
/// the point. The last term is left out of the estimate, and |2 (q - p).e| <= 2 |q - p| |e| by Cauchy and
/// Schwarz: with |e| kept beside the point, whoever is nearer than a limit has an estimate below its square
/// and 2 limit |e|, proven. Directions being many, (q - p).e is mostly far smaller: its root mean square over
/// |q - p| |e| is measured where the codes are learnt (spread()), and a search looks first at whoever is
/// below its limit by some of those. f = |p - m|^2 / (p - m).c makes e stand at right angles to p - m: else a
/// point would be taken for nearer than it is the more of it its code misses (Gao, Long, "RaBitQ", SIGMOD
/// 2024).
///
/// The four coordinates of a group are no neighbours: ordered by how much points vary in them they are dealt
/// to the groups in turns, there and back, so that a codeword has about as much to tell in each.
///
/// Entries of tables are whole numbers of one step, rounded down, so that sums are exact whatever the
/// processor: M of them fall short by less than M steps, which goes half into the estimate and half into its
/// bound. The number of a point is kept in 16 bits, its rounding goes into the bound; f in 8 bits; |e| in 8
/// bits, rounded up, the largest of which means that nothing is known. All this is about bytes; that bytes
/// are not their points is the caller's to allow for.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#include <cairn/core/parallel.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/byte_blocks.hpp>
#include <cairn/index/detail/reset_on_move.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

inline constexpr std::size_t codewords = 16;     ///< for each four coordinates
inline constexpr std::size_t codes_in_line = 8;  ///< of each of sixteen points, in 64 bytes
inline constexpr std::size_t code_line = 64;

/// What a point's f is more than one by is so many of these, kept in a byte.
inline constexpr float factor_unit = 1.0F / 128;
inline constexpr float largest_factor = 1 + 255 * factor_unit;

/// What a query asks of codes, made once for all cells.
class CodeTables {
public:
  /// Tables of `groups` groups, a multiple of codes_in_line. Entry k of group g is written by add_group().
  void reset(std::size_t groups) {
    numbers_.resize(groups * codewords);
    entries_.resize(groups * codewords);
    lowest_ = 0;
    widest_ = 0;
    magnitude_ = 0;
  }
  /// No sum of products exceeds this in absolute value, nor does a sum of their terms' absolute values.
  void set_magnitude(float magnitude) noexcept { magnitude_ = magnitude; }

  /// Products of group `group` with its sixteen codewords.
  [[gnu::always_inline]] void set_group(std::size_t group, const Block<float>& products) noexcept {
    const float low = smallest<float>(products), high = -smallest<float>(-products);
    const Block<float> above = products - (Block<float>{} + low);
    std::memcpy(numbers_.data() + group * codewords, &above, sizeof(above));
    lowest_ += low;
    widest_ = std::max(widest_, high - low);
  }

  /// After all groups: whole numbers from them. No sum of entries exceeds 16 bits.
  [[gnu::always_inline]] void round_down() noexcept {
    const std::size_t groups = numbers_.size() / codewords;
    const auto most =
        static_cast<float>(std::min<std::size_t>(255, 65535 / std::max<std::size_t>(1, groups)));
    step_ = widest_ > 0 ? widest_ / most : 1;
    const float per_step = widest_ > 0 ? most / widest_ : 1;
    for (std::size_t g = 0; g < groups; ++g) {
      Block<float> numbers;
      std::memcpy(&numbers, numbers_.data() + g * codewords, sizeof(numbers));
      const Block<float> scaled = numbers * per_step;
      Block<std::int32_t> whole = __builtin_convertvector(scaled, Block<std::int32_t>);
      const Block<std::int32_t> top = Block<std::int32_t>{} + static_cast<std::int32_t>(most);
      whole = whole < top ? whole : top;
      store_bytes(whole, entries_.data() + g * codewords);
    }
  }

  [[nodiscard]] const std::uint8_t* entries() const noexcept { return entries_.data(); }
  /// What a sum of entries stands for: offset + step * sum, give or take half of `groups` steps.
  [[nodiscard]] float step() const noexcept { return step_; }
  [[nodiscard]] float half_range() const noexcept {
    return step_ * 0.5F * static_cast<float>(numbers_.size() / codewords);
  }
  [[nodiscard]] float offset() const noexcept { return lowest_ + half_range(); }
  /// How far rounding moves an estimate at most, half_range() included, where `others` bounds its other
  /// terms: the rounding of four products, of the sum of all groups' lowest ones, and of an entry before its
  /// floor.
  [[nodiscard]] float rounding(float others) const noexcept {
    const auto roundings = static_cast<float>(numbers_.size() / codewords + 16);
    return largest_factor * half_range() * 1.001F +
           roundings * std::numeric_limits<float>::epsilon() * (largest_factor * magnitude_ + others);
  }

private:
  AlignedVector<float> numbers_;
  AlignedVector<std::uint8_t> entries_;
  float lowest_ = 0;
  float widest_ = 0;
  float magnitude_ = 0;
  float step_ = 1;
};

/// Sixteen codewords for each group of four coordinates.
class ProductCodebook {
public:
  ProductCodebook() = default;

  /// Learnt from `rows`, rows of dim differences between points and the means of their cells, at least one:
  /// Lloyd's algorithm in each group. O(rows dim).
  ProductCodebook(std::size_t dim, const std::vector<float>& origin, const std::vector<float>& rows,
                  unsigned threads)
      : dim_(dim), origin_(places(), 0.0F), words_(places() * codewords, 0.0F) {
    deal(rows);
    for (std::size_t a = 0; a < dim; ++a) origin_[place_of_[a]] = origin[a];
    parallel_for(groups(), threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t g = begin; g < end; ++g) learn_group(g, rows);
    });
    float squares = 0;
    for (std::size_t place = 0; place < places(); ++place) {
      float largest = 0;
      for (std::size_t k = 0; k < codewords; ++k)
        largest = std::max(largest, std::abs(words_[place * codewords + k]));
      squares += largest * largest;
    }
    longest_ = std::sqrt(squares) * 1.001F;
  }

  [[nodiscard]] bool empty() const noexcept { return dim_ == 0; }
  [[nodiscard]] std::size_t dimension() const noexcept { return dim_; }
  /// Of four coordinates, filled up to whole lines.
  [[nodiscard]] std::size_t groups() const noexcept {
    return (dim_ + lane_axes * codes_in_line - 1) / (lane_axes * codes_in_line) * codes_in_line;
  }
  /// Coordinates as the groups have them: those of group g are at places 4 g ... 4 g + 3. There may be places
  /// of none.
  [[nodiscard]] std::size_t places() const noexcept { return groups() * lane_axes; }
  [[nodiscard]] std::size_t place_of(std::size_t axis) const noexcept { return place_of_[axis]; }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return (origin_.capacity() + words_.capacity()) * sizeof(float) +
           (place_of_.capacity() + axis_at_.capacity()) * sizeof(std::uint32_t);
  }

  /// The codeword of each group that is nearest to a difference of places() numbers.
  void encode(const float* difference, std::uint8_t* codes) const noexcept {
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t g = 0; g < groups(); ++g) codes[g] = nearest_word(g, difference + g * lane_axes);
    });
  }
  /// At a place, of the codeword `code` of its group.
  [[nodiscard]] float word(std::size_t place, std::uint8_t code) const noexcept {
    return words_[place * codewords + code];
  }
  /// By places.
  [[nodiscard]] const std::vector<float>& origin() const noexcept { return origin_; }

  /// Products -2 (q - origin).c of a query's bytes.
  void make_tables(const std::uint8_t* query, CodeTables& tables) const {
    tables.reset(groups());
    float squares = 0;
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t g = 0; g < groups(); ++g) {
        Block<float> products{};
        for (std::size_t i = 0; i < lane_axes; ++i) {
          const std::size_t place = g * lane_axes + i, axis = axis_at_[place];
          const float number = axis < dim_ ? -2 * (static_cast<float>(query[axis]) - origin_[place]) : 0.0F;
          squares += number * number;
          Block<float> words;
          load_block<float>(words_.data() + place * codewords, words);
          products += words * number;
        }
        tables.set_group(g, products);
      }
      tables.round_down();
    });
    tables.set_magnitude(std::sqrt(squares) * longest_ * 1.001F);
  }

private:
  static constexpr int rounds = 10;

  [[gnu::always_inline]] [[nodiscard]] std::uint8_t nearest_word(std::size_t group,
                                                                 const float* numbers) const noexcept {
    Block<float> squares{};
    for (std::size_t i = 0; i < lane_axes; ++i) {
      Block<float> words;
      load_block<float>(words_.data() + (group * lane_axes + i) * codewords, words);
      const Block<float> difference = words - (Block<float>{} + numbers[i]);
      squares += difference * difference;
    }
    Block<std::int32_t> bits;  // squares compare like their bits
    std::memcpy(&bits, &squares, sizeof(bits));
    const std::int32_t least = smallest<std::int32_t>(bits);
    return static_cast<std::uint8_t>(std::countr_zero(mask_below<std::int32_t>(bits, least + 1)));
  }

  /// Of G groups, group g gets the coordinates that are the g-th, 2 G - 1 - g-th, 2 G + g-th, 4 G - 1 - g-th
  /// of those that vary most.
  void deal(const std::vector<float>& rows) {
    std::vector<double> squares(dim_, 0.0);
    for (std::size_t i = 0; i < rows.size(); ++i) squares[i % dim_] += double{rows[i]} * double{rows[i]};
    std::vector<std::uint32_t> order(dim_);
    std::iota(order.begin(), order.end(), 0U);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return squares[a] != squares[b] ? squares[a] > squares[b] : a < b;
    });
    place_of_.resize(dim_);
    axis_at_.assign(places(), static_cast<std::uint32_t>(dim_));
    for (std::size_t rank = 0; rank < dim_; ++rank) {
      const std::size_t turn = rank / groups(), within = rank % groups();
      const std::size_t group = turn % 2 == 0 ? within : groups() - 1 - within;
      place_of_[order[rank]] = static_cast<std::uint32_t>(group * lane_axes + turn);
      axis_at_[group * lane_axes + turn] = order[rank];
    }
  }

  void learn_group(std::size_t group, const std::vector<float>& rows) {
    const std::size_t count = rows.size() / dim_;
    std::vector<float> numbers(count * lane_axes, 0.0F);
    for (std::size_t a = 0; a < lane_axes; ++a)
      if (const std::size_t axis = axis_at_[group * lane_axes + a]; axis < dim_)
        for (std::size_t i = 0; i < count; ++i) numbers[i * lane_axes + a] = rows[i * dim_ + axis];
    float* words = words_.data() + group * lane_axes * codewords;
    for (std::size_t k = 0; k < codewords; ++k)
      for (std::size_t a = 0; a < lane_axes; ++a)
        words[a * codewords + k] = numbers[k * count / codewords * lane_axes + a];
    std::vector<std::uint8_t> code(count);
    for (int round = 0; round < rounds; ++round) {
      with_widest_lanes([&]() CAIRN_INLINED {
        for (std::size_t i = 0; i < count; ++i) code[i] = nearest_word(group, &numbers[i * lane_axes]);
      });
      float sums[codewords][lane_axes] = {};
      float sizes[codewords] = {};
      for (std::size_t i = 0; i < count; ++i) {
        ++sizes[code[i]];
        for (std::size_t a = 0; a < lane_axes; ++a) sums[code[i]][a] += numbers[i * lane_axes + a];
      }
      for (std::size_t k = 0; k < codewords; ++k)
        if (sizes[k] > 0)
          for (std::size_t a = 0; a < lane_axes; ++a) words[a * codewords + k] = sums[k][a] / sizes[k];
    }
  }

  ResetOnMove<std::size_t> dim_;
  std::vector<std::uint32_t> place_of_;  ///< of each coordinate
  std::vector<std::uint32_t> axis_at_;   ///< of each place; dim_ where there is none
  std::vector<float> origin_;
  std::vector<float> words_;  ///< sixteen for each place
  float longest_ = 0;         ///< no combination of codewords is longer
};

/// Blocks in memory, for the kernels. A block is `lines` lines of codes, then one with sixteen numbers of 16
/// bits, sixteen |e| of 8, sixteen f of 8. In line l, byte 16 j + i holds the codes of point i for groups 8 l
/// + j (low half) and 8 l + 4 + j.
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

/// As CodeBlocks::verdicts(), whose |e| begin at `missed`.
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

/// A point as its codes, with the numbers of the formula above.
struct CodedPoint {
  std::vector<std::uint8_t> codes;
  std::uint8_t factor = 0;  ///< what f is more than one by, in factor_unit
  float number = 0;         ///< |p - m|^2 + 2 f (m - o).c - 2 (p - m).e
  float missed = 0;         ///< |e|, rounded up
  [[nodiscard]] float f() const noexcept { return 1 + static_cast<float>(factor) * factor_unit; }
};

/// Codes points, one after the other.
class CodeWriter {
public:
  CodeWriter() = default;
  explicit CodeWriter(const ProductCodebook& codebook)
      : mean(codebook.dimension()), left_(codebook.places(), 0.0F) {
    point.codes.resize(codebook.groups());
  }

  std::vector<std::uint8_t> mean;  ///< of the cell, written by the caller
  CodedPoint point;                ///< written by encode()
  /// e, by places.
  [[nodiscard]] const std::vector<float>& missed() const noexcept { return left_; }

  void encode(const ProductCodebook& codebook, const std::uint8_t* row) noexcept {
    std::fill(left_.begin(), left_.end(), 0.0F);
    double square = 0, own = 0, of_mean = 0, missed = 0;
    for (std::size_t a = 0; a < mean.size(); ++a) {
      const int difference = row[a] - mean[a];
      left_[codebook.place_of(a)] = static_cast<float>(difference);
      square += difference * difference;
    }
    codebook.encode(left_.data(), point.codes.data());
    for (std::size_t a = 0; a < mean.size(); ++a) {
      const std::size_t place = codebook.place_of(a);
      const double word = double{codebook.word(place, point.codes[place / lane_axes])};
      own += double{left_[place]} * word;
      of_mean += (mean[a] - double{codebook.origin()[place]}) * word;
    }
    const double wished = own > 0 ? (square / own - 1) / double{factor_unit} : 0;
    point.factor = static_cast<std::uint8_t>(std::clamp(wished + 0.5, 0.0, 255.0));
    const auto f = double{point.f()};
    for (std::size_t place = 0; place < left_.size(); ++place) {
      const double left =
          double{left_[place]} - f * double{codebook.word(place, point.codes[place / lane_axes])};
      missed += left * left;
      left_[place] = static_cast<float>(left);
    }
    point.number = static_cast<float>(2 * f * (of_mean + own) - square);
    point.missed = static_cast<float>(std::sqrt(missed) * 1.00001);
  }

private:
  std::vector<float> left_;
};

/// Coded points, sixteen to a block.
class CodeBlocks {
public:
  CodeBlocks() = default;
  /// What numbers and |e| are whole numbers of follows from the largest ones expected.
  CodeBlocks(std::size_t groups, std::size_t blocks, float largest_number, float largest_missed)
      : lines_(groups / codes_in_line),
        number_unit_(std::max(largest_number, 1.0F) / most_number),
        missed_unit_(std::max(largest_missed, 1.0F) / (nothing_known - 1)),
        data_(room_for(blocks, stride(), "DescriptorIndex"), 0) {}
  /// Of the same kind.
  [[nodiscard]] CodeBlocks of_size(std::size_t blocks) const {
    CodeBlocks result = CodeBlocks();
    result.lines_ = lines_;
    result.number_unit_ = number_unit_;
    result.missed_unit_ = missed_unit_;
    result.resize(blocks);
    return result;
  }

  [[nodiscard]] std::size_t bytes() const noexcept { return data_.capacity(); }

  void set(std::size_t place, const CodedPoint& point) noexcept {
    for (std::size_t g = 0; g < lines_ * codes_in_line; ++g) {
      std::uint8_t& byte = data_[byte_of(place, g / 8 * 4 + g % 4)];
      byte = g % 8 < 4 ? static_cast<std::uint8_t>((byte & 0xf0U) | point.codes[g])
                       : static_cast<std::uint8_t>((byte & 0x0fU) | unsigned{point.codes[g]} << 4U);
    }
    const float number = std::floor(point.number / number_unit_ + 0.5F);
    const float missed = std::ceil(point.missed / missed_unit_ * 1.00001F);
    const bool known = std::abs(number) <= most_number && missed < nothing_known;
    const auto whole = static_cast<std::int16_t>(known ? number : 0);
    std::memcpy(&data_[number_of(place)], &whole, sizeof(whole));
    data_[missed_of(place)] = static_cast<std::uint8_t>(known ? missed : nothing_known);
    data_[factor_of(place)] = point.factor;
  }
  void copy_from(const CodeBlocks& other, std::size_t from, std::size_t to) noexcept {
    for (std::size_t part = 0; part < 4 * lines_; ++part)
      data_[byte_of(to, part)] = other.data_[byte_of(from, part)];
    std::memcpy(&data_[number_of(to)], &other.data_[number_of(from)], sizeof(std::int16_t));
    data_[missed_of(to)] = other.data_[missed_of(from)];
    data_[factor_of(to)] = other.data_[factor_of(from)];
  }
  void reserve(std::size_t blocks) { reserve_ahead(data_, room_for(blocks, stride(), "DescriptorIndex")); }
  /// What further blocks hold means nothing, but is set.
  void resize(std::size_t blocks) { data_.resize(blocks * stride(), 0); }

  [[nodiscard]] CodeScale scale(float square_from_mean, const CodeTables& tables) const noexcept {
    return {square_from_mean, tables.offset(), tables.step(), number_unit_};
  }
  /// How far rounding moves an estimate at most.
  [[nodiscard]] float rounding(float square_from_mean, const CodeTables& tables) const noexcept {
    return tables.rounding(square_from_mean + number_unit_ * most_number) + 0.501F * number_unit_;
  }

  /// Of the points of blocks first ... first + count - 1.
  void estimates(std::size_t first, std::size_t count, const CodeTables& tables, const CodeScale& scale,
                 float* to) const noexcept {
    const CodeBlockRange range{data_.data() + first * stride(), lines_, count};
#if defined(__x86_64__)
    if (processor() >= Processor::avx512) return code_estimates_avx512(range, tables.entries(), scale, to);
    if (processor() >= Processor::avx2) return code_estimates_avx2(range, tables.entries(), scale, to);
#endif
    code_estimates_plain(range, tables.entries(), scale, to);
  }
  /// Of the points of the same blocks, from their estimates.
  void verdicts(std::size_t first, std::size_t count, const float* estimates, const CodeLimits& limits,
                CodeVerdict* to) const noexcept {
    const std::uint8_t* missed = &data_[missed_of(first * block_size)];
#if defined(__x86_64__)
    if (processor() >= Processor::avx512)
      return code_verdicts_avx512(missed, missed_unit_, {data_.data(), lines_, count}, estimates, limits, to);
#endif
    with_widest_lanes([&]() CAIRN_INLINED {
      for (std::size_t b = 0; b < count; ++b, missed += stride()) {
        Block<float> estimate, whole;
        std::memcpy(&estimate, estimates + b * block_size, sizeof(estimate));
        load_block<float>(missed, whole);
        const Block<float> unknown = Block<float>{} + unknown_missed;
        const Block<float> error = whole == Block<float>{} + nothing_known ? unknown : whole * missed_unit_;
        to[b].likely = mask_below<float>(estimate - error * limits.likely, limits.below);
        to[b].possible = mask_below<float>(estimate - error * limits.proven, limits.below + limits.rounding);
      }
    });
  }

  void prefetch(std::size_t first, std::size_t count) const noexcept {
    const std::uint8_t* line = data_.data() + first * stride();
    const std::size_t lines = std::min<std::size_t>(count * stride() / code_line, 64);
    for (std::size_t i = 0; i < lines; ++i) __builtin_prefetch(line + code_line * i);
  }

private:
  static constexpr float most_number = 32767;
  static constexpr float nothing_known = 255;

  [[nodiscard]] std::size_t stride() const noexcept { return (lines_ + 1) * code_line; }
  [[nodiscard]] std::size_t byte_of(std::size_t place, std::size_t part) const noexcept {
    return place / block_size * stride() + part * block_size + place % block_size;
  }
  [[nodiscard]] std::size_t number_of(std::size_t place) const noexcept {
    return byte_of(place, 4 * lines_) + place % block_size;
  }
  [[nodiscard]] std::size_t missed_of(std::size_t place) const noexcept {
    return byte_of(place, 4 * lines_ + 2);
  }
  [[nodiscard]] std::size_t factor_of(std::size_t place) const noexcept {
    return byte_of(place, 4 * lines_ + 3);
  }

  std::size_t lines_ = 0;
  float number_unit_ = 1;
  float missed_unit_ = 1;
  AlignedVector<std::uint8_t> data_;
};

}}}  // namespace cairn::CAIRN_ABI::detail
