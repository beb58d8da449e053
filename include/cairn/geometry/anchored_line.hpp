// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A line as the camera that first saw it knows it: two rays, sideways, and how far along each.
///
/// In the frame A of that camera, with the rays a_i = (x_i, y_i, 1) through the ends of the segment and w
/// across them in the picture, four numbers (u1, u2, q1, q2) stand for the line through
///   P_i = A (b_i / q_i),   b_i = a_i + u_i w,
/// whose Pluecker coordinates in A's frame are, but for a common factor,
///   moment b_1 x b_2,   direction q_1 b_2 - q_2 b_1.                                       (1)
/// Inverse distances are what cameras measure: a short segment far away may run towards the camera or from
/// it, which is Gaussian in q and not in angles; (1) is defined up to infinity, q = 0. (J. Montiel, J.
/// Civera, A. Davison, "Unified inverse depth parametrization for monocular SLAM", RSS 2006, of points; J.
/// Sola, T. Vidal-Calleja, J. Civera, J. Montiel, "Impact of landmark parametrization on monocular EKF-SLAM
/// with points and lines", IJCV 97, 2012, compare lines.)
#pragma once

#include <cmath>
#include <limits>
#include <optional>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/line.hpp>
#include <cairn/geometry/line_triangulation.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A line by (1). Its steps are differences of the four numbers.
class AnchoredLine {
public:
  /// One before the camera, at distance 1.
  AnchoredLine() = default;

  /// A line of the anchor's frame by the rays through the ends of a segment, in normalised coordinates of a
  /// camera whose axes are the anchor's. Nothing where it is not near those rays and in front of the anchor.
  [[nodiscard]] static std::optional<AnchoredLine> at(const SE3& anchor, const LineSegment& normalised,
                                                      const Line& line) {
    AnchoredLine result;
    const Vector<2> along = normalised.to - normalised.from;
    const double length = along.norm();
    if (!(length > 0)) return std::nullopt;
    result.anchor_ = anchor;
    result.w_ = {-along(1) / length, along(0) / length, 0};
    result.a_[0] = {normalised.from(0), normalised.from(1), 1};
    result.a_[1] = {normalised.to(0), normalised.to(1), 1};
    if (!result.meet(line)) return std::nullopt;
    return result;
  }
  /// Another line, of the world's frame, by the same rays; nothing as for at().
  [[nodiscard]] std::optional<AnchoredLine> about(const Line& line) const {
    AnchoredLine other = *this;
    if (!other.meet(anchor_.inverse() * line)) return std::nullopt;
    return other;
  }

  [[nodiscard]] const SE3& anchor() const noexcept { return anchor_; }
  /// u1, u2 [normalised], q1, q2 [1/m].
  [[nodiscard]] const Vector<4>& numbers() const noexcept { return numbers_; }
  [[nodiscard]] AnchoredLine with(const Vector<4>& numbers) const {
    AnchoredLine other = *this;
    other.numbers_ = numbers;
    return other;
  }

  /// (1), anchor's frame: moment, then direction.
  [[nodiscard]] Vector<6> pluecker() const {
    const Vector<3> b = ray(0), c = ray(1);
    Vector<6> result;
    put(result, 0, 0, detail::cross<double>(b, c));
    put(result, 3, 0, Vector<3>(numbers_(2) * c - numbers_(3) * b));
    return result;
  }
  /// d pluecker / d numbers.
  [[nodiscard]] Matrix<6, 4> pluecker_jacobian() const {
    const Vector<3> b = ray(0), c = ray(1);
    Matrix<6, 4> J = Matrix<6, 4>::Zero();
    put(J, 0, 0, detail::cross<double>(w_, c));
    put(J, 0, 1, detail::cross<double>(b, w_));
    put(J, 3, 0, Vector<3>(-numbers_(3) * w_));
    put(J, 3, 1, Vector<3>(numbers_(2) * w_));
    put(J, 3, 2, c);
    put(J, 3, 3, Vector<3>(-b));
    return J;
  }

  /// The point at a share of the way between both rays in the picture, world frame; nothing where it is not
  /// in front of the anchor. A share may be below 0 or above 1.
  [[nodiscard]] std::optional<Vector<3>> point(double share) const {
    const double q = (1 - share) * numbers_(2) + share * numbers_(3);
    if (!(q > 1e-6)) return std::nullopt;
    return anchor_ * Vector<3>(((1 - share) * ray(0) + share * ray(1)) / q);
  }
  /// The share at which the anchor sees a point near the line; nothing where that is behind it.
  [[nodiscard]] std::optional<double> share(const Vector<3>& of) const {
    const Vector<3> p = anchor_.inverse() * of;
    if (!(p(2) > 0)) return std::nullopt;
    const Vector<3> between = a_[1] - a_[0];
    return between.dot(Vector<3>(p / p(2)) - a_[0]) / between.squaredNorm();
  }
  /// In the world's frame.
  [[nodiscard]] Line line() const {
    const Vector<6> L = pluecker();
    return anchor_ * Line::from_pluecker(part_of<3, 1>(L, 0, 0), part_of<3, 1>(L, 3, 0));
  }
  /// Standard deviation across the line of its point on one of the rays (0 or 1), for a covariance of the
  /// numbers [m]; infinite at infinity.
  [[nodiscard]] double sigma_across(int end, const Matrix<4>& covariance) const {
    const double q = numbers_(2 + end);
    if (q == 0) return std::numeric_limits<double>::infinity();
    const Vector<3> by_u = w_ / q, by_q = -ray(end) / (q * q);
    const Vector<3> direction = part_of<3, 1>(pluecker(), 3, 0).normalized();
    const Vector<3> u = by_u - direction.dot(by_u) * direction, v = by_q - direction.dot(by_q) * direction;
    const double variance = u.squaredNorm() * covariance(end, end) + 2 * u.dot(v) * covariance(end, 2 + end) +
                            v.squaredNorm() * covariance(2 + end, 2 + end);
    return std::sqrt(variance);
  }

private:
  friend struct manifold_traits<AnchoredLine>;

  /// Takes the numbers of this line: a ray meets its plane where n . b = 0, and there n = (b / q) x d.
  bool meet(const Line& line) {
    const Vector<3> n = line.moment(), d = line.direction();
    for (int i = 0; i < 2; ++i) {
      const double u = -n.dot(a_[i]) / n.dot(w_);
      const double q = detail::cross<double>(a_[i] + u * w_, d).dot(n) / n.squaredNorm();
      if (!(std::abs(u) < 1) || !(q > 0)) return false;
      numbers_(i) = u;
      numbers_(2 + i) = q;
    }
    return true;
  }
  [[nodiscard]] Vector<3> ray(int i) const { return a_[i] + numbers_(i) * w_; }

  SE3 anchor_;
  Vector<3> a_[2] = {{-0.5, 0, 1}, {0.5, 0, 1}};
  Vector<3> w_{0, 1, 0};
  Vector<4> numbers_{0, 0, 1, 1};
};

/// Steps between lines of one anchor; another line is to be put there first.
template <>
struct manifold_traits<AnchoredLine> {
  using Scalar = double;
  using Tangent = Vector<4>;
  static constexpr int dof = 4;
  static AnchoredLine retract(const AnchoredLine& x, const Tangent& d) { return x.with(x.numbers_ + d); }
  static Tangent local(const AnchoredLine& x, const AnchoredLine& y) { return y.numbers_ - x.numbers_; }
  static bool finite(const AnchoredLine& x) { return all_finite(x.numbers_); }
};

}}  // namespace cairn::CAIRN_ABI
