// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Points as product codes (product_codes.hpp), sixteen to a block as code_kernels.hpp draws it.
///
/// The number of a point is kept in 16 bits, and its rounding goes into the bound; |e| in 8 bits, rounded up,
/// the largest of which means that nothing is known: of a point that lies outside of what was learnt, its
/// distance is taken. f has 8 bits from the start. Writing a point is O(groups).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include <cairn/core/sizes.hpp>
#include <cairn/index/detail/block_lanes.hpp>
#include <cairn/index/detail/byte_blocks.hpp>
#include <cairn/index/detail/code_kernels.hpp>
#include <cairn/index/detail/code_tables.hpp>
#include <cairn/index/detail/product_codes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

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
    code_estimates(range, tables.entries(), scale, to);
  }
  /// Of the points of the same blocks, from their estimates.
  void verdicts(std::size_t first, std::size_t count, const float* estimates, const CodeLimits& limits,
                CodeVerdict* to) const noexcept {
    code_verdicts(&data_[missed_of(first * block_size)], missed_unit_, {data_.data(), lines_, count},
                  estimates, limits, to);
  }

  void prefetch(std::size_t first, std::size_t count) const noexcept {
    const std::uint8_t* line = data_.data() + first * stride();
    const std::size_t lines = std::min<std::size_t>(count * stride() / code_line, 64);
    for (std::size_t i = 0; i < lines; ++i) __builtin_prefetch(line + code_line * i);
  }

private:
  static constexpr float most_number = 32767;

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
