// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Two cameras in any relative position: projection of a point into both, and the epipolar distance of a
/// pair.
///
/// With rays a = (x, y, 1) of the left and b of the right camera and T_left_right = (R, t), a true pair has
///   e = a . (t x R b) = 0                                                                (1)
/// (H. Longuet-Higgins, Nature 293, 1981). Divided by its gradient in the pixels, e becomes a distance in
/// pixels (P. Sampson, 1982).
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Where a point appears in both images: left u, v, right u, v.
struct StereoPixelsWithJacobian {
  Vector<4> pixels;
  Matrix<4, 3> J_point;  ///< d pixels / d point, left camera frame
};

/// A stereo rig; its frame is the left camera's. Needs no rectification.
struct StereoRig {
  PinholeCamera left, right;
  SE3 T_left_right;  ///< pose of the right camera in the left one; translation = baseline, about (b, 0, 0)

  /// Length of the baseline [m].
  [[nodiscard]] double baseline() const noexcept { return T_left_right.translation().norm(); }

  /// Pixels (left u, v, right u, v) of a point in the left camera frame; nothing where a camera cannot see
  /// it.
  [[nodiscard]] std::optional<Vector<4>> project(const Vector<3>& point) const noexcept {
    const auto l = left.project(point);
    const auto r = right.project(T_left_right.inverse() * point);
    if (!l || !r) return std::nullopt;
    return Vector<4>((*l)(0), (*l)(1), (*r)(0), (*r)(1));
  }

  /// project() with its derivative.
  [[nodiscard]] std::optional<StereoPixelsWithJacobian> project_with_jacobian(
      const Vector<3>& point) const noexcept {
    const SE3 T_right_left = T_left_right.inverse();
    const auto l = left.project_with_jacobian(point);
    const auto r = right.project_with_jacobian(T_right_left * point);
    if (!l || !r) return std::nullopt;
    StereoPixelsWithJacobian result;
    put(result.pixels, 0, 0, l->pixel);
    put(result.pixels, 2, 0, r->pixel);
    put(result.J_point, 0, 0, l->J_point);
    put(result.J_point, 2, 0, product(r->J_point, T_right_left.rotation().matrix()));
    return result;
  }

  /// Whether rows correspond: no distortion, equal focal lengths and cy, cameras parallel and side by side,
  /// so that a pair differs in its row by less than `tolerance` [pixels] anywhere in the image.
  [[nodiscard]] bool rectified(double tolerance = 0.1) const noexcept {
    if (left.distorted() || right.distorted()) return false;
    const double extent = std::max({1.0, 1.0 * left.width(), 1.0 * left.height()});
    const Vector<3> t = T_left_right.translation();
    const double b = baseline();
    return std::abs(left.fx() - right.fx()) * extent <= tolerance * left.fx() &&
           std::abs(left.fy() - right.fy()) * extent <= tolerance * left.fy() &&
           std::abs(left.cy() - right.cy()) <= tolerance &&
           T_left_right.rotation().angle() * (left.fy() + extent) <= tolerance && t(0) > 0 &&
           std::abs(t(1)) * left.fy() <= tolerance * b && std::abs(t(2)) * extent <= tolerance * b;
  }
};

/// The epipolar constraint of a rig, prepared for testing many pairs. Not for a rig without a baseline.
class EpipolarConstraint {
public:
  explicit EpipolarConstraint(const StereoRig& rig)
      : E_(product(skew(rig.T_left_right.translation()), rig.T_left_right.rotation().matrix())),
        inverse_focal_left_(1 / rig.left.fx(), 1 / rig.left.fy()),
        inverse_focal_right_(1 / rig.right.fx(), 1 / rig.right.fy()) {}

  /// (1) for normalised coordinates, in units of the baseline.
  [[nodiscard]] double algebraic(const Vector<2>& left, const Vector<2>& right) const noexcept {
    return ray(left).dot(product(E_, ray(right)));
  }

  /// Signed distance in pixels for normalised coordinates (PinholeCamera::normalise once per point, then this
  /// for every candidate pair): the vertical disparity of a rectified rig, generalised. Pixel noise of s in
  /// each coordinate of both images gives it a standard deviation of s sqrt 2. 0 at the epipoles.
  [[nodiscard]] double distance(const Vector<2>& left, const Vector<2>& right) const noexcept {
    const double squared = gradient_squared(left, right, 0.5, 0.5);
    return squared > 0 ? algebraic(left, right) / std::sqrt(squared) : 0.0;
  }

  /// The same divided by its standard deviation for pixel noise of these two sigmas.
  [[nodiscard]] double standardised(const Vector<2>& left, const Vector<2>& right, double sigma_left,
                                    double sigma_right) const noexcept {
    const double variance = gradient_squared(left, right, sigma_left * sigma_left, sigma_right * sigma_right);
    return variance > 0 ? algebraic(left, right) / std::sqrt(variance) : 0.0;
  }

  /// The essential matrix, a^T E b = 0.
  [[nodiscard]] const Matrix<3>& essential() const noexcept { return E_; }

private:
  [[nodiscard]] static Vector<3> ray(const Vector<2>& n) noexcept { return {n(0), n(1), 1}; }

  // Distortion is left out of the gradient: it changes the scale of a residual of pixels by percents.
  [[nodiscard]] double gradient_squared(const Vector<2>& left, const Vector<2>& right, double weight_left,
                                        double weight_right) const noexcept {
    const Vector<3> line_left = product(E_, ray(right)), line_right = transposed_product(E_, ray(left));
    return weight_left * slope_squared(line_left, inverse_focal_left_) +
           weight_right * slope_squared(line_right, inverse_focal_right_);
  }

  // How fast a line's equation changes with the pixel, squared.
  [[nodiscard]] static double slope_squared(const Vector<3>& line, const Vector<2>& inverse_focal) noexcept {
    const double x = line(0) * inverse_focal(0), y = line(1) * inverse_focal(1);
    return x * x + y * y;
  }

  Matrix<3> E_;
  Vector<2> inverse_focal_left_, inverse_focal_right_;
};

/// Epipolar distance of one pair of pixels, see EpipolarConstraint::distance; nothing where a pixel has no
/// ray.
[[nodiscard]] inline std::optional<double> epipolar_distance(const StereoRig& rig, const Vector<2>& left,
                                                             const Vector<2>& right) {
  const auto l = rig.left.normalise(left);
  const auto r = rig.right.normalise(right);
  if (!l || !r) return std::nullopt;
  return EpipolarConstraint(rig).distance(*l, *r);
}

}}  // namespace cairn::CAIRN_ABI
