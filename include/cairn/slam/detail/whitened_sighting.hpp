// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a pair of pixels says of a point, in units of their noise.
///
/// r are the four residuals (left x, y, right x, y) divided by sigma, J = d h / d x their derivative by the
/// point in world axes: A = J^T J, b = J^T r, and a point that moves by d leaves r - J d. Distortion is
/// evaluated once, at the observation.
#pragma once

#include <array>
#include <optional>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/geometry/rig_correction.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// A pose of the rig as the loops need it.
struct RigView {
  Matrix<3> R_left_world, R_right_world;
  Vector<3> camera, t_right_left;
  Matrix<3, 2> by_direction = Matrix<3, 2>::Zero();  ///< d point in the right frame / d baseline's direction
  std::array<Vector<2>, 2> nominal_focal{Vector<2>::Zero(), Vector<2>::Zero()};  ///< left, right [pixels]
  double nearest;  ///< depth below which a point is not in view of both cameras

  RigView(const SE3& T_world_camera, const StereoRig& rig)
      : R_left_world(transposed(T_world_camera.rotation().matrix())),
        R_right_world(transposed_product(rig.T_left_right.rotation().matrix(), R_left_world)),
        camera(T_world_camera.translation()),
        t_right_left(rig.T_left_right.inverse().translation()),
        nearest(0.05 * rig.baseline()) {}

  /// Makes it ready for what depends on the numbers of a rig that is off.
  void derive(const RigCorrection& correction) {
    const StereoRig& nominal = correction.nominal();
    const Matrix<3> R_right_left = product_transposed(R_right_world, R_left_world);
    by_direction = -t_right_left.norm() * product(R_right_left, correction.direction_jacobian());
    nominal_focal[0] = {nominal.left.fx(), nominal.left.fy()};
    nominal_focal[1] = {nominal.right.fx(), nominal.right.fy()};
  }
};

/// A, b and r^T r.
struct PointStatistics {
  Matrix<3> A = Matrix<3>::Zero();
  Vector<3> b = Vector<3>::Zero();
  double squares = 0;
};

/// What it says of the rig's numbers c (geometry/rig_correction.hpp): with J_c = d h / d c, E = J^T J_c,
/// D = J_c^T J_c, u = J_c^T r.
struct RigStatistics {
  bool only_E = false;  ///< D and u, most of the work, are not asked for
  Matrix<3, rig_numbers> E = Matrix<3, rig_numbers>::Zero();
  Matrix<rig_numbers> D = Matrix<rig_numbers>::Zero();
  RigState u = RigState::Zero();
};

/// How the point in a camera's frame and its pixel move with those of the rig's numbers that this camera has.
struct RigDerivatives {
  static constexpr int of_point = 6;  ///< the first numbers move the point
  bool right = false;
  Matrix<3, of_point> point = Matrix<3, of_point>::Zero();  ///< only in the right frame
  Vector<2> nominal_focal;                                  ///< [pixels]
};

/// One camera's observation: normalised coordinates, and d pixel / d normalised over sigma.
class WhitenedPixel {
public:
  [[nodiscard]] static std::optional<WhitenedPixel> of(const PinholeCamera& camera, const Vector<2>& pixel,
                                                       double sigma) {
    const auto seen = camera.normalise_with_jacobian(pixel);
    if (!seen) return std::nullopt;
    WhitenedPixel result;
    result.seen_ = seen->normalised;
    result.W_ = seen->J_pixel / sigma;
    result.from_centre_ = Vector<2>(pixel(0) - camera.cx(), pixel(1) - camera.cy()) / sigma;
    result.inverse_sigma_ = 1 / sigma;
    return result;
  }

  /// Adds this camera's part for a point at p in its frame, R from world axes. False beside the view.
  [[nodiscard]] bool add(const Matrix<3>& R, const Vector<3>& p, double nearest, PointStatistics& s,
                         const RigDerivatives* by_rig = nullptr,
                         RigStatistics* rig = nullptr) const noexcept {
    constexpr double widest = 10;  // tangent of 84 degrees
    const double reach = widest * p(2);
    if (!(p(2) > nearest && p(0) < reach && -p(0) < reach && p(1) < reach && -p(1) < reach)) return false;
    const double inverse = 1 / p(2), x = p(0) * inverse, y = p(1) * inverse;
    const double ex = seen_(0) - x, ey = seen_(1) - y;
    for (int i = 0; i < 2; ++i) {
      const double r = W_(i, 0) * ex + W_(i, 1) * ey;
      const Vector<3> j(W_(i, 0) * inverse, W_(i, 1) * inverse, -(W_(i, 0) * x + W_(i, 1) * y) * inverse);
      double row[3];
      for (int k = 0; k < 3; ++k) row[k] = j(0) * R(0, k) + j(1) * R(1, k) + j(2) * R(2, k);
      s.squares += r * r;
      for (int c = 0; c < 3; ++c) {
        s.b(c) += r * row[c];
        for (int k = 0; k < 3; ++k) s.A(k, c) += row[k] * row[c];
      }
      if (by_rig != nullptr) add_rig(i, r, row, j, *by_rig, *rig);
    }
    return true;
  }

private:
  /// The part of the residual r in direction i, whose derivative by the point is `row` in world axes and j in
  /// the camera's.
  void add_rig(int i, double r, const double (&row)[3], const Vector<3>& j, const RigDerivatives& by,
               RigStatistics& rig) const noexcept {
    double of_rig[rig_numbers] = {};
    int first = RigDerivatives::of_point;
    const double centre = by.nominal_focal(i) * inverse_sigma_;
    const double from_centre = from_centre_(i) - r;  // as predicted: the noise of r may not see itself
    of_rig[6] = from_centre;
    of_rig[8 + i] = centre;
    if (by.right) {
      first = 0;
      for (int c = 0; c < RigDerivatives::of_point; ++c)
        of_rig[c] = j(0) * by.point(0, c) + j(1) * by.point(1, c) + j(2) * by.point(2, c);
      of_rig[7] = from_centre;
      of_rig[10 + i] = centre;
    }
    for (int c = first; c < rig_numbers; ++c)
      for (int k = 0; k < 3; ++k) rig.E(k, c) += row[k] * of_rig[c];
    for (int c = first; c < rig_numbers && !rig.only_E; ++c) {
      rig.u(c) += r * of_rig[c];
      for (int k = first; k < rig_numbers; ++k) rig.D(k, c) += of_rig[k] * of_rig[c];
    }
  }

