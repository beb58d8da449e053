// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Ready-made ways to move.
///
///   ConstantVelocity<D>       positions and velocities of D axes, driven by white acceleration
///   ConstantAcceleration<D>   the same with accelerations, driven by white jerk
///   Unicycle                  a pose in the plane steered by speed and turn rate
/// (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, chapter 6.)
#pragma once

#include <cmath>
#include <cstddef>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// D axes with a matrix of their derivatives each: [I dt I; 0 I] and its like (Upper), or full (noise).
template <int D, int Orders, bool Upper>
consteval auto chain_pattern() {
  constexpr int n = D * Orders;
  Pattern<static_cast<std::size_t>(n) * (n + 1)> pattern;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= n; ++j) {
      const char here = Upper && i == j ? '1' : ((!Upper || j > i) && (j - i) % D == 0 ? '*' : '.');
      pattern.text[i * (n + 1) + j] = j == n ? ' ' : here;
    }
  pattern.text[n * (n + 1) - 1] = '\0';
  return pattern;
}

}  // namespace detail

/// State (p_1..p_D, v_1..v_D) [m, m/s].
template <int D>
struct ConstantVelocity {
  using State = Vector<2 * D>;
  using Control = NoControl;
  static constexpr bool linear = true;

  double density = 1.0;  ///< spectral density of the acceleration, (m/s^2)^2 s

  [[nodiscard]] State propagate(const State& x, const Control&, double dt) const {
    State next = x;
    for (int i = 0; i < D; ++i) next(i) += dt * x(D + i);
    return next;
  }
  [[nodiscard]] Structured<detail::chain_pattern<D, 2, true>()> jacobian(const State&, const Control&,
                                                                         double dt) const {
    Structured<detail::chain_pattern<D, 2, true>()> f;
    f.values.fill(dt);
    return f;
  }
  [[nodiscard]] Structured<detail::chain_pattern<D, 2, false>()> noise(const State&, const Control&,
                                                                       double dt) const {
    Structured<detail::chain_pattern<D, 2, false>()> q;
    for (std::size_t i = 0; i < static_cast<std::size_t>(D); ++i) {
      q.values[2 * i] = density * dt * dt * dt / 3.0;
      q.values[2 * i + 1] = q.values[2 * (D + i)] = density * dt * dt / 2.0;
      q.values[2 * (D + i) + 1] = density * dt;
    }
    return q;
  }
};

/// State (p_1..p_D, v_1..v_D, a_1..a_D) [m, m/s, m/s^2].
template <int D>
struct ConstantAcceleration {
  using State = Vector<3 * D>;
  using Control = NoControl;
  static constexpr bool linear = true;

  double density = 1.0;  ///< spectral density of the jerk, (m/s^3)^2 s

  [[nodiscard]] State propagate(const State& x, const Control&, double dt) const {
    State next = x;
    for (int i = 0; i < D; ++i) {
      next(i) += dt * x(D + i) + 0.5 * dt * dt * x(2 * D + i);
      next(D + i) += dt * x(2 * D + i);
    }
    return next;
  }
  [[nodiscard]] Structured<detail::chain_pattern<D, 3, true>()> jacobian(const State&, const Control&,
                                                                         double dt) const {
    Structured<detail::chain_pattern<D, 3, true>()> f;
    for (std::size_t i = 0; i < static_cast<std::size_t>(D); ++i) {
      f.values[2 * i] = dt;
      f.values[2 * i + 1] = 0.5 * dt * dt;
      f.values[2 * D + i] = dt;
    }
    return f;
  }
  [[nodiscard]] Structured<detail::chain_pattern<D, 3, false>()> noise(const State&, const Control&,
                                                                       double dt) const {
    constexpr double factorial[] = {1, 1, 2, 6};
    double powers[6] = {1};
    for (int k = 1; k < 6; ++k) powers[k] = powers[k - 1] * dt;
    Structured<detail::chain_pattern<D, 3, false>()> q;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        const int power = 5 - a - b;  // integral of dt^(2-a)/(2-a)! dt^(2-b)/(2-b)!
        const double value = density * powers[power] / (power * factorial[2 - a] * factorial[2 - b]);
        for (int i = 0; i < D; ++i) q.values[static_cast<std::size_t>(3 * (a * D + i) + b)] = value;
      }
    return q;
  }
};

/// A pose T_world_body steered by (speed [m/s], turn rate [rad/s]), moved along the exact arc.
struct Unicycle {
  using State = SE2;
  using Control = Vector<2>;

  double speed_density = 0.01;  ///< of the noise on the speed, (m/s)^2 s
  double slip_density = 1e-6;   ///< of the noise sideways, (m/s)^2 s
  double turn_density = 0.001;  ///< of the noise on the turn rate, (rad/s)^2 s

  [[nodiscard]] State propagate(const State& T_world_body, const Control& u, double dt) const {
    return T_world_body * SE2::exp(Vector<3>(u(0) * dt, 0.0, u(1) * dt));
  }
  /// Adjoint of the way back: T exp(d) exp(u) = T exp(u) exp(Ad(exp(-u)) d).
  [[nodiscard]] Matrix<3> jacobian(const State&, const Control& u, double dt) const {
    return SE2::exp(Vector<3>(-u(0) * dt, 0.0, -u(1) * dt)).adjoint();
  }
  [[nodiscard]] Diagonal<3> noise(const State&, const Control&, double dt) const {
    return {{dt * speed_density, dt * slip_density, dt * turn_density}};
  }
};

}}  // namespace cairn::CAIRN_ABI
