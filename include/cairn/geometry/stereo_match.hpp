// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a stereo pose is estimated from: landmarks of a map and where both cameras see them.
#pragma once

#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// False for what rounding, that of floats too, makes of no covariance: a negative variance, a correlation
/// above 1, three that contradict each other. Reads the mean of both triangles.
[[nodiscard]] inline bool may_be_covariance(const Matrix<3>& a) noexcept {
  constexpr double slack = 1e-3;
  const double x = a(0, 0), y = a(1, 1), z = a(2, 2);
  const double xy = 0.5 * (a(0, 1) + a(1, 0)), xz = 0.5 * (a(0, 2) + a(2, 0)), yz = 0.5 * (a(1, 2) + a(2, 1));
  if (!(x >= 0 && y >= 0 && z >= 0)) return false;
  if (xy * xy > (1 + slack) * x * y || xz * xz > (1 + slack) * x * z || yz * yz > (1 + slack) * y * z)
    return false;
  return !(x * y * z + 2 * xy * xz * yz - x * yz * yz - y * xz * xz - z * xy * xy < -slack * x * y * z);
}

}  // namespace detail

/// A landmark of the map seen by both cameras of a rig.
struct StereoMatch {
  Vector<3> landmark = Vector<3>::Zero();    ///< world frame [m]
  Matrix<3> covariance = Matrix<3>::Zero();  ///< of the landmark [m^2]; zero where known exactly
  Vector<2> left = Vector<2>::Zero();        ///< observed pixels
  Vector<2> right = Vector<2>::Zero();
  double sigma_left = 0.5, sigma_right = 0.5;  ///< pixel noise in each coordinate [pixels]
};

}}  // namespace cairn::CAIRN_ABI
