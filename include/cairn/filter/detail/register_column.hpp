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
#include <cstring>
#include <utility>

#include <cairn/filter/structured.hpp>
#include <cairn/simd/shuffle.hpp>
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

/// Widest SIMD register of the target that N numbers can use, in bytes.
template <int N, class S>
inline constexpr int lane_bytes =
#if defined(__AVX512F__)
    N * sizeof(S) > 32 ? 64 :
#endif
#if defined(__AVX__)
    N * sizeof(S) > 16 ? 32
                       :
#endif
                       16;

/// The register type of so many bytes; the number itself where there is none for it.
template <class S, int Bytes>
struct RegisterOf {
  using type = S;
};
template <int Bytes>
struct RegisterOf<double, Bytes> {
  typedef double type __attribute__((vector_size(Bytes), may_alias));
};
template <int Bytes>
struct RegisterOf<float, Bytes> {
  typedef float type __attribute__((vector_size(Bytes), may_alias));
};

/// W numbers in a register.
template <class S, int W>
using LaneOfWidth = typename RegisterOf<S, W* static_cast<int>(sizeof(S))>::type;

/// Lane l of the result is number Pick{}(l) of a and b written one after the other.
template <class S, int W, class Pick, class Lane>
[[gnu::always_inline]] inline LaneOfWidth<S, W> shuffled(const Lane& a, const Lane& b) {
  LaneOfWidth<S, W> result;
  [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
    shuffle<Pick{}(static_cast<int>(I))...>(a, b, result);
  }(std::make_index_sequence<W>{});
  return result;
}

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
[[gnu::always_inline]] inline LaneOfWidth<S, W> load_lanes(const S* from) {
  using Lane = LaneOfWidth<S, W>;
  constexpr int half = W / 2;
  if constexpr (R >= W) {
    Lane lane;
    std::memcpy(&lane, from, sizeof(Lane));
    return lane;
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
    std::memcpy(to, &lane, sizeof(Lane));
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
[[gnu::always_inline]] inline LaneOfWidth<S, W> lane_numbers() {
  return []<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
    return LaneOfWidth<S, W>{S(I)...};
  }(std::make_index_sequence<static_cast<std::size_t>(W)>{});
}

/// N numbers in SIMD registers. Lanes beyond N hold zero after load() and are never read.
template <int N, class S>
struct Column {
  using Lane = typename RegisterOf<S, lane_bytes<N, S>>::type;
  static constexpr int width = static_cast<int>(sizeof(Lane) / sizeof(S));
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
  /// From single numbers: not loaded as a whole, which would have to wait for all of them to be stored.
  [[gnu::always_inline]] void gather(const S (&from)[N]) {
    unrolled<static_cast<std::size_t>(count)>([&](auto index) __attribute__((always_inline)) {
      constexpr int k = static_cast<int>(index);
      if constexpr (width == 1)
        lanes[k] = from[k];
      else
        [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
          lanes[k] =
              Lane{(k * width + static_cast<int>(I) < N
                        ? from[k * width + static_cast<int>(I) < N ? k * width + static_cast<int>(I) : 0]
                        : S(0))...};
        }(std::make_index_sequence<static_cast<std::size_t>(width)>{});
    });
  }
  [[gnu::always_inline]] const S& operator[](int i) const { return reinterpret_cast<const S*>(lanes)[i]; }
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
