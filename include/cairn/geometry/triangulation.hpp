// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A point from its two pixels in a stereo rig, with its covariance.
///
/// Rays C1 + a d1 and C2 + b d2 with unit directions, w = C1 - C2, k = d1.d2, D = 1 - k^2 = |d1 x d2|^2:
///   a = (k d2.w - d1.w) / D,   b = (d2.w - k d1.w) / D                                   (1)
/// are the feet of the common perpendicular. The point is
///   midpoint            the middle of the feet;
///   weighted_midpoint   (b foot1 + a foot2) / (a + b): the nearer camera sees its foot better (S. Lee,
///                       J. Civera, "Triangulation: why optimize?", BMVC 2019);
///   gauss_newton        one Gauss-Newton step from there on the four pixel residuals: maximum likelihood to
///                       first order.
/// Covariance: of the first two, J diag(sigma^2) J^T through (1); of the last, (A^T A)^-1 of the whitened
/// projection Jacobian A.
#pragma once

#include <cmath>
#include <limits>
#include <optional>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/so3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

enum class TriangulationMethod { midpoint, weighted_midpoint, gauss_newton };

enum class TriangulationStatus {
  good,
  no_ray,        ///< a pixel is not finite or outside the domain of its camera
  parallel,      ///< the rays meet under less than min_parallax: direction known, depth not
  behind,        ///< the rays meet behind a camera, or outside [min_depth, max_depth]
  gap_too_large  ///< the rays pass each other by more than max_gap sigmas: not the same point
};

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(TriangulationStatus status) noexcept {
  switch (status) {
    case TriangulationStatus::good:
      return "good";
    case TriangulationStatus::no_ray:
      return "no point: a pixel is not finite or outside the domain of its camera";
    case TriangulationStatus::parallel:
      return "no point: the rays are too nearly parallel to tell the depth";
    case TriangulationStatus::behind:
      return "no point: the rays meet behind a camera or outside the range of depths";
    case TriangulationStatus::gap_too_large:
      return "no point: the rays pass each other by more than the noise allows";
  }
  return "unknown status";
}

struct TriangulationOptions {
  TriangulationMethod method = TriangulationMethod::gauss_newton;
  double sigma_left = 0.5, sigma_right = 0.5;  ///< pixel noise in each coordinate [pixels]
  double min_parallax = 0.002;                 ///< smallest angle between the rays [rad]
  double max_gap = 3;                          ///< epipolar residual, in standard deviations of it
  double min_depth = 0;                        ///< along the left camera's axis [m]
  double max_depth = std::numeric_limits<double>::infinity();
};

/// Result. Where status is not good, point and covariance are finite numbers without meaning.
struct Triangulation {
  Vector<3> point = Vector<3>::Zero();           ///< left camera frame [m]
  Matrix<3> covariance = Matrix<3>::Identity();  ///< [m^2]
  double gap = 0;                                ///< epipolar residual in standard deviations, signed
  TriangulationStatus status = TriangulationStatus::good;
  [[nodiscard]] bool good() const noexcept { return status == TriangulationStatus::good; }
};

namespace detail {

/// A ray of one camera, left frame, with the derivative of its unit direction by the pixel.
struct PixelRay {
  Vector<3> direction;
  Matrix<3, 2> J_pixel;
};

[[nodiscard]] inline PixelRay pixel_ray(const NormalisedWithJacobian& n) {
  const Matrix<2>& P = n.J_pixel;
  const double determinant = P(0, 0) * P(1, 1) - P(0, 1) * P(1, 0);
  Matrix<2> J_normalised;
  J_normalised << P(1, 1), -P(0, 1), -P(1, 0), P(0, 0);
  J_normalised /= determinant;
  const Vector<3> m(n.normalised(0), n.normalised(1), 1);
  const double length = m.norm();
  PixelRay ray;
  ray.direction = m / length;
  Matrix<3, 2> across;  // (I - d d^T) / length, but for its last column: that of the constant 1 in m
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 2; ++j) across(i, j) = ((i == j) - ray.direction(i) * ray.direction(j)) / length;
  ray.J_pixel = product(across, J_normalised);
  return ray;
}

/// How far a view of a point is from where it is predicted, and the derivative of the prediction by the
/// point.
struct WhitenedResidual {
  Vector<2> residual;
  Matrix<2, 3> J_point;
};

