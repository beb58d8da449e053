// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rigid motions of the plane: poses of vehicles. Tangent (x, y, theta), translation before rotation, on the
/// right: retract(T, d) = T exp(d), so that a step is seen from the vehicle.
///
///   exp(rho, a) = ( V rho, a ),   V = [sin a / a, -(1 - cos a)/a; (1 - cos a)/a, sin a / a]
/// (J. Sola, J. Deray, D. Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, app. C.)
#pragma once

#include <cmath>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A pose in the plane.
template <class S = double>
class BasicSE2 {
public:
  using Scalar = S;
  using Tangent = Vector<3, S>;

  /// The identity.
  BasicSE2() : translation_(Vector<2, S>::Zero()) {}
  BasicSE2(const BasicSO2<S>& rotation, const Vector<2, S>& translation)
      : rotation_(rotation), translation_(translation) {}
  /// At (x, y), heading `theta` [rad].
  BasicSE2(const S& x, const S& y, const S& theta) : rotation_(theta), translation_(x, y) {}

  [[nodiscard]] static BasicSE2 exp(const Tangent& d) {
    const Coefficients k = coefficients(d(2));
    return BasicSE2(k.sine * d(0) - k.cosine * d(1), k.cosine * d(0) + k.sine * d(1), d(2));
  }

  [[nodiscard]] Tangent log() const {
    const S& a = rotation_.angle();
    const Coefficients k = coefficients(a);
    const S scale = S(1) / (k.sine * k.sine + k.cosine * k.cosine);
    const Vector<2, S>& t = translation_;
    return {scale * (k.sine * t(0) + k.cosine * t(1)), scale * (k.sine * t(1) - k.cosine * t(0)), a};
  }

  [[nodiscard]] const BasicSO2<S>& rotation() const noexcept { return rotation_; }
  [[nodiscard]] const Vector<2, S>& translation() const noexcept { return translation_; }
  [[nodiscard]] const S& x() const noexcept { return translation_(0); }
  [[nodiscard]] const S& y() const noexcept { return translation_(1); }
  /// Heading in [-pi, pi].
  [[nodiscard]] const S& angle() const noexcept { return rotation_.angle(); }

  [[nodiscard]] BasicSE2 inverse() const {
    const BasicSO2<S> back = rotation_.inverse();
    return BasicSE2(back, -(back * translation_));
  }
  [[nodiscard]] BasicSE2 operator*(const BasicSE2& b) const {
    return BasicSE2(rotation_ * b.rotation_, translation_ + rotation_ * b.translation_);
  }
  [[nodiscard]] Vector<2, S> operator*(const Vector<2, S>& p) const { return translation_ + rotation_ * p; }

  /// T exp(d) = exp(Ad d) T.
  [[nodiscard]] Matrix<3, 3, S> adjoint() const {
    Matrix<3, 3, S> m = Matrix<3, 3, S>::Identity();
    m.template topLeftCorner<2, 2>() = rotation_.matrix();
    m(0, 2) = translation_(1);
    m(1, 2) = -translation_(0);
    return m;
  }

  template <class T>
  [[nodiscard]] BasicSE2<T> cast() const {
    return BasicSE2<T>(rotation_.template cast<T>(), translation_.template cast<T>());
  }

private:
  struct Coefficients {
    S sine, cosine;  // sin a / a and (1 - cos a) / a
  };
  [[nodiscard]] static Coefficients coefficients(const S& a) {
    using std::cos;
    using std::sin;
    const S squared = a * a;
    if (squared < S(1e-4)) {  // the next term is below 1e-17
      return {S(1) - squared / S(6) * (S(1) - squared / S(20) * (S(1) - squared / S(42))),
              a * S(0.5) * (S(1) - squared / S(12) * (S(1) - squared / S(30) * (S(1) - squared / S(56))))};
    }
    const S half = a * S(0.5), s = sin(half), twice = S(2) * s / a;  // 1 - cos a = 2 sin^2 (a / 2)
    return {twice * cos(half), twice * s};
  }

  BasicSO2<S> rotation_;
  Vector<2, S> translation_;
};

using SE2 = BasicSE2<double>;
using SE2f = BasicSE2<float>;

template <class S>
struct manifold_traits<BasicSE2<S>> {
  using Scalar = S;
  using Tangent = Vector<3, S>;
  static constexpr int dof = 3;
  static BasicSE2<S> retract(const BasicSE2<S>& x, const Tangent& d) { return x * BasicSE2<S>::exp(d); }
  static Tangent local(const BasicSE2<S>& x, const BasicSE2<S>& y) { return (x.inverse() * y).log(); }
  static bool finite(const BasicSE2<S>& x) {
    const S sum = x.x() + x.y() + x.angle();
    return sum - sum == S(0);
  }
};

}}  // namespace cairn::CAIRN_ABI
