// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rigid motions of space. Tangent: translation, then rotation; steps are on the right:
/// retract(T, d) = T exp(d).
///
/// T_a_b maps coordinates in frame b to coordinates in frame a, p_a = T_a_b * p_b; as a pose it is where b
/// stands in a. Neighbouring names cancel: T_a_c = T_a_b * T_b_c. With d = (rho, w):
///   exp(d) = (exp(w), J_l(w) rho)                                                        (1)
///   Ad(R, t) = [R, skew(t) R; 0, R]             T exp(d) = exp(Ad d) T                   (2)
///   J_l(d) = [J_l(w), Q(rho, w); 0, J_l(w)]     exp(d + e) ~ exp(J_l e) exp(d)           (3)
/// (T. Barfoot, P. Furgale, "Associating uncertainty with three-dimensional poses for use in estimation
/// problems", IEEE T-RO 30(3), 2014, appendix; Q with the Stumpff functions of stumpff.hpp.)
#pragma once

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/manifold/detail/stumpff.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/so3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A rigid motion, or pose.
template <class S = double>
class BasicSE3 {
public:
  using Scalar = S;
  using Tangent = Vector<6, S>;  ///< translation, then rotation

  /// The identity.
  BasicSE3() : translation_(Vector<3, S>::Zero()) {}
  BasicSE3(const BasicSO3<S>& rotation, const Vector<3, S>& translation)
      : rotation_(rotation), translation_(translation) {}

  /// From a 4x4 matrix. Throws Error where the upper left is no rotation (see SO3::from_matrix), the last row
  /// is not 0 0 0 1, or the translation is not finite.
  [[nodiscard]] static BasicSE3 from_matrix(const Matrix<4, 4, S>& m, const S& tolerance = S(1e-3)) {
    for (int i = 0; i < 3; ++i)
      if (!(m(3, i) == S(0)) || !(m(i, 3) - m(i, 3) == S(0)))
        raise("SE3::from_matrix: expected a finite translation and the last row 0 0 0 1");
    if (!(m(3, 3) == S(1))) raise("SE3::from_matrix: expected the last row 0 0 0 1");
    return BasicSE3(BasicSO3<S>::from_matrix(part_of<3, 3>(m, 0, 0), tolerance), part_of<3, 1>(m, 0, 3));
  }

  [[nodiscard]] const BasicSO3<S>& rotation() const noexcept { return rotation_; }
  [[nodiscard]] const Vector<3, S>& translation() const noexcept { return translation_; }

  [[nodiscard]] Matrix<4, 4, S> matrix() const {
    Matrix<4, 4, S> m = Matrix<4, 4, S>::Identity();
    put(m, 0, 0, rotation_.matrix());
    put(m, 0, 3, translation_);
    return m;
  }

  [[nodiscard]] BasicSE3 inverse() const {
    const BasicSO3<S> back = rotation_.inverse();
    return BasicSE3(back, -back.rotate(translation_));
  }

  [[nodiscard]] BasicSE3 operator*(const BasicSE3& b) const {
    return BasicSE3(rotation_ * b.rotation_, translation_ + rotation_.rotate(b.translation_));
  }
  [[nodiscard]] Vector<3, S> operator*(const Vector<3, S>& p) const {
    return rotation_.rotate(p) + translation_;
  }

  [[nodiscard]] static BasicSE3 exp(const Tangent& d) {  // (1)
    const Vector<3, S> rho = translation_of(d), omega = rotation_of(d);
    return BasicSE3(BasicSO3<S>::exp(omega), product(BasicSO3<S>::left_jacobian(omega), rho));
  }

  /// The step from the identity to this motion; its rotation part is at most pi long.
  [[nodiscard]] Tangent log() const {
    const Vector<3, S> omega = rotation_.log();
    const Vector<3, S> rho = product(BasicSO3<S>::left_jacobian_inverse(omega), translation_);
    Tangent d;
    put(d, 0, 0, rho);
    put(d, 3, 0, omega);
    return d;
  }

