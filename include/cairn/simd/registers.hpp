// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The registers of the target as GNU vectors, and loops that keep arrays of them in registers.
#pragma once

#include <cstddef>
#include <utility>

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

}}}  // namespace cairn::CAIRN_ABI::detail
