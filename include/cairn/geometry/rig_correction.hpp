// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The five numbers by which a stereo rig comes loose, and the rig that they make of the nominal one.
///
/// State (w_x, w_y, w_z, t_y, t_z): a right rotation of the right camera [rad], and the direction of the
/// baseline, turned by angles towards the second and third of the orthonormal axes u1 = t0/|t0|, u2 near y,
/// u3:
///   R = R0 exp(w),   t = |t0| (u1 + t_y u2 + t_z u3) / |...|                              (1)
/// The length of the baseline stays: images alone cannot see it.
#pragma once

#include <cmath>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

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

  /// (1)
  [[nodiscard]] StereoRig rig(const Vector<5>& state) const {
    StereoRig result = nominal_;
    result.T_left_right = SE3(rotation(state), nominal_.baseline() * direction(state));
    return result;
  }

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
  StereoRig nominal_;
  Matrix<3> axes_;  // u1, u2, u3
};

}}  // namespace cairn::CAIRN_ABI
