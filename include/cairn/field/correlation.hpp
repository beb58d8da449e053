// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where on the map was this patch seen? Search by normalised cross-correlation, with a figure of confidence.
///
/// The map is sampled on a lattice with the sensor's own spacing and heading, which makes the patch a
/// rectangle of it; at every shift p
///   c(p) = sum (f_p - mean f_p)(z - mean z) / (n s_f s_z)                                        (1)
/// over the samples inside the map (correlation_surface.hpp). Gain and bias of the sensor cancel. A bank of
/// headings and scales is searched by keeping the best at each shift.
///
/// Confidence. The share of the patch's variance that a place leaves unexplained is 1 - c^2; the contrast
///   (1 - c_second^2) / (1 - c_best^2)                                                            (2)
/// compares the best place with the best one elsewhere, an F ratio of residual variances. Smooth terrain
/// resembles itself everywhere, so that a peak-to-sidelobe ratio (reported as well) says little. A place is
/// accepted in one of two ways:
///   - the contrast is large whatever the residuals look like; or
///   - the residuals at the place are white, as a sensor's noise is and as the difference of two pieces of
///     ground is not, and the samples together make the second place unlikely: (n / 2) log(contrast) nats.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/field/correlation_surface.hpp>
#include <cairn/field/fft.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// What a search concludes.
enum class FixVerdict {
  accepted,
  flat_patch,  ///< the patch has no variance (or numbers that are not finite): it could be anywhere
  flat_map,    ///< no place in the region has enough variance and enough samples inside the map
  weak,        ///< the best place does not resemble the patch
  ambiguous,   ///< another place resembles it nearly as well
  at_rim,      ///< the best place lies on the rim of the region: the true one may lie outside
};

struct SearchOptions {
  double radius = 1000;               ///< half side of the square region of shifts, > 0 [m]
  std::vector<double> headings{0.0};  ///< offsets added to the heading of the guess [rad]
  std::vector<double> scales{1.0};    ///< factors on both scales of the guess
  double exclusion = 5;               ///< samples around the best peak that are the peak itself
  double smallest_share = 0.75;       ///< of the patch's samples that must lie inside the map
  double weakest_peak = 0.4;          ///< smallest correlation to accept
  double large_contrast = 3.0;        ///< of (2): accepted whatever the residuals
  double smallest_gain = 20.0;  ///< (n / 2) log(contrast) to accept where the residuals are white [nats]
  double white_below = 0.3;     ///< largest correlation of neighbouring residuals that counts as white
};

/// The best place for a patch, its figures of confidence, and whether to believe it.
struct Fix {
  FixVerdict verdict = FixVerdict::flat_map;
  PatchPlacement placement;                  ///< of the best place, refined below the spacing of the samples
  double peak = 0;                           ///< correlation there, -1..1
  double second = 0;                         ///< best correlation elsewhere
  double contrast = 0;                       ///< (2)
  double likelihood_gain = 0;                ///< (n / 2) log(contrast) [nats]
  double residual_correlation = 1;           ///< of neighbouring samples, at the place; 0 for white noise
  double peak_to_sidelobe = 0;               ///< (peak - mean elsewhere) / standard deviation elsewhere
  std::size_t heading = 0, scale = 0;        ///< index into the options' bank
  Matrix<2> covariance = Matrix<2>::Zero();  ///< of (x, y) for noise that is white over the samples [m^2]

  [[nodiscard]] bool accepted() const noexcept { return verdict == FixVerdict::accepted; }
};

