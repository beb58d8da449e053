// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Rotations of space. Steps are on the right: retract(R, w) = R exp(w), w a rotation vector [rad].
///
/// A unit quaternion w + xi + yj + zk inside. With a = |w|, W = skew(w), c_k of stumpff.hpp at a^2:
///   exp(w) = I + c_1 W + c_2 W^2                                                         (1)
///   left Jacobian   J_l(w) = I + c_2 W + c_3 W^2        exp(w + d) ~ exp(J_l d) exp(w)   (2)
///   right Jacobian  J_r(w) = J_l(-w) = J_l(w)^T         exp(w + d) ~ exp(w) exp(J_r d)   (3)
/// (J. Sola, J. Deray, D. Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, section
/// IV and appendix B; inverse of J_l by (1) of stumpff.hpp.)
#pragma once

#include <cmath>
#include <limits>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/manifold/detail/stumpff.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

// Eigen's own cross() lives in a header that nothing else here needs.
template <class S>
[[nodiscard]] Vector<3, S> cross(const Vector<3, S>& a, const Vector<3, S>& b) {
  return {a(1) * b(2) - a(2) * b(1), a(2) * b(0) - a(0) * b(2), a(0) * b(1) - a(1) * b(0)};
}

}  // namespace detail

/// A rotation. S is float, double, or a scalar with arithmetic, order, sqrt, sin, cos, atan2 (dual numbers).
template <class S = double>
class BasicSO3 {
public:
  using Scalar = S;
  using Tangent = Vector<3, S>;

  /// The identity.
  BasicSO3() : w_(1), v_(Vector<3, S>::Zero()) {}

  /// From a quaternion of any length above zero, however small or large. Throws Error where it is zero or not
  /// finite.
  [[nodiscard]] static BasicSO3 from_quaternion(const S& w, const S& x, const S& y, const S& z) {
    using std::sqrt;
    constexpr auto least = std::numeric_limits<S>::min() / std::numeric_limits<S>::epsilon();
    const S squared = w * w + x * x + y * y + z * z;
    if (squared > S(least) && squared <= S(std::numeric_limits<S>::max())) [[likely]] {
      const S length = sqrt(squared);
      return BasicSO3(w / length, Vector<3, S>(x / length, y / length, z / length));
    }
    const S numbers[] = {w, x, y, z};
    S largest(0);  // the squares are beyond what S holds, the quaternion may not be
    bool finite = true;
    for (const S& number : numbers) {
      const S size = number < S(0) ? S(-number) : number;
      finite = finite && size - size == S(0);
      if (size > largest) largest = size;
    }
    if (!finite || !(largest > S(0)))
      raise("SO3::from_quaternion: expected four finite numbers that are not all zero");
    return from_quaternion(w / largest, x / largest, y / largest, z / largest);
  }

  /// The rotation nearest to `m`. Throws Error where m^T m differs from I by more than `tolerance` in an
  /// entry, or m is a reflection: files carry 6 or 7 digits, a matrix in another convention is far away.
  [[nodiscard]] static BasicSO3 from_matrix(const Matrix<3, 3, S>& m, const S& tolerance = S(1e-3)) {
    const Matrix<3, 3, S> gram = transposed_product(m, m);
    for (int i = 0; i < 9; ++i) {
      const S error = gram(i / 3, i % 3) - S(i % 4 == 0 ? 1 : 0);
      if (!(error <= tolerance && error >= -tolerance))
        raise("SO3::from_matrix: expected a rotation matrix; its columns are not orthonormal");
    }
    Matrix<3, 3, S> r = m;
    for (int step = 0; step < 3; ++step) {  // Newton's iteration for the polar factor: (r + r^-T) / 2
      const Matrix<3, 3, S> cofactors = cofactor_matrix(r);
      const S determinant = r(0, 0) * cofactors(0, 0) + r(0, 1) * cofactors(0, 1) + r(0, 2) * cofactors(0, 2);
      if (!(determinant > S(0)))
        raise("SO3::from_matrix: expected a rotation matrix, found a reflection (determinant -1)");
      for (int i = 0; i < 9; ++i)
        r(i / 3, i % 3) = S(0.5) * (r(i / 3, i % 3) + cofactors(i / 3, i % 3) / determinant);
    }
    return from_orthonormal(r);
  }

