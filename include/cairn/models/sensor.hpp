// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Ready-made sensors: positions, and ranges and bearings to beacons at known places.
#pragma once

#include <cmath>
#include <cstddef>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/manifold/so2.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

template <int M, int N>
consteval auto leading_pattern() {
  Pattern<static_cast<std::size_t>(M) * (N + 1)> pattern;
  for (int i = 0; i < M; ++i)
    for (int j = 0; j <= N; ++j) pattern.text[i * (N + 1) + j] = j == N ? ' ' : (i == j ? '1' : '.');
  pattern.text[M * (N + 1) - 1] = '\0';
  return pattern;
}

}  // namespace detail

/// Sees the first M of N states: a position from a state that begins with it. M = N is a landmark seen
/// directly.
template <int M, int N>
struct PositionSensor {
  using State = Vector<N>;
  using Measurement = Vector<M>;
  static constexpr bool linear = true;

  Matrix<M> covariance = Matrix<M>::Identity();  ///< m^2

  [[nodiscard]] Measurement predict(const State& x) const { return x.template head<M>(); }
  [[nodiscard]] Structured<detail::leading_pattern<M, N>()> jacobian(const State&) const { return {}; }
  [[nodiscard]] const Matrix<M>& noise(const State&) const { return covariance; }
};

/// Range [m] and bearing [rad, from the vehicle's heading, anticlockwise] to a beacon, from a pose in the
/// plane. Undefined where the vehicle stands on the beacon: the Jacobian is then not finite and the filter
/// refuses.
struct RangeBearing {
  using State = SE2;
  using Measurement = Product<Vector<1>, SO2>;

  Vector<2> beacon = Vector<2>::Zero();
  double range_sigma = 0.1;
  double bearing_sigma = 0.02;

  [[nodiscard]] static Measurement measurement(double range, double bearing) {
    return Measurement(Vector<1>(range), SO2(bearing));
  }
  [[nodiscard]] Measurement predict(const State& T_world_body) const {
    const Vector<2> p = T_world_body.inverse() * beacon;
    return measurement(std::sqrt(p(0) * p(0) + p(1) * p(1)), std::atan2(p(1), p(0)));
  }
  /// With p the beacon seen from the vehicle, a step (dx, dy, dtheta) moves it by (-dx + p_y dtheta,
  /// -dy - p_x dtheta): the turn changes the bearing alone.
  [[nodiscard]] Matrix<2, 3> jacobian(const State& T_world_body) const {
    const Vector<2> p = T_world_body.inverse() * beacon;
    const double squared = p(0) * p(0) + p(1) * p(1);
    const double range = std::sqrt(squared);
    Matrix<2, 3> h;
    h << -p(0) / range, -p(1) / range, 0.0, p(1) / squared, -p(0) / squared, -1.0;
    return h;
  }
  [[nodiscard]] Matrix<2> noise(const State&) const {
    return Vector<2>(range_sigma * range_sigma, bearing_sigma * bearing_sigma).asDiagonal();
  }
};

/// Heading [rad] of a pose in the plane.
struct Compass {
  using State = SE2;
  using Measurement = SO2;

  double sigma = 0.02;

  [[nodiscard]] Measurement predict(const State& T_world_body) const { return T_world_body.rotation(); }
  [[nodiscard]] Structured<"..1"> jacobian(const State&) const { return {}; }
  [[nodiscard]] Matrix<1> noise(const State&) const { return Matrix<1>(sigma * sigma); }
};

/// Position in the plane, from a pose.
struct PlanarPosition {
  using State = SE2;
  using Measurement = Vector<2>;

  double sigma = 1.0;

  [[nodiscard]] Measurement predict(const State& T_world_body) const { return T_world_body.translation(); }
  [[nodiscard]] Matrix<2, 3> jacobian(const State& T_world_body) const {
    Matrix<2, 3> h = Matrix<2, 3>::Zero();
    h.leftCols<2>() = T_world_body.rotation().matrix();
    return h;
  }
  [[nodiscard]] Matrix<2> noise(const State&) const { return sigma * sigma * Matrix<2>::Identity(); }
};

}}  // namespace cairn::CAIRN_ABI