namespace detail {

/// Best place of a bank of headings and scales: the surface it was found on, and the best of all surfaces.
struct BankPeak {
  Plane surface, all;
  double peak = nothing;
  int column = 0, row = 0;
  PatchPlacement placement;  // of the member, at the guess
};

inline PatchPlacement turned(const PatchPlacement& p, double angle, double scale) noexcept {
  const double c = scale * std::cos(angle), s = scale * std::sin(angle);
  return {p.x,
          p.y,
          c * p.along_x - s * p.along_y,
          s * p.along_x + c * p.along_y,
          c * p.across_x - s * p.across_y,
          s * p.across_x + c * p.across_y};
}

/// Figures of confidence of the best place of a surface, which lies at (column, row).
inline void judge(Fix& fix, const Plane& surface, int column, int row, double exclusion) {
  double sum = 0, squares = 0, count = 0;
  fix.second = -1.0;
  for (int r = 0; r < surface.rows; ++r)
    for (int c = 0; c < surface.columns; ++c) {
      const double v = surface(c, r);
      if (v == nothing || std::hypot(c - column, r - row) <= exclusion) continue;
      fix.second = std::max(fix.second, v);
      sum += v;
      squares += v * v;
      count += 1.0;
    }
  const double mean = count > 0.0 ? sum / count : 0.0;
  const double deviation = count > 1.0 ? std::sqrt(std::max(squares / count - mean * mean, 1e-12)) : 1.0;
  fix.peak_to_sidelobe = (fix.peak - mean) / deviation;
  const double elsewhere = std::max(fix.second, 0.0);
  fix.contrast = (1.0 - elsewhere * elsewhere) / std::max(1.0 - fix.peak * fix.peak, 1e-12);
}

template <FieldInterpolant Map>
BankPeak search_bank(const Map& map, const PatchShape& shape, const Plane& patch, const PatchPlacement& guess,
                     const SearchOptions& options, int reach_along, int reach_across, Fix& fix) {
  BankPeak best;
  best.all = Plane(2 * reach_along + 1, 2 * reach_across + 1, nothing);
  for (std::size_t h = 0; h < options.headings.size(); ++h)
    for (std::size_t s = 0; s < options.scales.size(); ++s) {
      const PatchPlacement placement = turned(guess, options.headings[h], options.scales[s]);
      Plane surface = correlation_surface(map_window(map, shape, placement, reach_along, reach_across), patch,
                                          options.smallest_share);
      for (std::size_t i = 0; i < surface.values.size(); ++i)
        best.all.values[i] = std::max(best.all.values[i], surface.values[i]);
      const auto top = std::max_element(surface.values.begin(), surface.values.end());
      if (!(*top > best.peak)) continue;
      best.peak = *top;
      const auto index = static_cast<int>(top - surface.values.begin());
      best.column = index % surface.columns;
      best.row = index / surface.columns;
      fix.heading = h;
      fix.scale = s;
      best.placement = placement;
      best.surface = std::move(surface);
    }
  return best;
}

/// Moves the fix to the vertex of the paraboloid over the peak and gives it its covariance. False on the rim.
inline bool refine(Fix& fix, const BankPeak& best, int reach_along, int reach_across, std::size_t samples) {
  const bool interior = best.column > 0 && best.row > 0 && best.column + 1 < best.surface.columns &&
                        best.row + 1 < best.surface.rows;
  Vector<2> vertex = Vector<2>::Zero();
  Matrix<2> hessian;
  double height = best.peak;
  const bool refined = interior && paraboloid(best.surface, best.column, best.row, vertex, height, hessian);
  if (!refined) vertex.setZero();
  fix.peak = refined ? std::clamp(std::max(height, best.peak), -1.0, 1.0) : best.peak;
  Matrix<2> steps;  // ground per column and per row of the surface
  steps << best.placement.along_x, -best.placement.across_x, best.placement.along_y, -best.placement.across_y;
  const Vector<2> shift = steps * (Vector<2>(best.column - reach_along, best.row - reach_across) + vertex);
  fix.placement = best.placement;
  fix.placement.x += shift(0);
  fix.placement.y += shift(1);
  if (!refined) return false;
  // Information of a shift: -n c c'' / (1 - c^2), from the curvature of the sum of squared residuals.
  const double unexplained = std::max(1.0 - fix.peak * fix.peak, 1e-12);
  const Matrix<2> information = -(static_cast<double>(samples) * fix.peak / unexplained) * hessian;
  fix.covariance = symmetrised(steps * information.llt().solve(Matrix<2>(steps.transpose())));
  return true;
}

/// Correlation of neighbouring residuals z - (gain f + bias) with gain and bias fitted at the placement; 1
/// when there is nothing to fit or no residual.
template <FieldInterpolant Map>
double neighbour_correlation(const Map& map, const PatchShape& shape, std::span<const double> z,
                             const PatchPlacement& at) {
  PatchSamples f;
  sample_patch(map, shape, at, f);
  double n = 0, sf = 0, sz = 0, sff = 0, sfz = 0;
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (f.inside[i] == 0) continue;
    n += 1.0;
    sf += f.value[i];
    sz += z[i];
  }
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (f.inside[i] == 0) continue;
    sff += (f.value[i] - sf / n) * (f.value[i] - sf / n);
    sfz += (f.value[i] - sf / n) * (z[i] - sz / n);
  }
  if (!(sff > 0.0)) return 1.0;
  const auto residual = [&](std::size_t i) { return z[i] - sz / n - sfz / sff * (f.value[i] - sf / n); };
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
  return squares > 0.0 && pairs > 0.0 ? products / pairs / (squares / n) : 1.0;
}

