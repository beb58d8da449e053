// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a query asks of product codes (product_codes.hpp), made once for all cells: for each group of four
/// coordinates its products with the sixteen codewords, as bytes, so that a table of a group is one register.
///
///   entries   group 0: sixteen bytes | group 1: sixteen | ...
///             of a group: floor((product - the lowest of the group) / step)
///
/// One step for all groups, the widest of which has up to 255 of them, fewer where sums would not fit 16
/// bits. So sums are whole numbers, exact whatever the processor, and one over M groups falls short by less
/// than M steps, half of which goes into the estimate and half into its bound (rounding()). O(M) a query.
/// Tables in registers: Andre, Kermarrec, Le Scouarnec, "Cache locality is not enough: high-performance
/// nearest neighbor search with product quantization fast scan", VLDB 9, 2015.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include <cairn/index/detail/block_lanes.hpp>

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

}}}  // namespace cairn::CAIRN_ABI::detail
