// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The numbers by which a stereo rig is off, and the rig that they make of the nominal one.
///
/// Coming loose takes five, (w_x, w_y, w_z, t_y, t_z): a right rotation of the right camera [rad], and the
/// direction of the baseline, turned by angles towards the second and third of the orthonormal axes
/// u1 = t0/|t0|, u2 near y, u3:
///   R = R0 exp(w),   t = |t0| (u1 + t_y u2 + t_z u3) / |...|                              (1)
/// Seven more are what a calibration gets wrong, all without a unit: the baseline's length l, which images
/// alone cannot see but which is what the size of the world hangs on, the focal lengths g of both cameras
/// and the ratio h of the right ones to the left ones, and the principal points, p of both and q of the right
/// one more, in focal lengths:
///   |t| = |t0| exp(l),   f = f0 exp(g [+ h]),   c = c0 + f0 (p [+ q])                      (2)
/// with what stands in brackets for the right camera. Which of them a scene shows is for an estimator to find
/// out: yaw w_y and column q_x of the right camera differ by x^2 over the image, a common focal length is
/// seen where the camera turns. Each has its own sigma beforehand (RigSigmas) for that reason.
#pragma once

#include <array>
#include <cmath>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// (w_x, w_y, w_z, t_y, t_z, l, g, h, p_x, p_y, q_x, q_y) of (1) and (2).
inline constexpr int rig_numbers = 12;
using RigState = Vector<rig_numbers>;
inline constexpr std::array<const char*, rig_numbers> rig_number_names{
    "rotation_x",   "rotation_y",  "rotation_z", "baseline_y", "baseline_z",     "baseline_length",
    "focal_length", "focal_ratio", "centre_x",   "centre_y",   "right_centre_x", "right_centre_y"};

/// How far a rig may be off from what its calibration says: a standard deviation for each kind of number.
/// All zero: the rig is known exactly.
struct RigSigmas {
  double rotation = 0;      ///< of the right camera, about each axis [rad]
  double direction = 0;     ///< of the baseline, each way [rad]
  double length = 0;        ///< of the baseline, relative
  double focal = 0;         ///< of both cameras' focal lengths together, relative
  double focal_ratio = 0;   ///< of the right ones over the left ones, relative
  double centre = 0;        ///< of both principal points together, each way [focal lengths]
  double right_centre = 0;  ///< of the right one against the left one, each way [focal lengths]

  [[nodiscard]] RigState each() const {
    RigState sigmas;
    sigmas << rotation, rotation, rotation, direction, direction, length, focal, focal_ratio, centre, centre,
        right_centre, right_centre;
    return sigmas;
  }
  [[nodiscard]] bool known() const { return each().isZero(0); }
  /// All of them multiplied.
  [[nodiscard]] RigSigmas scaled(double factor) const {
    RigSigmas result = *this;
    for (double* sigma : {&result.rotation, &result.direction, &result.length, &result.focal,
                          &result.focal_ratio, &result.centre, &result.right_centre})
      *sigma *= factor;
    return result;
  }
  /// A diagonal covariance; what is known exactly has 1e-9 squared, so that it is one.
  [[nodiscard]] Matrix<rig_numbers> covariance() const {
    constexpr double least = 1e-9;
    return Matrix<rig_numbers>(each().cwiseMax(least).cwiseAbs2().asDiagonal());
  }
};

/// The rigs around a nominal one, which needs a baseline.
class RigCorrection {
public:
  explicit RigCorrection(const StereoRig& nominal) : nominal_(nominal) {
    CAIRN_EXPECTS(nominal.baseline() > 0, "RigCorrection: the rig needs a baseline");
    const Vector<3> u1 = nominal.T_left_right.translation() / nominal.baseline();
    const int least = std::abs(u1(1)) < 0.9 ? 1 : 2;
    Vector<3> u2 = Vector<3>::Unit(least) - u1(least) * u1;
    u2 /= u2.norm();
    put(axes_, 0, 0, u1);
    put(axes_, 0, 1, u2);
    put(axes_, 0, 2, detail::cross<double>(u1, u2));
  }

  [[nodiscard]] const StereoRig& nominal() const noexcept { return nominal_; }

  /// (1). Throws Error where the numbers, or the pose that comes of them, are not finite.
  [[nodiscard]] StereoRig rig(const Vector<5>& state) const {
    StereoRig result = nominal_;
    result.T_left_right = SE3(rotation(state), nominal_.baseline() * direction(state));
    expect_finite(result);
    return result;
  }

  /// The numbers of (1) that make of the nominal rig the pose of another one's right camera, but for the
  /// length of its baseline, which must not be turned by a right angle or more: the inverse of rig().
  [[nodiscard]] Vector<5> state(const StereoRig& other) const {
    const Vector<3> w = (nominal_.T_left_right.rotation().inverse() * other.T_left_right.rotation()).log();
    const Vector<3> t = transposed_product(axes_, other.T_left_right.translation());
    CAIRN_EXPECTS(t(0) > 0, "RigCorrection: expected a baseline within a right angle of the nominal one");
    Vector<5> result;
    result << w(0), w(1), w(2), t(1) / t(0), t(2) / t(0);
    return result;
  }

  /// (1) and (2). Throws Error where the numbers, or the rig that comes of them, are not finite.
  [[nodiscard]] StereoRig rig(const RigState& state) const {
    StereoRig result = rig(loose(state));
    result.T_left_right =
        SE3(result.T_left_right.rotation(), std::exp(state(5)) * result.T_left_right.translation());
    expect_finite(result);
    const Vector<2> both(state(8), state(9));
    result.left = corrected(nominal_.left, state(6), both);
    result.right = corrected(nominal_.right, state(6) + state(7), both + Vector<2>(state(10), state(11)));
    return result;
  }

  /// The five numbers of (1) among the twelve.
  [[nodiscard]] static Vector<5> loose(const RigState& state) { return part_of<5, 1>(state, 0, 0); }

  /// R of (1), from the right to the left camera.
  [[nodiscard]] SO3 rotation(const Vector<5>& state) const {
    return nominal_.T_left_right.rotation() * SO3::exp(part_of<3, 1>(state, 0, 0));
  }

  /// Unit vector along t of (1).
  [[nodiscard]] Vector<3> direction(const Vector<5>& state) const {
    const Vector<3> along = product(axes_, Vector<3>(1, state(3), state(4)));
    return along / along.norm();
  }

  /// d direction / d (t_y, t_z) to first order in them.
  [[nodiscard]] Matrix<3, 2> direction_jacobian() const { return part_of<3, 2>(axes_, 0, 1); }

private:
  static void expect_finite(const StereoRig& rig) {
    if (!all_finite(rig.T_left_right.matrix()) || !(rig.baseline() > 0))
      raise("RigCorrection: expected numbers of which a rig with a baseline comes");
  }
  [[nodiscard]] static PinholeCamera corrected(const PinholeCamera& camera, double focal,
                                               const Vector<2>& centre) {
    PinholeParameters p = camera.parameters();
    p.cx += p.fx * centre(0);
    p.cy += p.fy * centre(1);
    p.fx *= std::exp(focal);
    p.fy *= std::exp(focal);
    return PinholeCamera(p);
  }

  StereoRig nominal_;
  Matrix<3> axes_;  // u1, u2, u3
};

}}  // namespace cairn::CAIRN_ABI
