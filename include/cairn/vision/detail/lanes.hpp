// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Four numbers side by side, by the compiler's vector extensions: SSE2 on every x86-64, NEON on AArch64,
/// plain instructions elsewhere. The same operations in the same order everywhere, so nothing depends on
/// -march (but for fused multiply-add, if that allows it) or on the level of optimisation.
///
/// Eight lanes chosen at run time pay in box_hessian.hpp and cell_grid.hpp, where they are left to the
/// compiler's vectoriser: GCC splits longer vectors of an inlined function before it sees that the caller is
/// for AVX2.
#pragma once

#include <cstdint>

#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

using Unsigned4 = Lanes<std::uint32_t, 4>;
using Signed4 = Lanes<std::int32_t, 4>;
using Float4 = Lanes<float, 4>;
using Long2 = Lanes<std::uint64_t, 2>;

/// from[0], from[1], also_from[0], also_from[1].
template <class Number>
[[nodiscard, gnu::always_inline]] inline auto load_pairs(const Number* from,
                                                         const Number* also_from) noexcept {
  static_assert(sizeof(Number) == 4);
  return reinterpret_cast<Lanes<Number, 4>>(Long2{load<std::uint64_t>(from), load<std::uint64_t>(also_from)});
}

/// Without the sign bit: one instruction, where a comparison takes five.
[[nodiscard, gnu::always_inline]] inline Float4 absolute(Float4 numbers) noexcept {
  return reinterpret_cast<Float4>(reinterpret_cast<Signed4>(numbers) & 0x7FFFFFFF);
}

[[nodiscard, gnu::always_inline]] inline Float4 to_float(Unsigned4 two_complement) noexcept {
  return __builtin_convertvector(reinterpret_cast<Signed4>(two_complement), Float4);
}

}}}  // namespace cairn::CAIRN_ABI::detail
