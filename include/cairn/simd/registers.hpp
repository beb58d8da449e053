// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Numbers side by side as GNU vectors, the registers of the target among them, their lanes in another order,
/// and loops that keep arrays of them in registers.
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>
#include <utility>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Calls body(i) for i in [first, last) within [0, Size). Written out where Size is small, so that columns
/// stay in registers; clang does so by itself. A body whose inner bounds depend on i has to be always_inline:
/// left a function of its own, gcc 12 warns of rows that no i within bounds reaches.
template <int Size, class Body>
[[gnu::always_inline]] inline void each(int first, int last, const Body& body) {
  if constexpr (Size <= 10) {
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC unroll 16
#endif
    for (int i = first; i < last; ++i) body(i);
  } else {
    for (int i = first; i < last; ++i) body(i);
  }
}
template <int Size, class Body>
[[gnu::always_inline]] inline void each(const Body& body) {
  each<Size>(0, Size, body);
}

/// W numbers side by side, in as many registers as the target takes for them; the number itself where there
/// is no register of such (dual numbers, long double).
template <class T, int W>
struct LanesOf {
  using type = T;
};
template <class T>
inline constexpr bool has_lanes = std::is_arithmetic_v<T> && !std::is_same_v<T, long double>;
template <class T, int W>
  requires has_lanes<T>
struct LanesOf<T, W> {
  typedef T type __attribute__((vector_size(W * sizeof(T))));
};
/// What is wider than the target's registers goes by reference only: by value the calling convention depends
/// on the target.
template <class T, int W>
using Lanes = typename LanesOf<T, W>::type;

/// How many lanes the widest register of the target has that N numbers can use.
template <class T, int N>
inline constexpr int lane_count = !has_lanes<T> ? 1 :
#if defined(__AVX512F__)
                                  N * sizeof(T) > 32 ? 64 / sizeof(T)
                                  :
#endif
#if defined(__AVX__)
                                  N * sizeof(T) > 16 ? 32 / sizeof(T)
                                                     :
#endif
                                                     16 / sizeof(T);

/// That register.
template <class T, int N>
using RegisterFor = Lanes<T, lane_count<T, N>>;

/// Lane k of the result becomes lane From[k] of a and b written one after the other. The result has as many
/// lanes as there are numbers.
template <int... From, class Vector, class Result>
[[gnu::always_inline]] inline void shuffle(const Vector& a, const Vector& b, Result& result) noexcept {
#if __has_builtin(__builtin_shufflevector)
  result = __builtin_shufflevector(a, b, From...);
#else  // gcc 11
  constexpr int width = static_cast<int>(sizeof(Vector) / sizeof(a[0]));
  if constexpr (sizeof(Result) == sizeof(Vector)) {
    using Order = decltype(a < b);  // integers as wide as the numbers
    result = __builtin_shuffle(a, b, Order{From...});
  } else {
    result = Result{(From < width ? a[From % width] : b[From % width])...};
  }
#endif
}

/// The same by value. The order is Pick{}(0), Pick{}(1) ... where that says more than the numbers.
template <int... From, class Lane>
[[nodiscard, gnu::always_inline]] inline auto shuffled(const Lane& a, const Lane& b) noexcept {
  Lanes<std::remove_cvref_t<decltype(a[0])>, sizeof...(From)> result;
  shuffle<From...>(a, b, result);
  return result;
}
template <class S, int W, class Pick, class Lane>
[[nodiscard, gnu::always_inline]] inline Lanes<S, W> shuffled(const Lane& a, const Lane& b) noexcept {
  return [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
    return shuffled<Pick{}(static_cast<int>(I))...>(a, b);
  }(std::make_index_sequence<W>{});
}

/// As many numbers as there are lanes, from or to any address.
template <class Lane, class T>
[[nodiscard, gnu::always_inline]] inline Lane load(const T* from) noexcept {
  Lane lane;
  std::memcpy(&lane, from, sizeof(Lane));
  return lane;
}
template <class Lane, class T>
[[gnu::always_inline]] inline void store(const Lane& lane, T* to) noexcept {
  std::memcpy(to, &lane, sizeof(Lane));
}

/// The sum of two lanes or four, in an order that is the same everywhere.
template <class Lane>
[[nodiscard]] inline auto sum(const Lane& lane) noexcept {
  if constexpr (sizeof(Lane) == 2 * sizeof(lane[0]))
    return lane[0] + lane[1];
  else
    return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

}}}  // namespace cairn::CAIRN_ABI::detail
