// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Dual numbers: a value and its N partial derivatives, carried through a user's templated function.
///
///   f(a + b e) = f(a) + f'(a) b e,   e^2 = 0     (W. K. Clifford 1873; forward automatic differentiation)
#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A number of type S and its derivatives by N variables. Comparisons look at the value alone.
template <class S, int N>
struct Dual {
  S value{};
  S slope[N]{};

  constexpr Dual() = default;
  // NOLINTNEXTLINE(google-explicit-constructor): constants have no slope
  constexpr Dual(const S& v) : value(v) {}
  // NOLINTNEXTLINE(google-explicit-constructor): so that literals mix with duals of float
  constexpr Dual(int v)
    requires(!std::is_same_v<S, int>)
      : value(static_cast<S>(v)) {}
  template <class T>
    requires(std::is_floating_point_v<T> && !std::is_same_v<T, S>)
  explicit(sizeof(T) > sizeof(S)) constexpr Dual(const T& v) : value(static_cast<S>(v)) {}

  /// The variable number `index` at the value v.
  [[nodiscard]] static constexpr Dual variable(const S& v, int index) {
    Dual d(v);
    d.slope[index] = S(1);
    return d;
  }
  /// The value v with all slopes of `by` scaled by `derivative`: the chain rule.
  [[nodiscard]] static constexpr Dual chain(const S& v, const S& derivative, const Dual& by) {
    Dual d(v);
    for (int i = 0; i < N; ++i) d.slope[i] = derivative * by.slope[i];
    return d;
  }
  /// The same for two arguments.
  [[nodiscard]] static constexpr Dual chain(const S& v, const S& da, const Dual& a, const S& db,
                                            const Dual& b) {
    Dual d(v);
    for (int i = 0; i < N; ++i) d.slope[i] = da * a.slope[i] + db * b.slope[i];
    return d;
  }

  constexpr Dual operator-() const { return chain(-value, S(-1), *this); }
  friend constexpr Dual operator+(const Dual& a, const Dual& b) {
    return chain(a.value + b.value, S(1), a, S(1), b);
  }
  friend constexpr Dual operator-(const Dual& a, const Dual& b) {
    return chain(a.value - b.value, S(1), a, S(-1), b);
  }
  friend constexpr Dual operator*(const Dual& a, const Dual& b) {
    return chain(a.value * b.value, b.value, a, a.value, b);
  }
  friend constexpr Dual operator/(const Dual& a, const Dual& b) {
    const S q = a.value / b.value;
    return chain(q, S(1) / b.value, a, -q / b.value, b);
  }
  constexpr Dual& operator+=(const Dual& b) { return *this = *this + b; }
  constexpr Dual& operator-=(const Dual& b) { return *this = *this - b; }
  constexpr Dual& operator*=(const Dual& b) { return *this = *this * b; }
  constexpr Dual& operator/=(const Dual& b) { return *this = *this / b; }

  friend constexpr bool operator==(const Dual& a, const Dual& b) { return a.value == b.value; }
  friend constexpr auto operator<=>(const Dual& a, const Dual& b) { return a.value <=> b.value; }

  friend Dual sqrt(const Dual& a) {
    const S root = std::sqrt(a.value);
    return chain(root, S(0.5) / root, a);
  }
  friend Dual sin(const Dual& a) { return chain(std::sin(a.value), std::cos(a.value), a); }
  friend Dual cos(const Dual& a) { return chain(std::cos(a.value), -std::sin(a.value), a); }
  friend Dual tan(const Dual& a) {
    const S t = std::tan(a.value);
    return chain(t, S(1) + t * t, a);
  }
  friend Dual asin(const Dual& a) {
    return chain(std::asin(a.value), S(1) / std::sqrt(S(1) - a.value * a.value), a);
  }
  friend Dual acos(const Dual& a) {
    return chain(std::acos(a.value), S(-1) / std::sqrt(S(1) - a.value * a.value), a);
  }
  friend Dual atan(const Dual& a) { return chain(std::atan(a.value), S(1) / (S(1) + a.value * a.value), a); }
  friend Dual atan2(const Dual& y, const Dual& x) {
    const S squared = x.value * x.value + y.value * y.value;
    return chain(std::atan2(y.value, x.value), x.value / squared, y, -y.value / squared, x);
  }
  friend Dual hypot(const Dual& x, const Dual& y) {
    const S h = std::hypot(x.value, y.value);
    return chain(h, x.value / h, x, y.value / h, y);
  }
  friend Dual exp(const Dual& a) {
    const S e = std::exp(a.value);
    return chain(e, e, a);
  }
  friend Dual log(const Dual& a) { return chain(std::log(a.value), S(1) / a.value, a); }
  friend Dual pow(const Dual& a, const S& p) {
    return chain(std::pow(a.value, p), p * std::pow(a.value, p - S(1)), a);
  }
  friend Dual tanh(const Dual& a) {
    const S t = std::tanh(a.value);
    return chain(t, S(1) - t * t, a);
  }
  friend Dual abs(const Dual& a) { return a.value < S(0) ? -a : a; }
  friend Dual fabs(const Dual& a) { return a.value < S(0) ? -a : a; }
  friend Dual floor(const Dual& a) { return Dual(std::floor(a.value)); }
};

}}  // namespace cairn::CAIRN_ABI

/// Lets Eigen's vectors and matrices hold duals.
template <class S, int N>
struct Eigen::NumTraits<cairn::Dual<S, N>> : Eigen::GenericNumTraits<S> {
  using Real = cairn::Dual<S, N>;
  using NonInteger = cairn::Dual<S, N>;
  using Nested = cairn::Dual<S, N>;
  using Literal = S;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = N,
    AddCost = N,
    MulCost = 3 * N
  };
};

template <class S, int N>
struct std::numeric_limits<cairn::Dual<S, N>> : std::numeric_limits<S> {};