/// Of normalised coordinates, both times `whitening` (d pixel / d normalised over sigma); the point in the
/// camera's frame and in front of it.
[[nodiscard]] inline WhitenedResidual whitened_residual(const Vector<2>& observed, const Matrix<2>& whitening,
                                                        const Vector<3>& p) {
  const double x = p(0) / p(2), y = p(1) / p(2);
  Matrix<2, 3> J;
  J << 1 / p(2), 0, -x / p(2), 0, 1 / p(2), -y / p(2);
  return {product(whitening, Vector<2>(observed(0) - x, observed(1) - y)), product(whitening, J)};
}

/// Feet of the common perpendicular of two rays, (1), and their derivatives by both unit directions.
struct Feet {
  double a, b;                   // distances of the feet from the cameras
  Vector<3> a_1, a_2, b_1, b_2;  // d a / d d1 ...
};

[[nodiscard]] inline Feet feet(const Vector<3>& d1, const Vector<3>& d2, const Vector<3>& w) {
  const double k = d1.dot(d2), e1 = d1.dot(w), e2 = d2.dot(w), D = cross<double>(d1, d2).squaredNorm();
  Feet f;
  f.a = (k * e2 - e1) / D;
  f.b = (e2 - k * e1) / D;
  const double a_k = (e2 + 2 * k * f.a) / D, b_k = (2 * k * f.b - e1) / D;
  f.a_1 = a_k * d2 - (1 / D) * w;
  f.a_2 = a_k * d1 + (k / D) * w;
  f.b_1 = b_k * d2 - (k / D) * w;
  f.b_2 = b_k * d1 + (1 / D) * w;
  return f;
}

}  // namespace detail

/// Triangulates pairs of one rig: what depends on the rig alone is computed once.
class Triangulator {
public:
  explicit Triangulator(const StereoRig& rig, const TriangulationOptions& options = {})
      : left_(rig.left),
        right_(rig.right),
        options_(options),
        epipolar_(rig),
        R_left_right_(rig.T_left_right.rotation().matrix()),
        baseline_(rig.T_left_right.translation()) {}

  /// The point of a left and a right pixel, any numbers; see TriangulationStatus.
  [[nodiscard]] Triangulation operator()(const Vector<2>& left, const Vector<2>& right) const {
    return (*this)(left, right, options_.sigma_left, options_.sigma_right);
  }