  /// Rotation by |omega| about omega. (1)
  [[nodiscard]] static BasicSO3 exp(const Tangent& omega) {
    const detail::Stumpff<S> half = detail::stumpff<S>(omega.squaredNorm() / S(4));
    return BasicSO3(half.c[0], omega * (half.c[1] / S(2))).renormalised();
  }

  /// The rotation vector, of length at most pi. At exactly pi either of the two answers.
  [[nodiscard]] Tangent log() const {
    using std::atan2;
    using std::sqrt;
    const S sine_squared = v_.squaredNorm();
    const S sign = w_ < S(0) ? S(-1) : S(1);
    const S cosine = sign * w_;
    if (sine_squared < S(1e-4)) {  // 2 atan(t)/t, t = sine/cosine; the next term is below 1e-17
      const S t = sine_squared / (cosine * cosine);
      const S series = S(1) - t * (S(1) / S(3) - t * (S(1) / S(5) - t * (S(1) / S(7) - t / S(9))));
      return v_ * (sign * S(2) * series / cosine);
    }
    const S sine = sqrt(sine_squared);
    return v_ * (sign * S(2) * atan2(sine, cosine) / sine);
  }

  /// Angle of the rotation, 0..pi [rad].
  [[nodiscard]] S angle() const {
    using std::sqrt;
    const Tangent omega = log();
    return sqrt(omega.squaredNorm());
  }

  [[nodiscard]] const S& w() const noexcept { return w_; }
  [[nodiscard]] const S& x() const noexcept { return v_(0); }
  [[nodiscard]] const S& y() const noexcept { return v_(1); }
  [[nodiscard]] const S& z() const noexcept { return v_(2); }

  [[nodiscard]] Matrix<3, 3, S> matrix() const {
    const S x = v_(0), y = v_(1), z = v_(2);
    const S one(1), two(2);
    Matrix<3, 3, S> r;
    r << one - two * (y * y + z * z), two * (x * y - w_ * z), two * (x * z + w_ * y),  //
        two * (x * y + w_ * z), one - two * (x * x + z * z), two * (y * z - w_ * x),   //
        two * (x * z - w_ * y), two * (y * z + w_ * x), one - two * (x * x + y * y);
    return r;
  }

  [[nodiscard]] BasicSO3 inverse() const { return BasicSO3(w_, -v_); }

  /// First `b`, then this.
  [[nodiscard]] BasicSO3 operator*(const BasicSO3& b) const {
    return BasicSO3(w_ * b.w_ - v_.dot(b.v_), w_ * b.v_ + b.w_ * v_ + detail::cross<S>(v_, b.v_))
        .renormalised();
  }

  [[nodiscard]] Vector<3, S> rotate(const Vector<3, S>& p) const {
    const Vector<3, S> t = S(2) * detail::cross<S>(v_, p);
    return p + w_ * t + detail::cross<S>(v_, t);
  }
  [[nodiscard]] Vector<3, S> operator*(const Vector<3, S>& p) const { return rotate(p); }

  /// Adjoint: R exp(w) = exp(Ad w) R. Equal to matrix().
  [[nodiscard]] Matrix<3, 3, S> adjoint() const { return matrix(); }

  [[nodiscard]] static Matrix<3, 3, S> left_jacobian(const Tangent& omega) {  // (2)
    const detail::Stumpff<S> f = detail::stumpff<S>(omega.squaredNorm());
    return polynomial(f.c[2], f.c[3], omega);
  }
  [[nodiscard]] static Matrix<3, 3, S> right_jacobian(const Tangent& omega) {  // (3)
    return left_jacobian(-omega);
  }

