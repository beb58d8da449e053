// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Sixteen numbers side by side.
///
/// Leaves and wide nodes hold sixteen points or boxes, coordinate by coordinate, so that one pass of vector
/// code answers for all of them: one AVX-512 register, two of AVX, four of SSE2 or NEON, picked at run time
/// (simd/processor.hpp).
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <new>
#include <type_traits>
#include <vector>

#if defined(__x86_64__)
#include <emmintrin.h>
#endif

#include <cairn/simd/processor.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

inline constexpr std::size_t block_size = 16;  ///< points in a leaf, children of a wide node

/// Sixteen Ts. Pass by reference only (simd/registers.hpp).
template <class T>
using Block = Lanes<T, static_cast<int>(block_size)>;

/// The integer as wide as T: nonnegative floating point numbers compare like their bits.
template <class T>
using BitsOf = std::conditional_t<sizeof(T) == 4, std::int32_t, std::int64_t>;

/// Type of coordinate differences and distances: float for float and small integers, else double.
template <class Scalar>
using RealOf =
    std::conditional_t<std::is_same_v<Scalar, float> || (std::is_integral_v<Scalar> && sizeof(Scalar) <= 2),
                       float, double>;

/// Reads sixteen numbers, converting to the type computed in.
template <class Real, class Scalar>
[[gnu::always_inline]] inline void load_block(const Scalar* from, Block<Real>& to) noexcept {
  if constexpr (std::is_same_v<Real, Scalar>) {
    std::memcpy(&to, from, sizeof(to));
  } else {
    Block<Scalar> raw;
    std::memcpy(&raw, from, sizeof(raw));
    if constexpr (sizeof(Scalar) == 1 &&
                  sizeof(Real) == 4)  // in two steps, which compilers know how to widen
      to = __builtin_convertvector(__builtin_convertvector(raw, Block<std::int32_t>), Block<Real>);
    else
      to = __builtin_convertvector(raw, Block<Real>);
  }
}

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

/// Bit i is set where truth i is -1, not 0.
[[nodiscard, gnu::always_inline]] inline unsigned mask_of(const Block<std::int32_t>& truths) noexcept {
#if defined(__x86_64__)
  __m128i quarter[4];
  std::memcpy(quarter, &truths, sizeof(truths));
  const __m128i low = _mm_packs_epi32(quarter[0], quarter[1]);
  const __m128i high = _mm_packs_epi32(quarter[2], quarter[3]);
  return static_cast<unsigned>(_mm_movemask_epi8(_mm_packs_epi16(low, high)));
#else
  unsigned mask = 0;
  for (std::size_t i = 0; i < block_size; ++i) mask |= static_cast<unsigned>(truths[i] != 0) << i;
  return mask;
#endif
}

/// Bit i is set where number i is below the limit.
template <class Real>
[[gnu::always_inline]] inline unsigned mask_below(const Block<Real>& numbers, Real limit) noexcept {
  if constexpr (sizeof(Real) == 4) {
    const Block<std::int32_t> below = numbers < limit;
    return mask_of(below);
  } else {
    unsigned mask = 0;
    for (std::size_t i = 0; i < block_size; ++i) mask |= static_cast<unsigned>(numbers[i] < limit) << i;
    return mask;
  }
}

/// Numbers whose bit is not set become infinite.
[[gnu::always_inline]] inline void keep_lanes(Block<float>& numbers, unsigned mask) noexcept {
  const Block<std::int32_t> bits = {1 << 0, 1 << 1, 1 << 2,  1 << 3,  1 << 4,  1 << 5,  1 << 6,  1 << 7,
                                    1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 14, 1 << 15};
  numbers = (bits & static_cast<std::int32_t>(mask)) != 0
                ? numbers
                : Block<float>{} + std::numeric_limits<float>::infinity();
}

/// Smallest of sixteen numbers, none of them NaN.
template <class Int>
[[gnu::always_inline]] inline Int smallest(const Block<Int>& numbers) noexcept {
  using Eight = Lanes<Int, 8>;
  using Four = Lanes<Int, 4>;
  Eight eights[2];
  std::memcpy(eights, &numbers, sizeof(numbers));
  const Eight eight = eights[0] < eights[1] ? eights[0] : eights[1];
  Four fours[2];
  std::memcpy(fours, &eight, sizeof(eight));
  Four four = fours[0] < fours[1] ? fours[0] : fours[1];
  Four swapped;
  shuffle<2, 3, 0, 1>(four, four, swapped);
  four = four < swapped ? four : swapped;
  Four crossed;
  shuffle<1, 0, 3, 2>(four, four, crossed);
  four = four < crossed ? four : crossed;
  return four[0];
}

/// Of sixteen whole numbers, by halves.
[[nodiscard, gnu::always_inline]] inline std::int32_t sum_of(const Block<std::int32_t>& numbers) noexcept {
  Lanes<std::int32_t, 4> quarter[4];
  std::memcpy(quarter, &numbers, sizeof(numbers));
  const Lanes<std::int32_t, 4> sums = (quarter[0] + quarter[1]) + (quarter[2] + quarter[3]);
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/// Adds one axis to sixteen sums: at once where the metric is written for any number type, else one by one.
template <class Real, class M>
[[gnu::always_inline]] inline void accumulate_block(const M& metric, Block<Real>& sums,
                                                    const Block<Real>& difference,
                                                    std::size_t axis) noexcept {
  if constexpr (requires { metric.accumulate(sums, difference, axis); }) {
    metric.accumulate(sums, difference, axis);
  } else {
    for (std::size_t i = 0; i < block_size; ++i) {
      Real sum = sums[i];
      const Real one = difference[i];
      metric.accumulate(sum, one, axis);
      sums[i] = sum;
    }
  }
}

/// Memory on cache lines.
template <class T>
struct CacheLineAllocator {
  using value_type = T;
  CacheLineAllocator() = default;
  template <class U>
  explicit(false) CacheLineAllocator(const CacheLineAllocator<U>&) noexcept {}
  [[nodiscard]] T* allocate(std::size_t count) {
    return static_cast<T*>(::operator new(count * sizeof(T), std::align_val_t{64}));
  }
  void deallocate(T* memory, std::size_t) noexcept { ::operator delete(memory, std::align_val_t{64}); }
  /// Numbers are left unset by resize(): whoever asks for them writes them.
  template <class U>
  void construct(U* at) noexcept {
    ::new (static_cast<void*>(at)) U;
  }
  template <class U, class... Args>
  void construct(U* at, Args&&... args) {
    ::new (static_cast<void*>(at)) U(static_cast<Args&&>(args)...);
  }
  bool operator==(const CacheLineAllocator&) const = default;
};
template <class T>
using AlignedVector = std::vector<T, CacheLineAllocator<T>>;

}}}  // namespace cairn::CAIRN_ABI::detail
