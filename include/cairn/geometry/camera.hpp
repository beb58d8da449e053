// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A pinhole camera with radial and tangential distortion.
///
/// Camera frame: x right, y down, z along the view. With x = X/Z, y = Y/Z, r^2 = x^2 + y^2:
///   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
///   y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y                  (1)
///   u = fx x' + cx,   v = fy y' + cy,   centre of the first pixel at (0, 0)
/// (D. Brown, "Close-range camera calibration", Photogrammetric Engineering 37, 1971; the order of the five
/// numbers is the one calibration files use.) (x, y) are called normalised coordinates: pixels of an ideal
/// camera with focal length 1.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// What a calibration says about one camera. Focal lengths and principal point in pixels.
struct PinholeParameters {
  double fx = 1, fy = 1, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
  int width = 0, height = 0;  ///< image size [pixels]; 0 where unknown
};

/// A pixel and how it moves with the point that projects there.
struct PixelWithJacobian {
  Vector<2> pixel;
  Matrix<2, 3> J_point;  ///< d pixel / d point, camera frame
};

/// Normalised coordinates and how the pixel moves with them.
struct NormalisedWithJacobian {
  Vector<2> normalised;
  Matrix<2> J_pixel;  ///< d pixel / d normalised; its inverse carries pixel noise to normalised noise
};

/// A camera. Immutable; all functions are safe to call concurrently.
class PinholeCamera {
public:
  /// Focal length 1, no distortion: pixels are normalised coordinates.
  PinholeCamera() = default;

  /// Throws Error where a number is not finite, a focal length not positive or a size negative.
  explicit PinholeCamera(const PinholeParameters& parameters) : p_(parameters) {
    for (const double value : {p_.fx, p_.fy, p_.cx, p_.cy, p_.k1, p_.k2, p_.p1, p_.p2, p_.k3})
      if (!std::isfinite(value)) raise("PinholeCamera: expected finite parameters");
    if (!(p_.fx > 0 && p_.fy > 0)) raise("PinholeCamera: expected positive focal lengths fx and fy");
    if (p_.width < 0 || p_.height < 0) raise("PinholeCamera: expected an image size that is not negative");
    distorted_ = p_.k1 != 0 || p_.k2 != 0 || p_.p1 != 0 || p_.p2 != 0 || p_.k3 != 0;
    if (distorted_) largest_radius_squared_ = fold_radius_squared();
  }

  [[nodiscard]] const PinholeParameters& parameters() const noexcept { return p_; }
  [[nodiscard]] double fx() const noexcept { return p_.fx; }
  [[nodiscard]] double fy() const noexcept { return p_.fy; }
  [[nodiscard]] double cx() const noexcept { return p_.cx; }
  [[nodiscard]] double cy() const noexcept { return p_.cy; }
  [[nodiscard]] int width() const noexcept { return p_.width; }
  [[nodiscard]] int height() const noexcept { return p_.height; }
  [[nodiscard]] bool distorted() const noexcept { return distorted_; }

  /// Whether a pixel lies on the image, at least `margin` from its rim; true where the size is unknown.
  [[nodiscard]] bool contains(const Vector<2>& pixel, double margin = 0) const noexcept {
    if (p_.width == 0 || p_.height == 0) return true;
    return pixel(0) >= margin - 0.5 && pixel(1) >= margin - 0.5 && pixel(0) <= p_.width - 0.5 - margin &&
           pixel(1) <= p_.height - 0.5 - margin;
  }

  /// Pixel of a point in the camera frame. Nothing where the point is not in front of the camera, or so far
  /// outside the view that the distortion polynomial folds back. The pixel may lie outside the image.
  [[nodiscard]] std::optional<Vector<2>> project(const Vector<3>& point) const noexcept {
    const auto normalised = ahead(point);
    if (!normalised) return std::nullopt;
    return distort(*normalised);
  }

  /// project() with its derivative.
  [[nodiscard]] std::optional<PixelWithJacobian> project_with_jacobian(
      const Vector<3>& point) const noexcept {
    const auto normalised = ahead(point);
    if (!normalised) return std::nullopt;
    const double x = (*normalised)(0), y = (*normalised)(1), inverse_z = 1 / point(2);
    Matrix<2, 3> J;
    J << inverse_z, 0, -x * inverse_z, 0, inverse_z, -y * inverse_z;
    return PixelWithJacobian{distort(*normalised), product(distortion_jacobian(*normalised), J)};
  }

  /// Pixel of normalised coordinates. (1)
  [[nodiscard]] Vector<2> distort(const Vector<2>& normalised) const noexcept {
    const double x = normalised(0), y = normalised(1);
    if (!distorted_) return {p_.fx * x + p_.cx, p_.fy * y + p_.cy};
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (p_.k1 + r2 * (p_.k2 + r2 * p_.k3));
    return {p_.fx * (x * radial + 2 * p_.p1 * x * y + p_.p2 * (r2 + 2 * x * x)) + p_.cx,
            p_.fy * (y * radial + p_.p1 * (r2 + 2 * y * y) + 2 * p_.p2 * x * y) + p_.cy};
  }

