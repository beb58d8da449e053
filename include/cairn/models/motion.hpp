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
#include <cairn/filter/structure.hpp>
#include <cairn/manifold/se2.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

namespace detail {

/// [I dt I; 0 I] and its like: ones on the diagonal, given numbers on the D-th (and 2D-th) superdiagonal.
template <int D, int Orders>
consteval auto chain_pattern() {
  constexpr int n = D * Orders;
  Pattern<static_cast<std::size_t>(n) * (n + 1)> pattern;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= n; ++j)
      pattern.text[i * (n + 1) + j] = j == n ? ' ' : (i == j ? '1' : (j > i && (j - i) % D == 0 ? '*' : '.'));
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
  [[nodiscard]] Structured<detail::chain_pattern<D, 2>()> jacobian(const State&, const Control&,
                                                                   double dt) const {
    Structured<detail::chain_pattern<D, 2>()> f;
    f.values.fill(dt);
    return f;
  }
  [[nodiscard]] Matrix<2 * D> noise(const State&, const Control&, double dt) const {
    Matrix<2 * D> q = Matrix<2 * D>::Zero();
    for (int i = 0; i < D; ++i) {
      q(i, i) = density * dt * dt * dt / 3.0;
      q(i, D + i) = q(D + i, i) = density * dt * dt / 2.0;
      q(D + i, D + i) = density * dt;
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
  [[nodiscard]] Structured<detail::chain_pattern<D, 3>()> jacobian(const State&, const Control&,
                                                                   double dt) const {
    Structured<detail::chain_pattern<D, 3>()> f;
    for (std::size_t i = 0; i < static_cast<std::size_t>(D); ++i) {
      f.values[2 * i] = dt;
      f.values[2 * i + 1] = 0.5 * dt * dt;
      f.values[2 * D + i] = dt;
    }
    return f;
  }
  [[nodiscard]] Matrix<3 * D> noise(const State&, const Control&, double dt) const {
    const double factorial[] = {1, 1, 2, 6};
    Matrix<3 * D> q = Matrix<3 * D>::Zero();
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        const int power = 5 - a - b;  // integral of dt^(2-a)/(2-a)! dt^(2-b)/(2-b)!
        const double value = density * std::pow(dt, power) / (power * factorial[2 - a] * factorial[2 - b]);
        for (int i = 0; i < D; ++i) q(a * D + i, b * D + i) = value;
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
  [[nodiscard]] Matrix<3> noise(const State&, const Control&, double dt) const {
    return (dt * Vector<3>(speed_density, slip_density, turn_density)).asDiagonal();
  }
};

}  // namespace cairn::inline CAIRN_ABI
