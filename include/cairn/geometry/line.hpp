// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Lines of space as a manifold of four dimensions, and what a camera sees of them.
///
/// A line is a point p and a frame R whose third axis is its direction d. A step turns it about p and shifts
/// it across itself, two numbers each:
///   retract(x, (w1, w2, a, b)):   R' = R exp((w1, w2, 0)),   p' = p + R' (a, b, 0)                       (1)
/// Where p lies along the line and how R is turned about it are no part of the line: local(x, y) turns x's
/// frame onto y's direction by the shortest way and is the same for every p and R of y. It is what K. Roberts
/// ("A new representation for a line", CVPR 1988) counts from the origin, counted from a point of the line
/// itself, so that it has no line at which it fails (the orthonormal representation of A. Bartoli, P. Sturm,
/// "Structure-from-motion using lines", CVIU 100, 2005, fails at lines through the origin and ends at those
/// far away), and a covariance is about the place where p is: choose it where the line was seen.
///
/// Pluecker coordinates from a centre c: direction d and moment n = (p - c) x d, the normal of the plane
/// through c and the line. A camera without distortion sees the line (Bartoli, Sturm, eq. 4)
///   l = K_l n,   K_l = det(K) K^-T = [fy 0 0; 0 fx 0; -fy cx, -fx cy, fx fy],   n in the camera's frame (2)
/// and a pixel (u, v) at the distance e = l . (u, v, 1) / |(l1, l2)| from it.                             (3)
#pragma once

#include <cmath>
#include <numbers>
#include <optional>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/manifold/so3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A directed line. S is float, double, or a scalar as in so3.hpp.
template <class S = double>
class BasicLine {
public:
  using Scalar = S;
  using Tangent = Vector<4, S>;  ///< turn about the two axes across [rad], shift along them

  /// The z axis.
  BasicLine() : point_(Vector<3, S>::Zero()) {}
  /// Through this point along the frame's third axis.
  BasicLine(const BasicSO3<S>& frame, const Vector<3, S>& point) : frame_(frame), point_(point) {}

  /// From one point towards another. Throws Error where they are equal or not finite.
  [[nodiscard]] static BasicLine through(const Vector<3, S>& from, const Vector<3, S>& to) {
    return along(from, Vector<3, S>(to - from));
  }
  /// Through a point in a direction of any length. Throws Error where that is zero, or a number not finite.
  [[nodiscard]] static BasicLine along(const Vector<3, S>& point, const Vector<3, S>& direction) {
    using std::sqrt;
    const S length = sqrt(direction.squaredNorm());
    if (!(length > S(0)) || !(length - length == S(0)) || !all_finite(point))
      raise("Line: expected finite points that differ");
    return BasicLine(turned_onto(Vector<3, S>(direction / length)), point);
  }
  /// From Pluecker coordinates, moment = point x direction about the origin. A moment that is not across the
  /// direction loses what lies along it. Throws Error as along().
  [[nodiscard]] static BasicLine from_pluecker(const Vector<3, S>& moment, const Vector<3, S>& direction) {
    const S squared = direction.squaredNorm();
    return along(Vector<3, S>(detail::cross<S>(direction, moment) / squared), direction);
  }

  [[nodiscard]] const Vector<3, S>& point() const noexcept { return point_; }
  [[nodiscard]] const BasicSO3<S>& frame() const noexcept { return frame_; }
  /// Of length 1.
  [[nodiscard]] Vector<3, S> direction() const { return frame_.rotate(Vector<3, S>(S(0), S(0), S(1))); }
  /// Pluecker's moment about a centre.
  [[nodiscard]] Vector<3, S> moment(const Vector<3, S>& centre = Vector<3, S>::Zero()) const {
    return detail::cross<S>(Vector<3, S>(point_ - centre), direction());
  }

  /// How far along the direction the foot of a point is from point().
  [[nodiscard]] S coordinate(const Vector<3, S>& of) const { return direction().dot(of - point_); }
  [[nodiscard]] Vector<3, S> at(const S& coordinate) const {
    return Vector<3, S>(point_ + coordinate * direction());
  }
  [[nodiscard]] S distance(const Vector<3, S>& to) const {
    using std::sqrt;
    return sqrt(detail::cross<S>(Vector<3, S>(to - point_), direction()).squaredNorm());
  }
  /// The same line, held at another of its points.
  [[nodiscard]] BasicLine held_at(const S& coordinate) const { return BasicLine(frame_, at(coordinate)); }

  template <class T>
  [[nodiscard]] BasicLine<T> cast() const {
    return BasicLine<T>(frame_.template cast<T>(), Vector<3, T>(point_.template cast<T>()));
  }

