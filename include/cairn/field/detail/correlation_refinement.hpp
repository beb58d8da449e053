// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// From the best sample of a correlation surface to a fix: least squares on the map's interpolant, with the
/// covariance of the result.
///
/// With theta = (dx, dy, u) for the shift and u for the errors of scales and heading in their sigmas,
///   minimise n log |z - g f(theta) - d|^2 + |u|^2                                               (1)
/// over theta, the gain g and the bias d by Gauss-Newton steps: the most likely place for white noise of
/// unknown variance. The inverse of the last normal matrix is the covariance. Residuals that neighbours share
/// (an error of the map) make samples worth less than their number; with rho the correlation of neighbours,
/// beyond what chance makes of white noise, the effective number is taken for
///   n ((1 - rho) / (1 + rho))^2                                                                 (2)
/// as for a Markov sequence along both axes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/field/patch_gram.hpp>
#include <cairn/field/patch_noise.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// How the samples of a frame agree with the map at a placement, gain and bias fitted.
struct PatchAgreement {
  double correlation = 0;            ///< of frame and map, as on a correlation surface
  double residual_correlation = 1;   ///< of neighbouring residuals; 1 when nothing can be said
  double independent_share = 1e-12;  ///< (2), as a share of n
};

template <FieldInterpolant Map>
PatchAgreement patch_agreement(const Map& map, const PatchShape& shape, std::span<const double> z,
                               const PatchPlacement& at) {
  PatchSamples f;
  sample_patch(map, shape, at, f);
  const auto n = static_cast<double>(f.count_inside);
  double mean_f = 0, mean_z = 0, mean_all = 0, ff = 0, fz = 0, zz = 0;
  for (std::size_t i = 0; i < z.size(); ++i) {
    mean_f += f.value[i] / n;
    mean_z += f.inside[i] * z[i] / n;
    mean_all += z[i] / static_cast<double>(z.size());
  }
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double df = f.inside[i] * (f.value[i] - mean_f);
    ff += df * df;
    fz += df * (z[i] - mean_z);
    zz += (z[i] - mean_all) * (z[i] - mean_all);
  }
  PatchAgreement result;
  if (!(ff > 0.0 && zz > 0.0)) return result;
  result.correlation = std::clamp(fz / std::sqrt(ff * zz), -1.0, 1.0);
  const auto residual = [&](std::size_t i) { return z[i] - mean_z - fz / ff * (f.value[i] - mean_f); };
  const auto width = static_cast<std::size_t>(shape.along());
  double products = 0, squares = 0, pairs = 0;
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (f.inside[i] == 0) continue;
    const double r = residual(i);
    squares += r * r;
    for (const std::size_t j : {i + 1, i + width})
      if (j < z.size() && f.inside[j] != 0 && (j != i + 1 || j % width != 0)) {
        products += r * residual(j);
        pairs += 1.0;
      }
  }
  if (!(squares > 0.0 && pairs > 0.0)) return result;
  result.residual_correlation = products / pairs / (squares / n);
  const double rho = std::clamp(result.residual_correlation - 3.0 / std::sqrt(pairs), 0.0, 0.999);
  result.independent_share = std::pow((1.0 - rho) / (1.0 + rho), 2);  // (2)
  return result;
}

/// The placement moved by theta of (1), and its derivative by theta.
struct MovedPlacement {
  PatchPlacement placement;
  Matrix<6, 5> jacobian;
};

inline MovedPlacement moved(const PatchPlacement& p, const Vector<5>& theta, double scale_sigma,
                            double heading_sigma) {
  const double c = std::cos(heading_sigma * theta(4)), s = std::sin(heading_sigma * theta(4));
  const double along = 1.0 + scale_sigma * theta(2), across = 1.0 + scale_sigma * theta(3);
  const double ax = c * p.along_x - s * p.along_y, ay = s * p.along_x + c * p.along_y;
  const double bx = c * p.across_x - s * p.across_y, by = s * p.across_x + c * p.across_y;
  MovedPlacement result{{p.x + theta(0), p.y + theta(1), along * ax, along * ay, across * bx, across * by},
                        Matrix<6, 5>::Zero()};
  Matrix<6, 5>& J = result.jacobian;
  J(0, 0) = J(1, 1) = 1.0;
  J(2, 2) = scale_sigma * ax;
  J(3, 2) = scale_sigma * ay;
  J(4, 3) = scale_sigma * bx;
  J(5, 3) = scale_sigma * by;
  J(2, 4) = -heading_sigma * along * ay;
  J(3, 4) = heading_sigma * along * ax;
  J(4, 4) = -heading_sigma * across * by;
  J(5, 4) = heading_sigma * across * bx;
  return result;
}

/// The minimum of (1) near a placement.
struct RefinedPlacement {
  PatchPlacement placement;
  Matrix<2> covariance;  // of (x, y), for independent samples
};

/// Nothing when the frame leaves the map, or does not tell where along some direction it lies.
template <FieldInterpolant Map>
std::optional<RefinedPlacement> refined_placement(const Map& map, const PatchShape& shape,
                                                  std::span<const double> z, const PatchPlacement& start,
                                                  double scale_sigma, double heading_sigma, double share) {
  constexpr int most_steps = 12;
  constexpr double small = 1e-3;  // of the sigmas: a step that needs no successor
  const PatchNoise unit(1.0);
  const PatchLinearisation linearise{.free_gain = true, .smallest_share = share};
  PatchScratch scratch;
  PatchGram frame;
  Vector<5> theta = Vector<5>::Zero(), best = theta;
  std::optional<RefinedPlacement> result;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < most_steps; ++k) {
    const MovedPlacement at = moved(start, theta, scale_sigma, heading_sigma);
    const bool seen =
        linearise.gram(map, shape, at.placement, z, unit, scratch, frame) == PatchVerdict::accepted;
    const auto n = static_cast<double>(frame.samples);
    double cost = n * std::log(std::max(frame.squares, 1e-300));
    for (int i = 2; i < 5; ++i) cost += theta(i) * theta(i);
    if (!seen && k == 0) return std::nullopt;
    if (!seen || cost > least) {  // too far: half way back
      theta = 0.5 * (theta + best);
      continue;
    }
    least = cost;
    best = theta;
    // Of gain, bias and shift four numbers are fitted; a perfect frame is taken for one of double precision.
    const double variance = std::max(frame.squares / std::max(n - 4.0, 1.0), 1e-24 * frame.information(0, 0));
    Matrix<5> normal = frame.information_by(at.jacobian) / variance;
    Vector<5> gradient = frame.gradient_by(at.jacobian) / variance;
    for (int i = 2; i < 5; ++i) {
      normal(i, i) += 1.0;
      gradient(i) -= theta(i);
    }
    const Cholesky<5> factor(normal);
    if (!factor.good() || !(factor.least_share() > 1e-13)) return std::nullopt;
    const Vector<5> step = factor.solve(gradient);
    result = RefinedPlacement{at.placement, part_of<2, 2>(factor.inverse(), 0, 0)};
    if (step.dot(product(normal, step)) < small * small) break;
    theta += step;
  }
  return result;
}

}}}  // namespace cairn::CAIRN_ABI::detail
