// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A column of a small matrix in SIMD registers.
///
/// Columns move between memory and registers in whole powers of two, largest first (a column of six doubles
/// is four and two). A processor hands a stored number straight on to a load only if one store wrote all that
/// the load asks for; loading by the pieces that store() wrote keeps that true from one step of a filter to
/// the next. Masked or padded moves would not.
#pragma once

#include <cstddef>
#include <utility>

#include <cairn/filter/structured.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Numbers First, First + 1, ...
template <int First>
struct PickFrom {
  constexpr int operator()(int l) const { return First + l; }
};
/// One half of an exchange of pairs at distance S between two rows of W (see transpose_lanes).
template <int W, int S, bool Second>
struct PickExchanged {
  constexpr int operator()(int l) const {
    if ((l & S) != 0) return W + (Second ? l : l - S);
    return Second ? l + S : l;
  }
};
/// The first L numbers of b, then those of a.
template <int W, int L>
struct PickHead {
  constexpr int operator()(int l) const { return l < L ? W + l : l; }
};

/// The first R of W lanes from memory, zero in the others.
template <class S, int W, int R>
[[gnu::always_inline]] inline Lanes<S, W> load_lanes(const S* from) {
  using Lane = Lanes<S, W>;
  constexpr int half = W / 2;
  if constexpr (R >= W) {
    return load<Lane>(from);
  } else if constexpr (R <= 0) {
    return Lane{};
  } else if constexpr (W == 2) {
    return Lane{from[0], S(0)};
  } else {
    return shuffled<S, W, PickFrom<0>>(load_lanes<S, half, R>(from),
                                       load_lanes<S, half, R - half>(from + (R > half ? half : 0)));
  }
}

/// The first R of W lanes to memory.
template <class S, int W, int R, class Lane>
[[gnu::always_inline]] inline void store_lanes(S* to, const Lane& lane) {
  constexpr int half = W / 2;
  if constexpr (R >= W) {
    store(lane, to);
  } else if constexpr (W == 2) {
    if constexpr (R == 1) to[0] = lane[0];
  } else if constexpr (R > 0) {
    store_lanes<S, half, R>(to, shuffled<S, half, PickFrom<0>>(lane, lane));
    if constexpr (R > half)
      store_lanes<S, half, R - half>(to + half, shuffled<S, half, PickFrom<half>>(lane, lane));
  }
}

/// 0, 1, 2, ... in the lanes of a register.
template <class S, int W>
[[gnu::always_inline]] inline Lanes<S, W> lane_numbers() {
  return []<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
    return Lanes<S, W>{S(I)...};
  }(std::make_index_sequence<static_cast<std::size_t>(W)>{});
}

/// N numbers in SIMD registers. Lanes beyond N hold zero after load() and are never read.
template <int N, class S>
struct Column {
  using Lane = RegisterFor<S, N>;
  static constexpr int width = lane_count<S, N>;
  static constexpr int count = (N + width - 1) / width;
  Lane lanes[static_cast<std::size_t>(count)];

  [[gnu::always_inline]] void set_zero() {
    each<count>([&](int k) { lanes[k] = Lane{}; });
  }
  [[gnu::always_inline]] void load(const S* from) {
    unrolled<static_cast<std::size_t>(count)>([&](auto index) __attribute__((always_inline)) {
      constexpr int k = static_cast<int>(index);
      if constexpr (width == 1)
        lanes[k] = from[k];
      else
        lanes[k] = load_lanes<S, width, N - k * width>(from + k * width);
    });
  }
  [[gnu::always_inline]] void store(S* to) const {
    unrolled<static_cast<std::size_t>(count)>([&](auto index) __attribute__((always_inline)) {
      constexpr int k = static_cast<int>(index);
      if constexpr (width == 1)
        to[k] = lanes[k];
      else
        store_lanes<S, width, N - k * width>(to + k * width, lanes[k]);
    });
  }
  /// Number I, 0 past the last.
  template <int I>
  [[gnu::always_inline]] static S number_or_zero(const S (&from)[N]) {
    if constexpr (I < N)
      return from[I];
    else
      return S(0);
  }
  /// From single numbers: not loaded as a whole, which would have to wait for all of them to be stored.
  [[gnu::always_inline]] void gather(const S (&from)[N]) {
    unrolled<static_cast<std::size_t>(count)>([&](auto index) __attribute__((always_inline)) {
      constexpr int k = static_cast<int>(index);
      if constexpr (width == 1)
        lanes[k] = from[k];
      else
        [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
          lanes[k] = Lane{number_or_zero<k * width + static_cast<int>(I)>(from)...};
        }(std::make_index_sequence<static_cast<std::size_t>(width)>{});
    });
  }
  /// Few numbers are read from a copy of their register: a compiler that sees single ones read from the array
  /// takes that to pieces, and puts the registers together again through memory. Where there are many, loops
  /// stay loops (each()) and the array is in memory anyway.
  [[gnu::always_inline]] S operator[](int i) const {
    if constexpr (width > 1 && N <= 10) {
      const Lane lane = lanes[i / width];
      return lane[i % width];
    } else {
      return reinterpret_cast<const S*>(lanes)[i];
    }
  }
  [[gnu::always_inline]] void add(const Column& other) {
    each<count>([&](int k) { lanes[k] += other.lanes[k]; });
  }
  // Factors come by value: one may be a number of the very column that is scaled.
  [[gnu::always_inline]] void add(const Column& other, S factor) {
    each<count>([&](int k) { lanes[k] += other.lanes[k] * factor; });
  }
  [[gnu::always_inline]] void subtract(const Column& other, S factor) {
    each<count>([&](int k) { lanes[k] -= other.lanes[k] * factor; });
  }
  [[gnu::always_inline]] void scale(S factor) {
    each<count>([&](int k) { lanes[k] *= factor; });
  }
};

}}}  // namespace cairn::CAIRN_ABI::detail
