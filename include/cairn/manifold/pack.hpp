// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Several numbers computed side by side in one SIMD register: a scalar that a user's templated function can
/// be called with, as it can be with dual numbers.
///
/// A function that compares its arguments says select(a < b, x, y) instead of `if`. sin, cos and atan2 are
/// polynomials with errors below 2.5 ulp for double (pack_math.hpp); other functions go number by number.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// W numbers of type S, float or double; W a power of two. Uninitialised by default, like S itself.
template <class S, int W>
struct Pack {
  using Register = detail::Lanes<S, W>;
  using Mask = decltype(Register{} < Register{});

  Register lanes;

  Pack() = default;
  // NOLINTNEXTLINE(google-explicit-constructor): constants are the same in every lane
  Pack(const S& value) : lanes(Register{} + value) {}
  // NOLINTNEXTLINE(google-explicit-constructor): so that whole literals mix with packs
  Pack(int value) : Pack(static_cast<S>(value)) {}
  template <class T>
    requires(std::is_floating_point_v<T> && !std::is_same_v<T, S>)
  explicit(sizeof(T) > sizeof(S)) Pack(const T& value) : Pack(static_cast<S>(value)) {}
  [[nodiscard]] static Pack of(const Register& lanes) {
    Pack pack;
    pack.lanes = lanes;
    return pack;
  }

  [[nodiscard]] S operator[](int lane) const { return lanes[lane]; }
  Pack operator-() const { return of(-lanes); }
  Pack& operator+=(const Pack& b) { return *this = *this + b; }
  Pack& operator-=(const Pack& b) { return *this = *this - b; }
  Pack& operator*=(const Pack& b) { return *this = *this * b; }
  Pack& operator/=(const Pack& b) { return *this = *this / b; }

  friend Pack operator+(const Pack& a, const Pack& b) { return of(a.lanes + b.lanes); }
  friend Pack operator-(const Pack& a, const Pack& b) { return of(a.lanes - b.lanes); }
  friend Pack operator*(const Pack& a, const Pack& b) { return of(a.lanes * b.lanes); }
  friend Pack operator/(const Pack& a, const Pack& b) { return of(a.lanes / b.lanes); }
  friend Mask operator<(const Pack& a, const Pack& b) { return a.lanes < b.lanes; }
  friend Mask operator>(const Pack& a, const Pack& b) { return a.lanes > b.lanes; }
  friend Mask operator<=(const Pack& a, const Pack& b) { return a.lanes <= b.lanes; }
  friend Mask operator>=(const Pack& a, const Pack& b) { return a.lanes >= b.lanes; }
  friend Mask operator==(const Pack& a, const Pack& b) { return a.lanes == b.lanes; }

  /// Lane by lane: a where the mask holds, b where not.
  friend Pack select(const Mask& mask, const Pack& a, const Pack& b) { return of(mask ? a.lanes : b.lanes); }
  friend Pack abs(const Pack& a) { return of(a.lanes < S(0) ? -a.lanes : a.lanes); }
  friend Pack fabs(const Pack& a) { return abs(a); }

  /// Any function of single numbers.
  template <class F>
  [[nodiscard]] static Pack map(const F& f, const Pack& a) {
    Pack result;
    for (int l = 0; l < W; ++l) result.lanes[l] = f(a.lanes[l]);
    return result;
  }
  friend Pack floor(const Pack& a) {
    return map([](S v) { return std::floor(v); }, a);
  }
  friend Pack exp(const Pack& a) {
    return map([](S v) { return std::exp(v); }, a);
  }
  friend Pack log(const Pack& a) {
    return map([](S v) { return std::log(v); }, a);
  }
  friend Pack tan(const Pack& a) {
    return map([](S v) { return std::tan(v); }, a);
  }
};

namespace detail {

template <class T>
inline constexpr bool is_pack = false;
template <class S, int W>
inline constexpr bool is_pack<Pack<S, W>> = true;

/// Lanes in the widest register of the target.
template <class S>
inline constexpr int pack_width = lane_count<S, 64>;

}  // namespace detail
}}  // namespace cairn::CAIRN_ABI

/// Lets Eigen's vectors hold packs.
template <class S, int W>
struct Eigen::NumTraits<cairn::Pack<S, W>> : Eigen::GenericNumTraits<S> {
  using Real = cairn::Pack<S, W>;
  using NonInteger = cairn::Pack<S, W>;
  using Nested = cairn::Pack<S, W>;
  using Literal = S;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 0,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
};
