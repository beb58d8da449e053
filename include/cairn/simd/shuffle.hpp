// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Lanes of two GNU vectors in another order, for compilers with __builtin_shufflevector and for gcc 11,
/// which lacks it.
#pragma once

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Lane k of the result becomes lane From[k] of a and b written one after the other. The result has as many
/// lanes as there are numbers. By reference: by value the calling convention depends on the target.
template <int... From, class Vector, class Result>
[[gnu::always_inline]] inline void shuffle(const Vector& a, const Vector& b, Result& result) noexcept {
#if __has_builtin(__builtin_shufflevector)
  result = __builtin_shufflevector(a, b, From...);
#else
  constexpr int width = static_cast<int>(sizeof(Vector) / sizeof(a[0]));
  if constexpr (sizeof(Result) == sizeof(Vector)) {
    using Order = decltype(a < b);  // integers as wide as the numbers
    result = __builtin_shuffle(a, b, Order{From...});
  } else {
    result = Result{(From < width ? a[From % width] : b[From % width])...};
  }
#endif
}

}}}  // namespace cairn::CAIRN_ABI::detail
