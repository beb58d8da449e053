// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rotations of the plane: headings and bearings. A step is an angle [rad]; local() wraps to [-pi, pi].
///
/// Inside is the angle itself, so that retract is an addition and a bearing costs no sine.
#pragma once

#include <cmath>
#include <concepts>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

template <class S>
inline constexpr S pi = S(3.14159265358979323846264338327950288L);

}  // namespace detail

/// The angle equal to `a` modulo 2 pi in [-pi, pi]. Exact for |a| <= pi.
template <class S>
[[nodiscard]] S wrapped(const S& a) {
  using std::floor;
  if (a >= -detail::pi<S> && a <= detail::pi<S>) [[likely]]
    return a;
  const S turns = floor(a / (S(2) * detail::pi<S>)+S(0.5));
  const S rest = a - turns * (S(2) * detail::pi<S>);
  if constexpr (std::floating_point<S>)  // of so many turns that none of the digits of the rest are right
    if (!(rest >= -detail::pi<S> && rest <= detail::pi<S>)) return std::remainder(a, S(2) * detail::pi<S>);
  return rest;
}

/// A rotation of the plane. S is float, double or a scalar with arithmetic, order, floor, sin and cos.
template <class S = double>
class BasicSO2 {
public:
  using Scalar = S;
  using Tangent = Vector<1, S>;

  /// The identity.
  BasicSO2() : angle_(0) {}
  /// Rotation by `angle` [rad], anticlockwise, any number of turns.
  explicit BasicSO2(const S& angle) : angle_(wrapped(angle)) {}

  /// In [-pi, pi].
  [[nodiscard]] const S& angle() const noexcept { return angle_; }

  [[nodiscard]] Matrix<2, 2, S> matrix() const {
    using std::cos;
    using std::sin;
    const S c = cos(angle_), s = sin(angle_);
    Matrix<2, 2, S> r;
    r << c, -s, s, c;
    return r;
  }
  [[nodiscard]] BasicSO2 inverse() const { return BasicSO2(-angle_); }
  [[nodiscard]] BasicSO2 operator*(const BasicSO2& b) const { return BasicSO2(angle_ + b.angle_); }
  [[nodiscard]] Vector<2, S> operator*(const Vector<2, S>& p) const {
    using std::cos;
    using std::sin;
    const S c = cos(angle_), s = sin(angle_);
    return {c * p(0) - s * p(1), s * p(0) + c * p(1)};
  }

  template <class T>
  [[nodiscard]] BasicSO2<T> cast() const {
    return BasicSO2<T>(static_cast<T>(angle_));
  }

private:
  S angle_;
};

using SO2 = BasicSO2<double>;
using SO2f = BasicSO2<float>;

template <class S>
struct manifold_traits<BasicSO2<S>> {
  using Scalar = S;
  using Tangent = Vector<1, S>;
  static constexpr int dof = 1;
  static BasicSO2<S> retract(const BasicSO2<S>& x, const Tangent& d) { return BasicSO2<S>(x.angle() + d(0)); }
  static Tangent local(const BasicSO2<S>& x, const BasicSO2<S>& y) {
    return Tangent(wrapped(S(y.angle() - x.angle())));
  }
  static bool finite(const BasicSO2<S>& x) { return x.angle() - x.angle() == S(0); }
};

}}  // namespace cairn::CAIRN_ABI