inline FixVerdict verdict_of(const Fix& fix, bool refined, const SearchOptions& options) noexcept {
  if (fix.peak < options.weakest_peak) return FixVerdict::weak;
  if (!refined) return FixVerdict::at_rim;
  const bool white = std::abs(fix.residual_correlation) < options.white_below;
  const bool certain =
      fix.contrast >= options.large_contrast || (white && fix.likelihood_gain >= options.smallest_gain);
  return certain ? FixVerdict::accepted : FixVerdict::ambiguous;
}

}  // namespace detail

/// Searches the square of shifts around the guess (whose steps carry the assumed scales and heading) for the
/// place where the map resembles `z` best. z has shape.size() finite numbers. One surface costs O(n log n)
/// with n the samples of region and patch; one surface a member of the bank.
template <FieldInterpolant Map>
[[nodiscard]] Fix correlation_search(const Map& map, const PatchShape& shape, std::span<const double> z,
                                     const PatchPlacement& guess, const SearchOptions& options = {}) {
  CAIRN_EXPECTS(z.size() == shape.size(), "correlation_search needs one number a sample of the patch");
  CAIRN_EXPECTS(options.radius > 0.0 && !options.headings.empty() && !options.scales.empty(),
                "correlation_search needs a positive radius and a bank of at least one heading and scale");
  Fix fix;
  fix.placement = guess;
  const Plane patch = detail::centred_patch(shape, z);
  if (patch.values.empty()) {
    fix.verdict = FixVerdict::flat_patch;
    return fix;
  }
  const auto reach = [&](double x, double y) {
    const double samples = options.radius / std::hypot(x, y);
    CAIRN_EXPECTS(samples < 20000.0, "correlation_search needs steps that are not tiny beside the radius");
    return static_cast<int>(std::ceil(samples));
  };
  const int along = reach(guess.along_x, guess.along_y), across = reach(guess.across_x, guess.across_y);
  const detail::BankPeak best = detail::search_bank(map, shape, patch, guess, options, along, across, fix);
  if (best.peak == detail::nothing) return fix;  // flat_map
  const bool refined = detail::refine(fix, best, along, across, z.size());
  detail::judge(fix, best.all, best.column, best.row, options.exclusion);
  fix.likelihood_gain = 0.5 * static_cast<double>(z.size()) * std::log(fix.contrast);
  fix.residual_correlation = detail::neighbour_correlation(map, shape, z, fix.placement);
  fix.verdict = detail::verdict_of(fix, refined, options);
  return fix;
}

}  // namespace cairn::inline CAIRN_ABI
