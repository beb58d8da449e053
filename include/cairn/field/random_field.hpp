// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A Gaussian random field with correlation R(d) = sigma^2 exp(-alpha^2 |d|^2): the synthetic ground of
/// correlation navigation.
///
/// White noise averaged with the weights exp(-2 alpha^2 |d|^2) has this correlation: the weights convolved
/// with themselves are proportional to it. The average is separable and needs no FFT, so the field does not
/// repeat at its rim.
///   correlation radius    rho = sqrt(pi) / alpha                                          (1)
///   spectral density      S(k) = sigma^2 (pi / alpha^2) exp(-|k|^2 / (4 alpha^2))         (2)
///   variance of a slope   2 alpha^2 sigma^2 along any axis                                (3)
/// (M. P. Muhina, A. A. Chechyna, "Algorithm of simultaneous localization and mapping based on visual
/// presentation of navigation information".)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/field/gaussian_blur.hpp>
#include <cairn/field/grid.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The law of a Gaussian random field.
struct RandomField {
  double sigma = 1;  ///< standard deviation of the value
  double alpha = 1;  ///< [1/m]; correlation falls to 1/e at distance 1/alpha

  [[nodiscard]] double correlation(double distance) const noexcept {
    return sigma * sigma * std::exp(-alpha * alpha * distance * distance);
  }
  [[nodiscard]] double correlation_radius() const noexcept {  // (1)
    return std::sqrt(std::numbers::pi) / alpha;
  }
  /// At wave number `k` [rad/m], for spectra with R(0) = integral of S over the plane / (2 pi)^2.
  [[nodiscard]] double spectrum(double k) const noexcept {  // (2)
    return sigma * sigma * std::numbers::pi / (alpha * alpha) * std::exp(-k * k / (4.0 * alpha * alpha));
  }
  [[nodiscard]] double slope_variance() const noexcept { return 2.0 * alpha * alpha * sigma * sigma; }  // (3)

  /// A draw on a grid. Stationary up to the rim; the same random state gives the same field. Spacings should
  /// be a fraction of 1 / alpha. Throws Error where they are less than a 200,000th of it. O(n / (alpha *
  /// spacing)) for n nodes, those that lie within 4 / alpha around the grid among them.
  [[nodiscard]] FieldGrid draw(int columns, int rows, const GridFrame& frame, Random& random) const;
};

inline FieldGrid RandomField::draw(int columns, int rows, const GridFrame& frame, Random& random) const {
  CAIRN_EXPECTS(sigma >= 0.0 && alpha > 0.0 && std::isfinite(sigma + alpha),
                "a random field needs sigma >= 0 and alpha > 0");
  const double blur = 0.5 / alpha;  // exp(-2 alpha^2 d^2) as a Gaussian
  constexpr int most = 1 << 20;     // weights: out of reach within the bound on the spacings
  if (!(blur <= 1e5 * std::min(frame.dx, frame.dy)))
    raise("RandomField: expected spacings of at least a 200,000th of 1 / alpha");
  const std::vector<double> along_x = detail::half_gaussian(blur / frame.dx, most);
  const std::vector<double> along_y = detail::half_gaussian(blur / frame.dy, most);
  const int rim_x = static_cast<int>(along_x.size()) - 1, rim_y = static_cast<int>(along_y.size()) - 1;
  FieldGrid noise(columns + 2 * rim_x, rows + 2 * rim_y, frame);
  for (double& value : noise.values()) value = random.normal();
  detail::blur_grid(noise, along_x, along_y);
  const auto squares = [](const std::vector<double>& half) {
    double sum = half[0] * half[0];
    for (std::size_t i = 1; i < half.size(); ++i) sum += 2.0 * half[i] * half[i];
    return sum;
  };
  const double scale = sigma / std::sqrt(squares(along_x) * squares(along_y));
  FieldGrid field(columns, rows, frame);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) field(c, r) = scale * noise(c + rim_x, r + rim_y);
  return field;
}

}}  // namespace cairn::CAIRN_ABI
