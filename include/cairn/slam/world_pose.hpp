// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A pose whose error is seen from the world: retract(T, xi) = exp(xi) T.
///
/// A point x of the world that is only known through such poses moves, where all of them step by the same xi,
/// by [I, -skew(x)] xi: a common error turns and shifts whatever hangs on them as one body, and nothing that
/// relates poses and points can see it, at whatever linearisation point. SE3 alone steps on the right; the
/// two covariances differ by the adjoint, P_world = Ad(T) P_right Ad(T)^T.
#pragma once

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A rigid motion into the world; tangent: translation, then rotation, in world axes about the world's
/// origin.
struct WorldPose {
  SE3 T_world_body;
};

template <>
struct manifold_traits<WorldPose> {
  using Scalar = double;
  using Tangent = Vector<6>;
  static constexpr int dof = 6;
  static WorldPose retract(const WorldPose& x, const Tangent& d) { return {SE3::exp(d) * x.T_world_body}; }
  static Tangent local(const WorldPose& x, const WorldPose& y) {
    return (y.T_world_body * x.T_world_body.inverse()).log();
  }
};

/// How the point x of the world moves with the world: d = [I, -skew(x)] xi.
[[nodiscard]] inline Vector<3> moved_with_world(const Vector<3>& x, const double* xi) noexcept {
  return {xi[0] + xi[4] * x(2) - xi[5] * x(1), xi[1] + xi[5] * x(0) - xi[3] * x(2),
          xi[2] + xi[3] * x(1) - xi[4] * x(0)};
}

/// Covariance of a step in the world as one of a right step of the pose.
[[nodiscard]] inline Matrix<6> seen_from_body(const Matrix<6>& in_world, const SE3& T_world_body) {
  const Matrix<6> Ad = T_world_body.inverse().adjoint();
  return symmetrised(product_transposed(product(Ad, in_world), Ad));
}

}}  // namespace cairn::CAIRN_ABI