  /// The shortest turn, as (w1, w2), of the third axis onto a unit vector. For the vector opposite to it one
  /// of many.
  [[nodiscard]] static Vector<2, S> turn_onto(const Vector<3, S>& unit) {
    using std::atan2;
    using std::sqrt;
    const S rise = S(1) - unit(2);
    S share(1);  // angle / sine
    if (rise < S(1e-2)) {
      S term(1);  // of the series of angle / sine in 1 - cosine: c_k = c_(k-1) k / (2k + 1)
      for (int k = 1; k < 9; ++k) {
        term *= rise * S(k) / S(2 * k + 1);
        share += term;
      }
    } else {
      const S sine = sqrt(unit(0) * unit(0) + unit(1) * unit(1));
      if (!(sine > S(0))) return {S(std::numbers::pi), S(0)};
      share = atan2(sine, unit(2)) / sine;
    }
    return {-share * unit(1), share * unit(0)};
  }

private:
  [[nodiscard]] static BasicSO3<S> turned_onto(const Vector<3, S>& unit) {
    const Vector<2, S> w = turn_onto(unit);
    return BasicSO3<S>::exp(Vector<3, S>(w(0), w(1), S(0)));
  }

  BasicSO3<S> frame_;
  Vector<3, S> point_;
};

using Line = BasicLine<double>;

/// The line moved with everything.
template <class S>
[[nodiscard]] BasicLine<S> operator*(const BasicSE3<S>& T, const BasicLine<S>& line) {
  return BasicLine<S>(T.rotation() * line.frame(), T * line.point());
}

template <class S>
struct manifold_traits<BasicLine<S>> {
  using Scalar = S;
  using Tangent = Vector<4, S>;
  static constexpr int dof = 4;
  static BasicLine<S> retract(const BasicLine<S>& x, const Tangent& d) {  // (1)
    const BasicSO3<S> frame = x.frame() * BasicSO3<S>::exp(Vector<3, S>(d(0), d(1), S(0)));
    return BasicLine<S>(frame, Vector<3, S>(x.point() + frame.rotate(Vector<3, S>(d(2), d(3), S(0)))));
  }
  static Tangent local(const BasicLine<S>& x, const BasicLine<S>& y) {
    const Vector<2, S> w = BasicLine<S>::turn_onto(x.frame().inverse().rotate(y.direction()));
    const BasicSO3<S> frame = x.frame() * BasicSO3<S>::exp(Vector<3, S>(w(0), w(1), S(0)));
    const Vector<3, S> shift = frame.inverse().rotate(Vector<3, S>(y.point() - x.point()));
    return {w(0), w(1), shift(0), shift(1)};
  }
  static bool finite(const BasicLine<S>& x) { return all_finite(x.point()) && all_finite(x.direction()); }
};

/// K_l of (2): the image line of the plane with this normal, as a user may multiply it. Distortion is left
/// out: straighten pixels first, see straight_pixel().
[[nodiscard]] inline Matrix<3> line_projection(const PinholeCamera& camera) {
  Matrix<3> K;
  K << camera.fy(), 0, 0,  //
      0, camera.fx(), 0,   //
      -camera.fy() * camera.cx(), -camera.fx() * camera.cy(), camera.fx() * camera.fy();
  return K;
}

/// Where the pixel would be without the lens's distortion; nothing where it is the pixel of no ray.
[[nodiscard]] inline std::optional<Vector<2>> straight_pixel(const PinholeCamera& camera,
                                                             const Vector<2>& pixel) {
  const auto n = camera.normalise(pixel);
  if (!n) return std::nullopt;
  return Vector<2>(camera.fx() * (*n)(0) + camera.cx(), camera.fy() * (*n)(1) + camera.cy());
}

/// A pixel's signed distance from an image line, and how it changes with the line's three numbers.
struct LineDistance {
  double distance = 0;  ///< [pixels]; positive on the side to which (l1, l2) points
  Vector<3> J_line = Vector<3>::Zero();
};

/// (3). An image line at infinity (l1 = l2 = 0: the camera's axis is across the plane) has every pixel at the
/// distance 0 and is to be left out before.
[[nodiscard]] inline LineDistance distance_to(const Vector<3>& line, const Vector<2>& pixel) {
  const double squared = line(0) * line(0) + line(1) * line(1);
  if (!(squared > 0)) return {};
  const double inverse = 1 / std::sqrt(squared);
  const double e = (line(0) * pixel(0) + line(1) * pixel(1) + line(2)) * inverse;
  const double back = e * inverse * inverse;
  return {e, {pixel(0) * inverse - back * line(0), pixel(1) * inverse - back * line(1), inverse}};
}

}}  // namespace cairn::CAIRN_ABI
