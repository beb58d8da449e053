// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Ready-made ways to move.
///
///   ConstantVelocity<D>       positions and velocities of D axes, driven by white acceleration
///   ConstantAcceleration<D>   the same with accelerations, driven by white jerk
///   Unicycle                  a pose in the plane steered by speed and turn rate
/// In double, or in float: ConstantVelocity<D, float>, Unicyclef.
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
template <int D, class S = double>
struct ConstantVelocity {
  using State = Vector<2 * D, S>;
  using Control = NoControl;
  static constexpr bool linear = true;

  S density = S(1);  ///< spectral density of the acceleration, (m/s^2)^2 s

  [[nodiscard]] State propagate(const State& x, const Control&, double dt) const {
    State next = x;
    for (int i = 0; i < D; ++i) next(i) += static_cast<S>(dt) * x(D + i);
    return next;
  }
  [[nodiscard]] Structured<detail::chain_pattern<D, 2, true>(), S> jacobian(const State&, const Control&,
                                                                            double dt) const {
    Structured<detail::chain_pattern<D, 2, true>(), S> f;
    f.values.fill(static_cast<S>(dt));
    return f;
  }
  [[nodiscard]] Structured<detail::chain_pattern<D, 2, false>(), S> noise(const State&, const Control&,
                                                                          double dt) const {
    const S t = static_cast<S>(dt);
    Structured<detail::chain_pattern<D, 2, false>(), S> q;
    for (std::size_t i = 0; i < static_cast<std::size_t>(D); ++i) {
      q.values[2 * i] = density * t * t * t / S(3);
      q.values[2 * i + 1] = q.values[2 * (D + i)] = density * t * t / S(2);
      q.values[2 * (D + i) + 1] = density * t;
    }
    return q;
  }
};

/// State (p_1..p_D, v_1..v_D, a_1..a_D) [m, m/s, m/s^2].
template <int D, class S = double>
struct ConstantAcceleration {
  using State = Vector<3 * D, S>;
  using Control = NoControl;
  static constexpr bool linear = true;

  S density = S(1);  ///< spectral density of the jerk, (m/s^3)^2 s

  [[nodiscard]] State propagate(const State& x, const Control&, double dt) const {
    const S t = static_cast<S>(dt);
    State next = x;
    for (int i = 0; i < D; ++i) {
      next(i) += t * x(D + i) + S(0.5) * t * t * x(2 * D + i);
      next(D + i) += t * x(2 * D + i);
    }
    return next;
  }
  [[nodiscard]] Structured<detail::chain_pattern<D, 3, true>(), S> jacobian(const State&, const Control&,
                                                                            double dt) const {
    const S t = static_cast<S>(dt);
    Structured<detail::chain_pattern<D, 3, true>(), S> f;
    for (std::size_t i = 0; i < static_cast<std::size_t>(D); ++i) {
      f.values[2 * i] = t;
      f.values[2 * i + 1] = S(0.5) * t * t;
      f.values[2 * D + i] = t;
    }
    return f;
  }
  [[nodiscard]] Structured<detail::chain_pattern<D, 3, false>(), S> noise(const State&, const Control&,
                                                                          double dt) const {
    constexpr S factorial[] = {1, 1, 2, 6};
    S powers[6] = {1};
    for (int k = 1; k < 6; ++k) powers[k] = powers[k - 1] * static_cast<S>(dt);
    Structured<detail::chain_pattern<D, 3, false>(), S> q;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        const int power = 5 - a - b;  // integral of dt^(2-a)/(2-a)! dt^(2-b)/(2-b)!
        const S value = density * powers[power] / (S(power) * factorial[2 - a] * factorial[2 - b]);
        for (int i = 0; i < D; ++i) q.values[static_cast<std::size_t>(3 * (a * D + i) + b)] = value;
      }
    return q;
  }
};

/// A pose T_world_body steered by (speed [m/s], turn rate [rad/s]), moved along the exact arc.
template <class S>
struct BasicUnicycle {
  using State = BasicSE2<S>;
  using Control = Vector<2, S>;

  S speed_density = S(0.01);  ///< of the noise on the speed, (m/s)^2 s
  S slip_density = S(1e-6);   ///< of the noise sideways, (m/s)^2 s
  S turn_density = S(0.001);  ///< of the noise on the turn rate, (rad/s)^2 s

  [[nodiscard]] State propagate(const State& T_world_body, const Control& u, double dt) const {
    const S t = static_cast<S>(dt);
    return T_world_body * State::exp(Vector<3, S>(u(0) * t, S(0), u(1) * t));
  }
  /// Adjoint of the way back: T exp(d) exp(u) = T exp(u) exp(Ad(exp(-u)) d).
  [[nodiscard]] Matrix<3, 3, S> jacobian(const State&, const Control& u, double dt) const {
    const S t = static_cast<S>(dt);
    return State::exp(Vector<3, S>(-u(0) * t, S(0), -u(1) * t)).adjoint();
  }
  [[nodiscard]] Diagonal<3, S> noise(const State&, const Control&, double dt) const {
    const S t = static_cast<S>(dt);
    return {{t * speed_density, t * slip_density, t * turn_density}};
  }
};
using Unicycle = BasicUnicycle<double>;
using Unicyclef = BasicUnicycle<float>;

}}  // namespace cairn::CAIRN_ABI
