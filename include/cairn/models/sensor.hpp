// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Ready-made sensors: positions, and ranges and bearings to beacons at known places. In double, or in float:
/// PositionSensor<M, N, float>, RangeBearingf.
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
template <int M, int N, class S = double>
struct PositionSensor {
  using State = Vector<N, S>;
  using Measurement = Vector<M, S>;
  static constexpr bool linear = true;

  Matrix<M, M, S> covariance = Matrix<M, M, S>::Identity();  ///< m^2

  [[nodiscard]] Measurement predict(const State& x) const {
    Measurement z;
    for (int i = 0; i < M; ++i) z(i) = x(i);
    return z;
  }
  [[nodiscard]] Structured<detail::leading_pattern<M, N>(), S> jacobian(const State&) const { return {}; }
  [[nodiscard]] const Matrix<M, M, S>& noise(const State&) const { return covariance; }
};

/// Range [m] and bearing [rad, from the vehicle's heading, anticlockwise] to a beacon, from a pose in the
/// plane. Undefined where the vehicle stands on the beacon: the Jacobian is then not finite and the filter
/// refuses.
template <class S>
struct BasicRangeBearing {
  using State = BasicSE2<S>;
  using Measurement = Product<Vector<1, S>, BasicSO2<S>>;

  Vector<2, S> beacon = Vector<2, S>::Zero();
  S range_sigma = S(0.1);
  S bearing_sigma = S(0.02);

  [[nodiscard]] static Measurement measurement(S range, S bearing) {
    return Measurement(Vector<1, S>(range), BasicSO2<S>(bearing));
  }
  [[nodiscard]] Measurement predict(const State& T_world_body) const {
    const Vector<2, S> p = T_world_body.inverse() * beacon;
    return measurement(std::sqrt(p(0) * p(0) + p(1) * p(1)), std::atan2(p(1), p(0)));
  }
  /// With p the beacon seen from the vehicle, a step (dx, dy, dtheta) moves it by (-dx + p_y dtheta,
  /// -dy - p_x dtheta): the turn changes the bearing alone.
  [[nodiscard]] Matrix<2, 3, S> jacobian(const State& T_world_body) const {
    const Vector<2, S> p = T_world_body.inverse() * beacon;
    const S squared = p(0) * p(0) + p(1) * p(1);
    const S range = std::sqrt(squared);
    Matrix<2, 3, S> h;
    h << -p(0) / range, -p(1) / range, S(0), p(1) / squared, -p(0) / squared, S(-1);
    return h;
  }
  [[nodiscard]] Matrix<2, 2, S> noise(const State&) const {
    return Vector<2, S>(range_sigma * range_sigma, bearing_sigma * bearing_sigma).asDiagonal();
  }
};
using RangeBearing = BasicRangeBearing<double>;
using RangeBearingf = BasicRangeBearing<float>;

/// Heading [rad] of a pose in the plane.
template <class S>
struct BasicCompass {
  using State = BasicSE2<S>;
  using Measurement = BasicSO2<S>;

  S sigma = S(0.02);

  [[nodiscard]] Measurement predict(const State& T_world_body) const { return T_world_body.rotation(); }
  [[nodiscard]] Structured<"..1", S> jacobian(const State&) const { return {}; }
  [[nodiscard]] Matrix<1, 1, S> noise(const State&) const { return Matrix<1, 1, S>(sigma * sigma); }
};
using Compass = BasicCompass<double>;
using Compassf = BasicCompass<float>;

/// Position in the plane, from a pose.
template <class S>
struct BasicPlanarPosition {
  using State = BasicSE2<S>;
  using Measurement = Vector<2, S>;

  S sigma = S(1);

  [[nodiscard]] Measurement predict(const State& T_world_body) const { return T_world_body.translation(); }
  [[nodiscard]] Matrix<2, 3, S> jacobian(const State& T_world_body) const {
    const Matrix<2, 2, S> r = T_world_body.rotation().matrix();
    Matrix<2, 3, S> h;
    h << r(0, 0), r(0, 1), S(0), r(1, 0), r(1, 1), S(0);
    return h;
  }
  [[nodiscard]] Matrix<2, 2, S> noise(const State&) const {
    return sigma * sigma * Matrix<2, 2, S>::Identity();
  }
};
using PlanarPosition = BasicPlanarPosition<double>;
using PlanarPositionf = BasicPlanarPosition<float>;

}}  // namespace cairn::CAIRN_ABI
