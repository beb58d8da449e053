// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Coordinates turned to bytes, and how far those are from them.
///
/// A coordinate x of axis a becomes round((x - low[a]) / unit), with one unit for all axes, so that distances
/// keep their proportions. Where all coordinates are multiples of a power of two, as those of SIFT are, the
/// bytes are the points. Sixteen coordinates at a time, the same bits on every processor.
///
/// A point beyond the range of bytes is first moved to the nearest one of the box that they span. That makes
/// no two points farther from each other (the box is convex), so a distance of bytes exceeds that of the
/// points by what rounding does alone. From a point of the box to one that is `outside` away from it the
/// squared distance is even longer by outside^2: both lie on the two sides of each border that was crossed.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include <cairn/index/detail/block_lanes.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

class ByteScale {
public:
  ByteScale() = default;
  /// Of as many axes as there are lowest coordinates.
  explicit ByteScale(std::vector<float> low, float unit = 1) : low_(std::move(low)) { set_unit(unit); }

  [[nodiscard]] std::size_t dimension() const noexcept { return low_.size(); }
  [[nodiscard]] const std::vector<float>& low() const noexcept { return low_; }
  [[nodiscard]] float unit() const noexcept { return unit_; }  ///< what a byte's step is worth
  [[nodiscard]] std::size_t bytes() const noexcept { return low_.capacity() * sizeof(float); }

  /// What bytes miss of a point, in bytes.
  struct Miss {
    float rounding = 0;  ///< how far they are from it, or from where it was moved, rounded up; 0: they are it
    float outside_squared = 0;  ///< how far it was moved, squared
  };

  /// The bytes of points, and how far any of them is from its point at most, in bytes.
  struct Encoded {
    std::vector<std::uint8_t> codes;
    float error = 0;
  };

  /// Takes the lowest coordinates and the unit from rows of dimension() numbers, at least one, and returns
  /// their bytes.
  [[nodiscard]] Encoded learn(const std::vector<float>& rows) {
    const std::size_t dim = dimension();
    low_.assign(rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(dim));
    std::vector<float> high = low_;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      low_[i % dim] = std::min(low_[i % dim], rows[i]);
      high[i % dim] = std::max(high[i % dim], rows[i]);
    }
    float range = 0;
    for (std::size_t a = 0; a < dim; ++a) range = std::max(range, high[a] - low_[a]);
    const float finest = range > 1e-18F ? range / 255 : 1;  // nearer points are all zeros, and measured
    Encoded result{std::vector<std::uint8_t>(rows.size())};
    // Whole numbers, and their halves and quarters, are met exactly by the next power of two.
    for (const float unit : {std::exp2(std::ceil(std::log2(finest))), finest}) {
      set_unit(unit);
      result.error = 0;
      for (std::size_t i = 0; i < rows.size(); i += dim) {
        const float error = encode(&rows[i], &result.codes[i]).rounding;
        if (error > 0 && unit > finest) {
          result.error = error;
          break;
        }
        result.error = std::max(result.error, error);
      }
      if (result.error == 0) break;
    }
    return result;
  }

  /// Writes the bytes of a point.
  Miss encode(const float* row, std::uint8_t* codes) const noexcept {
    float sum = 0, outside = 0;
    bool exact = true;
    with_widest_lanes([&]() CAIRN_INLINED {
      Misses misses{};
      std::size_t axis = 0;
      for (; axis + block_size <= dimension(); axis += block_size)
        encode_block(row + axis, low_.data() + axis, codes + axis, misses);
      if (const std::size_t left = dimension() - axis; left > 0) {
        float numbers[block_size] = {}, low[block_size] = {};
        std::uint8_t bytes[block_size];
        std::copy_n(row + axis, left, numbers);
        std::copy_n(low_.data() + axis, left, low);
        encode_block(numbers, low, bytes, misses);
        std::copy_n(bytes, left, codes + axis);
      }
      exact = smallest<std::int32_t>(misses.bits != Block<std::int32_t>{}) == 0;  // where true, -1
      if (exact) return;
      for (std::size_t i = 0; i < block_size; ++i) sum += misses.roundings[i];
      for (std::size_t i = 0; i < block_size; ++i) outside += misses.outside[i];
    });
    return exact ? Miss{} : Miss{std::sqrt(sum) * 1.001F + 1e-3F, outside};
  }

private:
  /// Sums of squares; bits that are not zero where bytes are not their coordinates.
  struct Misses {
    Block<float> roundings, outside;
    Block<std::int32_t> bits;
  };

  /// Sixteen coordinates.
  [[gnu::always_inline]] void encode_block(const float* row, const float* low, std::uint8_t* codes,
                                           Misses& misses) const noexcept {
    Block<float> numbers, from;
    load_block<float>(row, numbers);
    load_block<float>(low, from);
    // A query may be far away: then it is moved nearer to all bytes alike.
    const Block<float> zero{}, far = zero + 1e15F, top = zero + 255.0F;
    Block<float> scaled = inverse_ > 0 ? (numbers - from) * inverse_ : (numbers - from) / unit_;
    scaled = scaled < -far ? -far : scaled;
    scaled = scaled > far ? far : scaled;
    Block<float> inside = scaled < zero ? zero : scaled;
    inside = inside > top ? top : inside;
    const auto whole = __builtin_convertvector(inside + 0.5F, Block<std::int32_t>);
    const auto code = __builtin_convertvector(whole, Block<float>);
    store_bytes(whole, codes);
    misses.roundings += (inside - code) * (inside - code);
    misses.outside += (scaled - inside) * (scaled - inside);
    // A difference may be rounded to a byte's value, and the point not be there.
    // Compared by their bits, which gcc 12 does side by side; adding zero makes minus zero plus zero.
    const Block<float> there = from + code * unit_, here = numbers + zero;
    Block<std::int32_t> bits[4];
    std::memcpy(&bits[0], &scaled, sizeof(scaled));
    std::memcpy(&bits[1], &code, sizeof(code));
    std::memcpy(&bits[2], &there, sizeof(there));
    std::memcpy(&bits[3], &here, sizeof(here));
    misses.bits |= (bits[0] ^ bits[1]) | (bits[2] ^ bits[3]);
  }

  /// Dividing by a power of two is multiplying by another, to the last bit, and sooner done.
  void set_unit(float unit) noexcept {
    int exponent = 0;
    const bool power = std::frexp(unit, &exponent) == 0.5F && std::isnormal(1 / unit);
    unit_ = unit;
    inverse_ = power ? 1 / unit : 0;
  }

  std::vector<float> low_;
  float unit_ = 1;
  float inverse_ = 1;  ///< 0 where it is not exact
};

}}}  // namespace cairn::CAIRN_ABI::detail