  /// The same with the pair's own pixel noise.
  [[nodiscard]] Triangulation operator()(const Vector<2>& left, const Vector<2>& right, double sigma_left,
                                         double sigma_right) const {
    CAIRN_EXPECTS(sigma_left > 0 && sigma_right > 0, "Triangulator: pixel noise must be positive");
    Triangulation result;
    const auto refuse = [&](TriangulationStatus status) {
      result.status = status;
      return result;
    };
    const auto l = left_.normalise_with_jacobian(left), r = right_.normalise_with_jacobian(right);
    if (!l || !r) return refuse(TriangulationStatus::no_ray);
    const detail::PixelRay ray1 = detail::pixel_ray(*l);
    detail::PixelRay ray2 = detail::pixel_ray(*r);
    ray2.direction = product(R_left_right_, ray2.direction);
    ray2.J_pixel = product(R_left_right_, ray2.J_pixel);

    const double sine = detail::cross<double>(ray1.direction, ray2.direction).norm();
    if (!(sine > std::sin(options_.min_parallax))) return refuse(TriangulationStatus::parallel);
    result.gap = epipolar_.standardised(l->normalised, r->normalised, sigma_left, sigma_right);
    const detail::Feet f = detail::feet(ray1.direction, ray2.direction, -baseline_);
    if (!(f.a > 0 && f.b > 0)) return refuse(TriangulationStatus::behind);
    if (!(std::abs(result.gap) <= options_.max_gap)) return refuse(TriangulationStatus::gap_too_large);

    midpoint(result, f, ray1, ray2, sigma_left, sigma_right);
    if (options_.method == TriangulationMethod::gauss_newton)
      if (!gauss_newton_step(result, *l, *r, sigma_left, sigma_right))
        return refuse(TriangulationStatus::behind);
    const double depth = result.point(2);
    if (!(depth > options_.min_depth && depth <= options_.max_depth))
      return refuse(TriangulationStatus::behind);
    return result;
  }

private:
  // Both midpoints: X = (1 - s) foot1 + s foot2, s = 1/2 or a / (a + b).
  void midpoint(Triangulation& result, const detail::Feet& f, const detail::PixelRay& ray1,
                const detail::PixelRay& ray2, double sigma_left, double sigma_right) const {
    const bool weighted = options_.method != TriangulationMethod::midpoint;
    const double sum = f.a + f.b, s = weighted ? f.a / sum : 0.5;
    const Vector<3>&d1 = ray1.direction, &d2 = ray2.direction;
    const Vector<3> foot1 = f.a * d1, foot2 = baseline_ + f.b * d2, gap = foot2 - foot1;
    result.point = (1 - s) * foot1 + s * foot2;
    if (options_.method == TriangulationMethod::gauss_newton) return;  // which has its own covariance
    const double by_s = weighted ? 1 / (sum * sum) : 0;                // d s = (b d a - a d b) / (a + b)^2
    Matrix<3, 2> L, R;                                                 // d point / d left and right pixel
    for (int c = 0; c < 2; ++c) {
      double a_l = 0, b_l = 0, a_r = 0, b_r = 0;  // how the feet move with the pixels
      for (int i = 0; i < 3; ++i) {
        a_l += f.a_1(i) * ray1.J_pixel(i, c);
        b_l += f.b_1(i) * ray1.J_pixel(i, c);
        a_r += f.a_2(i) * ray2.J_pixel(i, c);
        b_r += f.b_2(i) * ray2.J_pixel(i, c);
      }
      const double s_l = by_s * (f.b * a_l - f.a * b_l), s_r = by_s * (f.b * a_r - f.a * b_r);
      for (int i = 0; i < 3; ++i) {
        L(i, c) = (1 - s) * (d1(i) * a_l + f.a * ray1.J_pixel(i, c)) + s * d2(i) * b_l + gap(i) * s_l;
        R(i, c) = (1 - s) * d1(i) * a_r + s * (d2(i) * b_r + f.b * ray2.J_pixel(i, c)) + gap(i) * s_r;
      }
    }
    const double variance_left = sigma_left * sigma_left, variance_right = sigma_right * sigma_right;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j)
        result.covariance(i, j) = result.covariance(j, i) =
            variance_left * (L(i, 0) * L(j, 0) + L(i, 1) * L(j, 1)) +
            variance_right * (R(i, 0) * R(j, 0) + R(i, 1) * R(j, 1));
  }

  // One step on the whitened residuals, in normalised coordinates scaled by the pixels' derivative at the
  // observation: the same to first order as reprojecting through the distortion, and cheaper.
  [[nodiscard]] bool gauss_newton_step(Triangulation& result, const NormalisedWithJacobian& l,
                                       const NormalisedWithJacobian& r, double sigma_left,
                                       double sigma_right) const {
    const Vector<3> p = result.point, offset = p - baseline_, q = transposed_product(R_left_right_, offset);
    if (!(p(2) > 0 && q(2) > 0)) return false;
    const auto left = detail::whitened_residual(l.normalised, l.J_pixel / sigma_left, p);
    auto right = detail::whitened_residual(r.normalised, r.J_pixel / sigma_right, q);
    right.J_point = product_transposed(right.J_point, R_left_right_);
    Matrix<3> information = transposed_product(left.J_point, left.J_point);
    add_transposed_product(information, right.J_point, right.J_point);
    const Cholesky<3> factor(information);
    if (!factor.good()) return false;
    Vector<3> gradient = transposed_product(left.J_point, left.residual);
    add_transposed_product(gradient, right.J_point, right.residual);
    result.point += factor.solve(gradient);
    result.covariance = factor.inverse();
    return true;
  }

  PinholeCamera left_, right_;
  TriangulationOptions options_;
  EpipolarConstraint epipolar_;
  Matrix<3> R_left_right_;
  Vector<3> baseline_;
};

/// The point of one pair; for many pairs keep a Triangulator.
[[nodiscard]] inline Triangulation triangulate(const StereoRig& rig, const Vector<2>& left,
                                               const Vector<2>& right,
                                               const TriangulationOptions& options = {}) {
  return Triangulator(rig, options)(left, right);
}

}}  // namespace cairn::CAIRN_ABI
