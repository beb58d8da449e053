// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How many independent beams a scan's beams are worth, from what they missed.
///
///   n_eff / n = 1 / (1 + 2 sum_k rho_k)
/// with rho_k the correlation of residuals k beams apart: the variance of a mean of correlated numbers over
/// that of independent ones. (M. Priestley, "Spectral Analysis and Time Series", 1981, sec. 5.3.2.) Lags are
/// added in pairs until a pair's sum is no longer positive, for beyond it there is noise alone (C. Geyer,
/// "Practical Markov chain Monte Carlo", Statistical Science 7, 1992, sec. 3.3).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The share of beams that are worth an independent one, in (0, 1]: what EndPointModel::independence wants to
/// know. `scans` are lists of residuals [m] in the order of the beams, each of mean zero under the model.
/// Nothing where all residuals are zero, one is no number, or no scan has two. O(n * lags).
template <class Scans>
[[nodiscard]] std::optional<double> independence_of(const Scans& scans) {
  std::size_t longest = 0;
  for (const auto& scan : scans) longest = std::max(longest, std::size_t{std::size(scan)});
  const auto covariance = [&](std::size_t lag) {
    double sum = 0;
    std::size_t pairs = 0;
    for (const auto& scan : scans)
      for (std::size_t i = lag; i < std::size(scan); ++i, ++pairs) sum += scan[i] * scan[i - lag];
    return pairs == 0 ? 0 : sum / static_cast<double>(pairs);
  };
  const double variance = covariance(0);
  if (longest < 2 || !(variance > 0) || !std::isfinite(variance)) return std::nullopt;
  // Lags 0 and 1, 2 and 3, ...; the sum over all lags to either side is twice theirs less lag 0.
  double sum = 0;
  for (std::size_t lag = 0; lag < longest; lag += 2) {
    const double pair = (covariance(lag) + covariance(lag + 1)) / variance;
    if (!(pair > 0)) break;
    sum += pair;
  }
  return std::min(1.0, 1 / std::max(1e-12, 2 * sum - 1));
}

}}  // namespace cairn::CAIRN_ABI