  Vector<2> seen_ = Vector<2>::Zero();
  Matrix<2> W_ = Matrix<2>::Zero();
  Vector<2> from_centre_ = Vector<2>::Zero();  // of the pixel, over sigma
  double inverse_sigma_ = 0;
};

/// Both cameras' observation of a point.
class WhitenedSighting {
public:
  /// Nothing where a pixel has no ray.
  [[nodiscard]] static std::optional<WhitenedSighting> of(const StereoRig& rig, const Vector<2>& left,
                                                          const Vector<2>& right, double sigma) {
    const auto l = WhitenedPixel::of(rig.left, left, sigma), r = WhitenedPixel::of(rig.right, right, sigma);
    if (!l || !r) return std::nullopt;
    WhitenedSighting result;
    result.left_ = *l;
    result.right_ = *r;
    return result;
  }

  /// Adds what the sighting says of the point x of the world. False where a camera of this view cannot see
  /// it.
  [[nodiscard]] bool add(const RigView& view, const Vector<3>& x, PointStatistics& s) const noexcept {
    const Vector<3> y = x - view.camera;
    return left_.add(view.R_left_world, product(view.R_left_world, y), view.nearest, s) &&
           right_.add(view.R_right_world, product(view.R_right_world, y) + view.t_right_left, view.nearest,
                      s);
  }

  /// The same, and what it says of the rig.
  [[nodiscard]] bool add(const RigView& view, const Vector<3>& x, PointStatistics& s,
                         RigStatistics& rig) const noexcept {
    const Vector<3> y = x - view.camera;
    const Vector<3> p = product(view.R_right_world, y) + view.t_right_left;
    RigDerivatives left, right;
    left.nominal_focal = view.nominal_focal[0];
    right.nominal_focal = view.nominal_focal[1];
    right.right = true;  // p = exp(-w) R^T (. - t)
    put(right.point, 0, 0, skew(p));
    put(right.point, 0, 3, view.by_direction);
    put(right.point, 0, 5, view.t_right_left);
    return left_.add(view.R_left_world, product(view.R_left_world, y), view.nearest, s, &left, &rig) &&
           right_.add(view.R_right_world, p, view.nearest, s, &right, &rig);
  }

private:
  WhitenedPixel left_, right_;
};

/// The same statistics once the point itself has covariance C: with G = (I + A C)^-1,
///   information N = G A,   gradient g = G b,   chi^2 = r^T r - b^T C g
/// The rig's numbers see the pixels through the point: J^T W J_c = G E, J_c^T W J_c = D - E^T C G E and
/// J_c^T W r = u - E^T C g.
/// (Woodbury, as in geometry's stereo residuals; holds for C = 0.)
struct WeighedSighting {
  Matrix<3> G, N;
  Vector<3> g;
  double chi_squared;

  WeighedSighting(const PointStatistics& s, const Matrix<3>& C) noexcept {
    Matrix<3> m = product(s.A, C);
    for (int i = 0; i < 3; ++i) m(i, i) += 1;
    G = inverse(m);
    N = symmetrised(product(G, s.A));
    g = product(G, s.b);
    const Vector<3> Cg = product(C, g);
    chi_squared = s.squares - (s.b(0) * Cg(0) + s.b(1) * Cg(1) + s.b(2) * Cg(2));
  }

private:
  // By cofactors; I + A C of covariances has all its eigenvalues at 1 or above.
  [[nodiscard]] static Matrix<3> inverse(const Matrix<3>& m) noexcept {
    Matrix<3> c;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        c(j, i) = m(i1, j1) * m(i2, j2) - m(i1, j2) * m(i2, j1);
      }
    return c / (m(0, 0) * c(0, 0) + m(0, 1) * c(1, 0) + m(0, 2) * c(2, 0));
  }
};

}}}  // namespace cairn::CAIRN_ABI::detail