  /// Inverse of left_jacobian; finite for |omega| < 2 pi.
  [[nodiscard]] static Matrix<3, 3, S> left_jacobian_inverse(const Tangent& omega) {
    const detail::Stumpff<S> f = detail::stumpff<S>(omega.squaredNorm());
    const S quadratic = (f.c[3] - S(2) * f.c[4]) / (S(2) * f.c[2]);  // = (1 - c_1 / (2 c_2)) / a^2
    return polynomial(S(-0.5), quadratic, omega);
  }
  [[nodiscard]] static Matrix<3, 3, S> right_jacobian_inverse(const Tangent& omega) {
    return left_jacobian_inverse(-omega);
  }

  template <class T>
  [[nodiscard]] BasicSO3<T> cast() const {
    return BasicSO3<T>::from_quaternion(static_cast<T>(w_), static_cast<T>(v_(0)), static_cast<T>(v_(1)),
                                        static_cast<T>(v_(2)));
  }

private:
  BasicSO3(const S& w, const Vector<3, S>& v) : w_(w), v_(v) {}

  // One Newton step towards length 1: products of millions of rotations stay unit without a square root.
  [[nodiscard]] BasicSO3 renormalised() const {
    const S factor = S(1.5) - S(0.5) * (w_ * w_ + v_.squaredNorm());
    return BasicSO3(w_ * factor, v_ * factor);
  }

  // I + linear W + quadratic W^2, W = skew(w): W^2 = w w^T - |w|^2 I.
  [[nodiscard]] static Matrix<3, 3, S> polynomial(const S& linear, const S& quadratic, const Tangent& w) {
    Matrix<3, 3, S> result = skew(w);
    const S diagonal = S(1) - quadratic * w.squaredNorm();
    for (int j = 0; j < 3; ++j) {
      const S factor = quadratic * w(j);
      for (int i = 0; i < 3; ++i) result(i, j) = linear * result(i, j) + w(i) * factor;
      result(j, j) += diagonal;
    }
    return result;
  }

  [[nodiscard]] static Matrix<3, 3, S> cofactor_matrix(const Matrix<3, 3, S>& m) {
    Matrix<3, 3, S> result;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        result(i, j) = m(i1, j1) * m(i2, j2) - m(i1, j2) * m(i2, j1);
      }
    return result;
  }

  // Divides by the largest of the four components (S. Shepperd, "Quaternion from rotation matrix", 1978).
  [[nodiscard]] static BasicSO3 from_orthonormal(const Matrix<3, 3, S>& r) {
    const S trace = r(0, 0) + r(1, 1) + r(2, 2);
    int i = 0;
    if (r(1, 1) > r(0, 0)) i = 1;
    if (r(2, 2) > r(i, i)) i = 2;
    if (trace > r(i, i))
      return from_quaternion(S(1) + trace, r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    Vector<3, S> v;
    v(i) = S(1) + r(i, i) - r(j, j) - r(k, k);
    v(j) = r(j, i) + r(i, j);
    v(k) = r(k, i) + r(i, k);
    return from_quaternion(r(k, j) - r(j, k), v(0), v(1), v(2));
  }

  S w_;
  Vector<3, S> v_;
};

using SO3 = BasicSO3<double>;
using SO3f = BasicSO3<float>;

template <class S>
struct manifold_traits<BasicSO3<S>> {
  using Scalar = S;
  using Tangent = Vector<3, S>;
  static constexpr int dof = 3;
  static BasicSO3<S> retract(const BasicSO3<S>& x, const Tangent& d) { return x * BasicSO3<S>::exp(d); }
  static Tangent local(const BasicSO3<S>& x, const BasicSO3<S>& y) { return (x.inverse() * y).log(); }
};

}}  // namespace cairn::CAIRN_ABI