  /// d distort / d normalised.
  [[nodiscard]] Matrix<2> distortion_jacobian(const Vector<2>& normalised) const noexcept {
    Matrix<2> J;
    if (!distorted_) {
      J << p_.fx, 0, 0, p_.fy;
      return J;
    }
    const double x = normalised(0), y = normalised(1), r2 = x * x + y * y;
    const double radial = 1 + r2 * (p_.k1 + r2 * (p_.k2 + r2 * p_.k3));
    const double slope = 2 * (p_.k1 + r2 * (2 * p_.k2 + r2 * 3 * p_.k3));  // d radial / d(r^2), doubled
    const double mixed = x * y * slope + 2 * (p_.p1 * x + p_.p2 * y);
    J << p_.fx * (radial + x * x * slope + 2 * p_.p1 * y + 6 * p_.p2 * x), p_.fx * mixed,  //
        p_.fy * mixed, p_.fy * (radial + y * y * slope + 6 * p_.p1 * y + 2 * p_.p2 * x);
    return J;
  }

  /// Normalised coordinates of a pixel: distort() inverted by Newton's method to rounding. Nothing where the
  /// pixel is not finite or no point in front of the camera projects there.
  [[nodiscard]] std::optional<Vector<2>> normalise(const Vector<2>& pixel) const noexcept {
    const Vector<2> target((pixel(0) - p_.cx) / p_.fx, (pixel(1) - p_.cy) / p_.fy);
    if (!(std::isfinite(target(0)) && std::isfinite(target(1)))) return std::nullopt;
    if (!distorted_) return target;
    Vector<2> n = target;
    constexpr int most_steps = 30;  // 3 to 6 in the field of view of a real lens
    for (int step = 0; step < most_steps; ++step) {
      const Vector<2> image = distort(n);
      const double ex = (image(0) - p_.cx) / p_.fx - target(0), ey = (image(1) - p_.cy) / p_.fy - target(1);
      const Matrix<2> J = distortion_jacobian(n);
      const double a = J(0, 0) / p_.fx, b = J(0, 1) / p_.fx, c = J(1, 0) / p_.fy, d = J(1, 1) / p_.fy;
      const double determinant = a * d - b * c;
      if (!(determinant > 0)) return std::nullopt;  // past the fold
      const double dx = (d * ex - b * ey) / determinant, dy = (a * ey - c * ex) / determinant;
      n -= Vector<2>(dx, dy);
      if (!(n.squaredNorm() <= largest_radius_squared_)) return std::nullopt;
      if (dx * dx + dy * dy <= 1e-28 * (1 + n.squaredNorm())) return n;
    }
    return std::nullopt;
  }

  /// normalise() with the derivative of the pixel there.
  [[nodiscard]] std::optional<NormalisedWithJacobian> normalise_with_jacobian(
      const Vector<2>& pixel) const noexcept {
    const auto normalised = normalise(pixel);
    if (!normalised) return std::nullopt;
    return NormalisedWithJacobian{*normalised, distortion_jacobian(*normalised)};
  }

  /// The point at depth 1 on the ray of a pixel, camera frame; nothing where normalise() has nothing.
  [[nodiscard]] std::optional<Vector<3>> unproject(const Vector<2>& pixel) const noexcept {
    const auto normalised = normalise(pixel);
    if (!normalised) return std::nullopt;
    return Vector<3>((*normalised)(0), (*normalised)(1), 1);
  }

private:
  [[nodiscard]] std::optional<Vector<2>> ahead(const Vector<3>& point) const noexcept {
    if (!(point(2) > 0)) return std::nullopt;
    const Vector<2> n(point(0) / point(2), point(1) / point(2));
    if (!(n.squaredNorm() <= largest_radius_squared_)) return std::nullopt;
    return n;
  }

  // Smallest s = r^2 > 0 where d(r radial)/dr = 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3 vanishes: beyond it the
  // image of a ray turns back towards the centre. The cubic is monotone between the roots of its derivative.
  [[nodiscard]] double fold_radius_squared() const noexcept {
    const double a = 3 * p_.k1, b = 5 * p_.k2, c = 7 * p_.k3;
    const auto slope = [&](double s) { return 1 + s * (a + s * (b + s * c)); };
    constexpr double far = 1e6;  // rays within 0.06 degrees of the image plane: no lens
    std::array<double, 4> knots{0, far, far, far};
    const double discriminant = b * b - 3 * a * c;  // of a + 2 b s + 3 c s^2
    if (c != 0 && discriminant >= 0) {
      const double root = std::sqrt(discriminant);
      knots[1] = std::min((-b - root) / (3 * c), (-b + root) / (3 * c));
      knots[2] = std::max((-b - root) / (3 * c), (-b + root) / (3 * c));
    } else if (c == 0 && b != 0) {
      knots[1] = -a / (2 * b);
    }
    for (double& knot : knots) knot = std::isfinite(knot) ? std::min(std::max(knot, 0.0), far) : far;
    for (std::size_t i = 0; i < 3; ++i) {
      double low = knots[i], high = knots[i + 1];
      if (slope(high) > 0) continue;
      for (int step = 0; step < 100; ++step) {
        const double middle = 0.5 * (low + high);
        (slope(middle) > 0 ? low : high) = middle;
      }
      return low;
    }
    return far;
  }

  PinholeParameters p_;
  bool distorted_ = false;
  double largest_radius_squared_ = std::numeric_limits<double>::infinity();
};

}  // namespace cairn::inline CAIRN_ABI
