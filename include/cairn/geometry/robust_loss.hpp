// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What large residuals count in a refinement.
#pragma once

#include <cmath>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Weight of a residual of size x = chi / scale in the refinement.
enum class RobustLoss {
  none,   ///< 1
  huber,  ///< 1 below x = 1, then 1 / x
  cauchy  ///< 1 / (1 + x^2)
};

/// Weight of a match with this chi^2 in the refinement; scale in standard deviations.
[[nodiscard]] inline double robust_weight(RobustLoss loss, double scale, double chi_squared) noexcept {
  const double x_squared = chi_squared / (scale * scale);
  switch (loss) {
    case RobustLoss::huber:
      return x_squared <= 1 ? 1 : 1 / std::sqrt(x_squared);
    case RobustLoss::cauchy:
      return 1 / (1 + x_squared);
    case RobustLoss::none:
      break;
  }
  return 1;
}

/// What the loss and the gate leave of the information of matches whose residuals have `dof` Gaussian
/// coordinates u: with psi = w(|u|) u inside the gate, the estimate's covariance is alpha / beta^2 times the
/// inverse information of all good matches, alpha = E[w^2 |u|^2] / dof, beta = E[w |u|^2] / dof (P. Huber,
/// "Robust Statistics", 1981, chapter 6; beta by Stein's lemma). Relative to the matches inside the gate.
[[nodiscard]] inline double robust_efficiency(RobustLoss loss, double scale, double gate_probability,
                                              double gate, int dof) noexcept {
  double alpha = 0, beta = 0, kept = 0;
  constexpr int parts = 64;  // midpoint rule in |u|
  const double width = std::sqrt(gate) / parts;
  for (int i = 0; i < parts; ++i) {
    const double u = (i + 0.5) * width, squared = u * u;
    const double density = std::pow(u, dof - 1) * std::exp(-0.5 * squared);
    const double w = robust_weight(loss, scale, squared);
    kept += density;
    alpha += density * w * w * squared / dof;
    beta += density * w * squared / dof;
  }
  const double share = gate_probability / kept;  // turns sums into expectations
  return beta * beta * share / (alpha * gate_probability);
}

}}  // namespace cairn::CAIRN_ABI
