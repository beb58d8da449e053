// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Ordinary differential equations y' = f(t, y): a step of fixed length, or a way of any length with step
/// control.
///
///   runge_kutta_4    the classical rule, order 4
///   DormandPrince    the pair of orders 5 and 4 with step control
/// (W. Kutta, "Beitrag zur naeherungsweisen Integration totaler Differentialgleichungen", 1901; J. Dormand,
/// P. Prince, "A family of embedded Runge-Kutta formulae", J. Comp. Appl. Math. 6, 1980; E. Hairer, S.
/// Norsett, G. Wanner, "Solving Ordinary Differential Equations I", 1993, II.4 and II.5.) Both are explicit:
/// an equation with a time constant far below the time of interest takes steps of that time constant.
///
/// ```cpp
/// std::array<double, 2> y{1.0, 0.0};  // a pendulum: angle and rate
/// const auto arrived = cairn::DormandPrince{.tolerance = 1e-10}.integrate(
///     y, 0.0, 10.0, [](double, const auto& at, auto& slope) { slope = {at[1], -std::sin(at[0])}; });
/// ```
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <type_traits>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// y(t + h) of y' = slope(t, y). Slopes are added to one another and multiplied by numbers from the left;
/// move(y, d) is y moved by the step d, y + d where none is given: for what is no vector, the way along a
/// chart at y. The error of one step falls as h^5.
template <class Y, class S, class Slope, class Move = std::plus<>>
[[nodiscard]] Y runge_kutta_4(const Y& y, S t, S h, const Slope& slope, const Move& move = {}) {
  using Rate = std::remove_cvref_t<decltype(slope(t, y))>;
  const S half = h / S(2);
  const Rate k1 = slope(t, y);
  const Rate k2 = slope(t + half, Y(move(y, Rate(half * k1))));
  const Rate k3 = slope(t + half, Y(move(y, Rate(half * k2))));
  const Rate k4 = slope(t + h, Y(move(y, Rate(h * k3))));
  return move(y, Rate(h / S(6) * Rate(Rate(k1 + S(2) * Rate(k2 + k3)) + k4)));
}

/// How an integration ended.
struct [[nodiscard]] OdeResult {
  bool arrived = false;  ///< at the end; else the steps ran out, or none was short enough
  double time = 0.0;     ///< how far it came; the end itself where it arrived
  int steps = 0;         ///< tried, those that were too long included
};

/// Integrates with step control, forwards or backwards in time. Options only.
struct DormandPrince {
  double tolerance = 1e-8;  ///< of the error of one step, in units of `scales`; > 0
  int most_steps = 100000;  ///< tried; >= 1
  double first_step = 0.0;  ///< length of the first step tried; 0: a sixteenth of the way

  /// Takes y from t to end along slope(t, y, k), which writes y' into k, of the size of y, and may return
  /// false to say that there is none. y is anything with size() and y[i]. scales(y) gives the sizes that
  /// errors of the y[i] are compared with; without it they are 1. What did not arrive stays where it came to.
  /// Bad options, and times that are not finite, do not arrive. O(7 size) and 6 slopes a step.
  template <class Y, class Slope, class Scales>
  OdeResult integrate(Y& y, double t, double end, Slope&& slope, Scales&& scales) const;
  template <class Y, class Slope>
  OdeResult integrate(Y& y, double t, double end, Slope&& slope) const {
    return integrate(y, t, end, slope, [](const Y& at) {
      Y ones = at;
      for (auto& one : ones) one = 1;
      return ones;
    });
  }
};

template <class Y, class Slope, class Scales>
OdeResult DormandPrince::integrate(Y& y, double t, double end, Slope&& slope, Scales&& scales) const {
  using Size = std::remove_cvref_t<decltype(y.size())>;
  using S = std::remove_cvref_t<decltype(y[Size(0)])>;
  static constexpr double c[7] = {0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1, 1};
  static constexpr double a[7][6] = {
      {},
      {1.0 / 5},
      {3.0 / 40, 9.0 / 40},
      {44.0 / 45, -56.0 / 15, 32.0 / 9},
      {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
      {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
      {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
  // Between the results of orders 5 and 4.
  static constexpr double difference[7] = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                                           -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
  constexpr double farthest = std::numeric_limits<double>::max();
  OdeResult result{false, t, 0};
  if (!(std::abs(t) <= farthest) || !(std::abs(end) <= farthest) || !(tolerance > 0.0)) return result;
  result.arrived = t == end;
  if (result.arrived) return result;
  const auto found = [&](double time, const Y& at, Y& k) {
    if constexpr (std::is_void_v<decltype(slope(time, at, k))>) {
      slope(time, at, k);
      return true;
    } else {
      return static_cast<bool>(slope(time, at, k));
    }
  };
  const Size n = y.size();
  std::array<Y, 7> k;
  k.fill(y);
  if (!found(t, y, k[0])) return result;
  double step = first_step > 0.0 ? std::copysign(first_step, end - t) : (end - t) / 16.0;
  while (result.steps < most_steps) {
    ++result.steps;
    const bool last = !(std::abs(step) < std::abs(end - t));
    if (last) step = end - t;
    Y next = y;
    bool good = true;
    for (std::size_t stage = 1; stage < 7 && good; ++stage) {
      next = y;
      for (std::size_t j = 0; j < stage; ++j)
        for (Size i = 0; i < n; ++i) next[i] += static_cast<S>(step * a[stage][j]) * k[j][i];
      good = found(t + c[stage] * step, next, k[stage]);
    }
    double worst = 1e3;
    if (good) {
      const auto scale = scales(y);
      worst = 0.0;
      for (Size i = 0; i < n; ++i) {
        double error = 0;
        for (std::size_t j = 0; j < 7; ++j) error += step * difference[j] * static_cast<double>(k[j][i]);
        const double share = std::abs(error) / (static_cast<double>(scale[i]) * tolerance);
        worst = std::max(worst, share < 1e4 ? share : 1e4);  // NaN too is a step too long
      }
    }
    if (worst <= 1.0) {
      t = last ? end : t + step;
      result.time = t;
      y = next;
      k[0] = k[6];  // the last stage is the first of the next step
      result.arrived = last;
      if (last) break;
    }
    step *= std::clamp(0.9 * std::pow(std::max(worst, 1e-10), -0.2), 0.2, 5.0);
    if (!(std::abs(step) > 1e-14 * std::max(std::abs(t), std::abs(end)))) break;
  }
  return result;
}

}}  // namespace cairn::CAIRN_ABI