  [[nodiscard]] Matrix<6, 6, S> adjoint() const {  // (2)
    const Matrix<3, 3, S> R = rotation_.matrix();
    return upper_triangular(R, product(skew(translation_), R));
  }

  [[nodiscard]] static Matrix<6, 6, S> left_jacobian(const Tangent& d) {  // (3)
    return upper_triangular(BasicSO3<S>::left_jacobian(rotation_of(d)), coupling(d));
  }
  /// exp(d + e) ~ exp(d) exp(J_r e); J_r(d) = J_l(-d).
  [[nodiscard]] static Matrix<6, 6, S> right_jacobian(const Tangent& d) { return left_jacobian(-d); }

  /// Inverse of left_jacobian; finite for rotations below 2 pi.
  [[nodiscard]] static Matrix<6, 6, S> left_jacobian_inverse(const Tangent& d) {
    const Matrix<3, 3, S> inverse = BasicSO3<S>::left_jacobian_inverse(rotation_of(d));
    return upper_triangular(inverse, -product(inverse, product(coupling(d), inverse)));
  }
  [[nodiscard]] static Matrix<6, 6, S> right_jacobian_inverse(const Tangent& d) {
    return left_jacobian_inverse(-d);
  }

  template <class T>
  [[nodiscard]] BasicSE3<T> cast() const {
    return BasicSE3<T>(rotation_.template cast<T>(), translation_.template cast<T>());
  }

private:
  [[nodiscard]] static Matrix<6, 6, S> upper_triangular(const Matrix<3, 3, S>& diagonal,
                                                        const Matrix<3, 3, S>& corner) {
    Matrix<6, 6, S> m = Matrix<6, 6, S>::Zero();
    put(m, 0, 0, diagonal);
    put(m, 0, 3, corner);
    put(m, 3, 3, diagonal);
    return m;
  }

  [[nodiscard]] static Vector<3, S> translation_of(const Tangent& d) { return part_of<3, 1>(d, 0, 0); }
  [[nodiscard]] static Vector<3, S> rotation_of(const Tangent& d) { return part_of<3, 1>(d, 3, 0); }

  // Q(rho, w) of (3).
  [[nodiscard]] static Matrix<3, 3, S> coupling(const Tangent& d) {
    const Vector<3, S> omega = rotation_of(d);
    const detail::Stumpff<S> f = detail::stumpff<S>(omega.squaredNorm());
    const S last = S(0.5) * (f.c[4] - S(3) * f.c[5]);
    const Matrix<3, 3, S> P = skew(translation_of(d)), W = skew(omega);
    const Matrix<3, 3, S> WP = product(W, P), PW = product(P, W), WPW = product(WP, W);
    const Matrix<3, 3, S> WWP = product(W, WP), PWW = product(PW, W), WPWW = product(WPW, W),
                          WWPW = product(W, WPW);
    Matrix<3, 3, S> Q;
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i)
        Q(i, j) = S(0.5) * P(i, j) + f.c[3] * (WP(i, j) + PW(i, j) + WPW(i, j)) +
                  f.c[4] * (WWP(i, j) + PWW(i, j) - S(3) * WPW(i, j)) + last * (WPWW(i, j) + WWPW(i, j));
    return Q;
  }

  BasicSO3<S> rotation_;
  Vector<3, S> translation_;
};

using SE3 = BasicSE3<double>;
using SE3f = BasicSE3<float>;

template <class S>
struct manifold_traits<BasicSE3<S>> {
  using Scalar = S;
  using Tangent = Vector<6, S>;
  static constexpr int dof = 6;
  static BasicSE3<S> retract(const BasicSE3<S>& x, const Tangent& d) { return x * BasicSE3<S>::exp(d); }
  static Tangent local(const BasicSE3<S>& x, const BasicSE3<S>& y) { return (x.inverse() * y).log(); }
};

}}  // namespace cairn::CAIRN_ABI
