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
///
/// Far from the axis a polynomial folds: two rays have one pixel, and which of them was seen cannot be told.
/// With n = (x, y), r = |n|, p = (p2, p1), q = p . n and g(r) = r (1 + k1 r^2 + k2 r^4 + k3 r^6), (1) is
/// g(r) n / r + r^2 p + 2 q n. Its derivative is symmetric: g' along n and g / r across, both changed by
///   2 (q I + p n^T + n p^T),   whose eigenvalues are 2 (2 q +- |p| r), none below -6 |p| r.        (2)
/// So distortion is the gradient of a potential, which is strictly convex in the disc where g' and g / r stay
/// above 6 |p| r, and in a convex domain the gradient of a strictly convex function takes no value twice.
/// A camera is defined on the largest such disc: rays outside have no pixel, and a pixel has the one ray
/// inside or none. The disc touches the fold, where the derivative ceases to be invertible, on the side that
/// p points away from; for p = 0 it ends at the fold all around.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

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
    if (distorted_) {
      const double radius = disc_radius(), image = farthest_image(radius);
      largest_radius_squared_ = radius * radius;
      farthest_image_squared_ = image * image;
    }
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
  /// outside the view that another ray could have the same pixel (2). The pixel may lie outside the image.
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

  /// Pixel of normalised coordinates, the polynomial as it stands also where project() has no pixel. (1)
  [[nodiscard]] Vector<2> distort(const Vector<2>& normalised) const noexcept {
    if (!distorted_) return {p_.fx * normalised(0) + p_.cx, p_.fy * normalised(1) + p_.cy};
    const Bent to = bent(normalised(0), normalised(1));
    return {p_.fx * to.x + p_.cx, p_.fy * to.y + p_.cy};
  }

  /// d distort / d normalised.
  [[nodiscard]] Matrix<2> distortion_jacobian(const Vector<2>& normalised) const noexcept {
    Matrix<2> J;
    if (!distorted_) {
      J << p_.fx, 0, 0, p_.fy;
      return J;
    }
    const Bent to = bent(normalised(0), normalised(1));
    J << p_.fx * to.xx, p_.fx * to.xy, p_.fy * to.xy, p_.fy * to.yy;
    return J;
  }

  /// Normalised coordinates of a pixel: distort() inverted by Newton's method to rounding, 3 to 6 steps in
  /// the field of view of a real lens. project() of any point on the ray returns to the pixel. Nothing where
  /// the pixel is not finite or is that of no ray that project() takes.
  [[nodiscard]] std::optional<Vector<2>> normalise(const Vector<2>& pixel) const noexcept {
    const Vector<2> target((pixel(0) - p_.cx) / p_.fx, (pixel(1) - p_.cy) / p_.fy);
    if (!(std::isfinite(target(0)) && std::isfinite(target(1)))) return std::nullopt;
    if (!distorted_) return target;
    return straightened(target(0), target(1));
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

  // (1) for focal length 1 and its derivative, which is symmetric.
  struct Bent {
    double x, y;
    double xx, xy, yy;
  };
  [[nodiscard]] Bent bent(double x, double y) const noexcept {
    const double r2 = x * x + y * y, px = p_.p2 * x, py = p_.p1 * y, q = px + py;
    const double radial = 1 + r2 * (p_.k1 + r2 * (p_.k2 + r2 * p_.k3)), across = radial + 2 * q;
    const double slope = 2 * (p_.k1 + r2 * (2 * p_.k2 + r2 * 3 * p_.k3));  // d radial / d(r^2), doubled
    return {x * across + p_.p2 * r2, y * across + p_.p1 * r2, across + x * x * slope + 4 * px,
            x * y * slope + 2 * (p_.p1 * x + p_.p2 * y), across + y * y * slope + 4 * py};
  }

  // The n of the disc that is bent to the target. Steps are halved until they stay in the disc and come
  // nearer: the derivative is positive definite there, so that the full step is taken near the solution and
  // no step is refused for ever but where there is none.
  [[nodiscard]] std::optional<Vector<2>> straightened(double u, double v) const noexcept {
    const double squared = u * u + v * v;
    if (!(squared <= farthest_image_squared_)) return std::nullopt;
    // Wider than the disc by less than its derivative at the rim allows: rounding must not lose rays there.
    const double widest = largest_radius_squared_ * (1 + 1e-9);
    double x = u, y = v;
    if (squared > largest_radius_squared_) {
      const double shrunk = 0.9 * std::sqrt(largest_radius_squared_ / squared);
      x *= shrunk;
      y *= shrunk;
    }
    Bent at = bent(x, y);
    constexpr int most_steps = 50;
    for (int step = 0; step < most_steps; ++step) {
      const double ex = at.x - u, ey = at.y - v, error = ex * ex + ey * ey;
      const double determinant = at.xx * at.yy - at.xy * at.xy;
      if (!(determinant > 0)) return std::nullopt;
      const double dx = (at.yy * ex - at.xy * ey) / determinant, dy = (at.xx * ey - at.xy * ex) / determinant;
      // What a step leaves is its own square over the distance to the fold: nothing, after one so short.
      if (dx * dx + dy * dy <= 1e-17 * std::min(determinant, 1.0) * (x * x + y * y))
        return inside(x - dx, y - dy);
      for (double share = 1;; share *= 0.5) {
        const double next_x = x - share * dx, next_y = y - share * dy;
        if (next_x * next_x + next_y * next_y <= widest) {
          const Bent next = bent(next_x, next_y);
          const double left_x = next.x - u, left_y = next.y - v;
          if (left_x * left_x + left_y * left_y < error) {
            x = next_x;
            y = next_y;
            at = next;
            break;
          }
        }
        if (share < 1e-6) {  // no nearer: at the solution to rounding, or at the rim before one outside
          constexpr double rounding = 1e-15;
          if (error <= rounding * rounding * (1 + squared)) return inside(x, y);
          return std::nullopt;
        }
      }
    }
    return std::nullopt;
  }

  // A solution beyond the rim by rounding is moved onto it, so that project() takes it.
  [[nodiscard]] Vector<2> inside(double x, double y) const noexcept {
    const double squared = x * x + y * y, most = largest_radius_squared_ * (1 - 1e-15);
    const double scale = squared <= most ? 1 : std::sqrt(most / squared);
    return {scale * x, scale * y};
  }

  static constexpr double farthest = 1e3;  // rays within 0.06 degrees of the image plane: no lens

  // Where g' or g / r first comes down to 6 |p| r, and 1e-5 more: there the ray of a pixel is known to 1e-11.
  [[nodiscard]] double disc_radius() const noexcept {
    constexpr double least = 1e-5;
    const double fall = 6 * std::hypot(p_.p1, p_.p2);
    const double along = first_zero({1 - least, -fall, 3 * p_.k1, 0, 5 * p_.k2, 0, 7 * p_.k3});
    const double across = first_zero({1 - least, -fall, p_.k1, 0, p_.k2, 0, p_.k3});
    return std::min(along, across);
  }

  // No pixel of the disc of this radius is farther from the principal point, in focal lengths: g is largest
  // at the rim.
  [[nodiscard]] double farthest_image(double r) const noexcept {
    const double s = r * r, radial = 1 + s * (p_.k1 + s * (p_.k2 + s * p_.k3));
    const double image = (r * radial + 3 * std::hypot(p_.p1, p_.p2) * s) * (1 + 1e-9);
    return image >= 0 ? image : 0;  // not a number where coefficients overflow
  }

  // The first r in (0, farthest] where the polynomial with these coefficients, positive at 0, no longer is;
  // `farthest` where it stays so, 0 where coefficients overflow. Between the zeros of its derivative a
  // polynomial has one zero at most: found by bisection, from the highest derivative down.
  [[nodiscard]] static double first_zero(const std::array<double, 7>& coefficients) noexcept {
    constexpr std::size_t degree = 6;
    std::array<double, degree + 2> knots{0, farthest};
    std::size_t count = 2;
    for (std::size_t order = degree; order-- > 0;) {
      std::array<double, degree + 1> c{};  // of the derivative of this order
      for (std::size_t i = order; i <= degree; ++i) {
        c[i - order] = coefficients[i];
        for (std::size_t k = 0; k < order; ++k) c[i - order] *= static_cast<double>(i - k);
      }
      const auto positive = [&](double r) {
        double value = 0;
        for (std::size_t i = degree + 1; i-- > 0;) value = value * r + c[i];
        return value > 0;
      };
      if (order == 0 && !positive(0)) return 0;
      std::array<double, degree + 2> zeros{0};
      std::size_t found = 1;
      for (std::size_t i = 0; i + 1 < count; ++i) {
        double low = knots[i], high = knots[i + 1];
        const bool before = positive(low);
        if (positive(high) == before) continue;
        for (int step = 0; step < 70; ++step) {
          const double middle = 0.5 * (low + high);
          (positive(middle) == before ? low : high) = middle;
        }
        zeros[found++] = low;
      }
      zeros[found++] = farthest;
      knots = zeros;
      count = found;
    }
    return knots[1];
  }

  PinholeParameters p_;
  bool distorted_ = false;
  double largest_radius_squared_ = std::numeric_limits<double>::max();  // not infinity, nor what overflows
  double farthest_image_squared_ = std::numeric_limits<double>::max();
};

}}  // namespace cairn::CAIRN_ABI
