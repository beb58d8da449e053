// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where on the map was this patch seen? Search by normalised cross-correlation, with a figure of confidence.
///
/// The map is sampled on a lattice with the sensor's own spacing and heading, which makes the patch a
/// rectangle of it; at every shift p
///   c(p) = sum (f_p - mean f_p)(z - mean z) / (n s_f s_z)                                        (1)
/// (correlation_surface.hpp). Gain and bias of the sensor cancel. A bank of
/// headings and scales is searched by keeping the best at each shift.
///
/// Fix. The best shift is refined by least squares on the map itself (correlation_refinement.hpp), which also
/// gives the covariance.
///
/// Confidence. With white noise of unknown variance a shift p has the likelihood (1 - c(p)^2)^(-n/2), n the
/// samples that are independent. The log odds of the best place are those of the shifts around it against all
/// others together and against its being none of them:
///   log sum_near L(p) - log(sum_far L(p) + number of shifts)                                    (2)
/// That is a probability only where what is left of the frame at the place is white, as a sensor's noise is
/// and the difference of two pieces of ground is not. A place is accepted in one of two ways:
///   - the residuals are white, and the odds are large; or
///   - whatever the residuals, the share of variance left unexplained, 1 - c^2, is far larger elsewhere
///     (the contrast, an F ratio).
/// The best place is refined before it is judged, so the best of the others are refined too: on ground that
/// repeats itself (dunes, terraces, a plantation) they are as good once they are, and bound odds and
/// contrast. Smooth terrain resembles itself everywhere: a peak-to-sidelobe ratio (reported as well) says
/// little.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/field/detail/correlation_refinement.hpp>
#include <cairn/field/detail/correlation_surface.hpp>
#include <cairn/field/detail/fft.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What a search concludes.
enum class FixVerdict {
  accepted,
  flat_patch,  ///< the patch has no variance (or numbers that are not finite): it could be anywhere
  flat_map,    ///< no place in the region has enough variance and enough samples inside the map
  weak,        ///< the best place does not resemble the patch
  ambiguous,   ///< other places resemble it nearly as well
  imprecise,   ///< the place is known along one direction and not along the other: a slope, a ridge
  at_rim,      ///< the best place lies on the rim of the region: the true one may lie outside
};

/// The verdict as a sentence for a log.
[[nodiscard]] constexpr const char* explain(FixVerdict verdict) noexcept {
  switch (verdict) {
    case FixVerdict::accepted:
      return "accepted";
    case FixVerdict::flat_patch:
      return "no fix: the patch has no variance, or numbers that are not finite";
    case FixVerdict::flat_map:
      return "no fix: the map in the region has too little variance or too few samples";
    case FixVerdict::weak:
      return "no fix: the best place does not resemble the patch";
    case FixVerdict::ambiguous:
      return "no fix: other places resemble the patch nearly as well";
    case FixVerdict::imprecise:
      return "no fix: the place is known along one direction alone";
    case FixVerdict::at_rim:
      return "no fix: the best place lies on the rim of the region";
  }
  return "unknown verdict";
}

struct CorrelationSearchOptions {
  double radius = 1000;               ///< half side of the square region of shifts, > 0 [m]
  std::vector<double> headings{0.0};  ///< offsets added to the heading of the guess [rad]
  std::vector<double> scales{1.0};    ///< factors on both scales of the guess
  double scale_sigma = 0;             ///< of the guess's scales, relative: refined together with the place
  double heading_sigma = 0;           ///< of the guess's heading [rad]: the same
  double exclusion = 5;               ///< samples around the best peak that are the peak itself
  double smallest_share = 0.75;       ///< of the patch's samples that must lie inside the map
  double weakest_peak = 0.2;          ///< smallest correlation to accept
  double smallest_log_odds = 7;       ///< of (2), to accept where the residuals are white: a thousand to one
  double white_below = 0.3;           ///< largest correlation of neighbouring residuals that counts as white
  double large_contrast = 3.0;        ///< accepted whatever the residuals
  double largest_sigma = 0.5;         ///< of a place that is accepted, along its worst direction [samples]
};

/// The best place for a patch, its figures of confidence, and whether to believe it.
struct Fix {
  FixVerdict verdict = FixVerdict::flat_map;
  PatchPlacement placement;                  ///< of the best place, refined below the spacing of the samples
  double peak = 0;                           ///< correlation there, -1..1
  double second = 0;                         ///< best correlation elsewhere, refined as well
  double contrast = 0;                       ///< (1 - second^2) / (1 - peak^2)
  double log_odds = 0;                       ///< (2) [nats]
  double residual_correlation = 1;           ///< of neighbouring samples, at the place; 0 for white noise
  double peak_to_sidelobe = 0;               ///< (peak - mean elsewhere) / standard deviation elsewhere
  std::size_t heading = 0, scale = 0;        ///< index into the options' bank
  Matrix<2> covariance = Matrix<2>::Zero();  ///< of (x, y); zero where the place could not be refined [m^2]

  [[nodiscard]] bool accepted() const noexcept { return verdict == FixVerdict::accepted; }
};

namespace detail {

/// Best place of a bank of headings and scales: the surface it was found on, and the best of all surfaces.
struct BankPeak {
  Plane surface, all;
  std::vector<std::size_t> member;         // of the bank, that `all` is of
  std::vector<PatchPlacement> placements;  // of the members, at the guess
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

/// The share of variance that a correlation leaves.
inline double unexplained(double c) noexcept {
  return std::max(1.0 - std::max(c, 0.0) * c, 1e-12);
}

/// Figures of confidence of the best place of a surface, which lies at (column, row); `samples` is n of (2).
inline void judge(Fix& fix, const Plane& surface, int column, int row, double exclusion, double samples) {
  const double best = unexplained(surface(column, row));
  const double negligible = best * std::exp(80.0 / samples);  // beyond it a place has less than e^-40
  const auto beside = [exclusion](int d) { return std::abs(d) <= exclusion; };
  double near = 0, far = 0, places = 0;  // likelihoods relative to the best place's
  // Of the places elsewhere, their values less the peak: no division for each, as RunningMoments has.
  double count = 0, sum = 0, squares = 0;
  fix.second = -1.0;
  for (int r = 0; r < surface.rows; ++r)
    for (int c = 0; c < surface.columns; ++c) {
      const double v = surface(c, r);
      if (v == nothing) continue;
      places += 1.0;
      const bool is_near =
          beside(r - row) && beside(c - column) && std::hypot(c - column, r - row) <= exclusion;
      const double left = unexplained(v);
      if (left < negligible) (is_near ? near : far) += std::pow(best / left, 0.5 * samples);
      if (is_near) continue;
      fix.second = std::max(fix.second, v);
      count += 1.0;
      sum += v - fix.peak;
      squares += (v - fix.peak) * (v - fix.peak);
    }
  const double nowhere = places * std::pow(best, 0.5 * samples);
  fix.log_odds = std::log(near / std::max(far + nowhere, 1e-300));  // (2)
  const double below = count > 0.0 ? -sum / count : fix.peak;
  const double variance =
      count > 1.0 ? std::max((squares - count * below * below) / (count - 1.0), 1e-12) : 1.0;
  fix.peak_to_sidelobe = below / std::sqrt(variance);
  fix.contrast = unexplained(fix.second) / unexplained(fix.peak);
}

template <FieldInterpolant Map>
BankPeak search_bank(const Map& map, const PatchShape& shape, const Plane& patch, const PatchPlacement& guess,
                     const CorrelationSearchOptions& options, int reach_along, int reach_across, Fix& fix) {
  BankPeak best;
  best.all = Plane(2 * reach_along + 1, 2 * reach_across + 1, nothing);
  best.member.resize(best.all.values.size());
  for (std::size_t h = 0; h < options.headings.size(); ++h)
    for (std::size_t s = 0; s < options.scales.size(); ++s) {
      const PatchPlacement placement = turned(guess, options.headings[h], options.scales[s]);
      Plane surface = correlation_surface(map_window(map, shape, placement, reach_along, reach_across), patch,
                                          options.smallest_share);
      for (std::size_t i = 0; i < surface.values.size(); ++i) {
        if (!(surface.values[i] > best.all.values[i])) continue;
        best.all.values[i] = surface.values[i];
        best.member[i] = best.placements.size();
      }
      best.placements.push_back(placement);
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

/// The shorter step of a placement.
inline double sample_spacing(const PatchPlacement& p) noexcept {
  return std::min(std::hypot(p.along_x, p.along_y), std::hypot(p.across_x, p.across_y));
}

/// A placement moved by so many of its own steps.
inline PatchPlacement shifted(PatchPlacement p, double along, double across) noexcept {
  p.x += along * p.along_x + across * p.across_x;
  p.y += along * p.along_y + across * p.across_y;
  return p;
}

inline double distance(const PatchPlacement& a, const PatchPlacement& b) noexcept {
  return std::hypot(a.x - b.x, a.y - b.y);
}

/// Refines the place on the map itself, where it does not lie on the rim of the region and the frame tells.
template <FieldInterpolant Map>
void refine(Fix& fix, const Map& map, const PatchShape& shape, std::span<const double> z,
            const BankPeak& best, int reach_along, int reach_across, bool interior,
            const CorrelationSearchOptions& options) {
  double a = best.column - reach_along, b = reach_across - best.row;  // samples from the guess
  if (interior) {
    const Vector<2> vertex = paraboloid_vertex(best.surface, best.column, best.row);
    a += vertex(0);
    b -= vertex(1);
  }
  fix.placement = shifted(best.placement, a, b);
  if (!interior) return;
  const auto refined = refined_placement(map, shape, z, fix.placement, options.scale_sigma,
                                         options.heading_sigma, options.smallest_share);
  if (!refined) return;
  if (!(distance(refined->placement, fix.placement) <= options.exclusion * sample_spacing(fix.placement)))
    return;
  fix.placement = refined->placement;
  fix.covariance = refined->covariance;
}

/// Holds the best places elsewhere, each refined, against the one that was found. A place that lies between
/// samples seems worse than one that lies on them; the smoother the ground and the more samples, the less of
/// that it takes to look like certainty.
template <FieldInterpolant Map>
void judge_by_others(Fix& fix, const Map& map, const PatchShape& shape, std::span<const double> z,
                     const BankPeak& best, double samples, const CorrelationSearchOptions& options) {
  constexpr int others = 3;  // a lattice of equal hills has four around each
  const double beside = options.exclusion * sample_spacing(fix.placement);
  const Plane& all = best.all;
  std::vector<std::pair<int, int>> taken{{best.column, best.row}};
  for (int k = 0; k < others; ++k) {
    double most = nothing;
    std::pair<int, int> place;
    for (int r = 0; r < all.rows; ++r)
      for (int c = 0; c < all.columns; ++c)
        if (all(c, r) > most && std::ranges::none_of(taken, [&](const std::pair<int, int>& t) {
              return std::hypot(c - t.first, r - t.second) <= options.exclusion;
            })) {
          most = all(c, r);
          place = {c, r};
        }
    if (most == nothing) return;
    taken.push_back(place);
    const auto [c, r] = place;
    const std::size_t member = best.member[static_cast<std::size_t>(r * all.columns + c)];
    const PatchPlacement start = shifted(best.placements[member], c - all.columns / 2, all.rows / 2 - r);
    const auto refined = refined_placement(map, shape, z, start, options.scale_sigma, options.heading_sigma,
                                           options.smallest_share);
    // One that stands on the slope of the place that was found is led to that one's top.
    if (!refined || distance(refined->placement, fix.placement) <= beside) continue;
    fix.second = std::max(fix.second, patch_agreement(map, shape, z, refined->placement).correlation);
  }
  fix.contrast = unexplained(fix.second) / unexplained(fix.peak);
  fix.log_odds = std::min(fix.log_odds, 0.5 * samples * std::log(fix.contrast));
}

/// The larger standard deviation of a place, in samples.
inline double worst_sigma(const Fix& fix) {
  const Matrix<2>& c = fix.covariance;
  const double largest = 0.5 * (c(0, 0) + c(1, 1)) + std::hypot(0.5 * (c(0, 0) - c(1, 1)), c(0, 1));
  return std::sqrt(largest) / sample_spacing(fix.placement);
}

inline FixVerdict verdict_of(const Fix& fix, bool interior, const CorrelationSearchOptions& options) {
  if (fix.peak < options.weakest_peak) return FixVerdict::weak;
  if (!interior) return FixVerdict::at_rim;
  const bool white = std::abs(fix.residual_correlation) < options.white_below;
  const bool certain =
      fix.contrast >= options.large_contrast || (white && fix.log_odds >= options.smallest_log_odds);
  if (!certain) return FixVerdict::ambiguous;
  const bool known = fix.covariance(0, 0) > 0.0 && worst_sigma(fix) <= options.largest_sigma;
  return known ? FixVerdict::accepted : FixVerdict::imprecise;
}

}  // namespace detail

/// Searches the square of shifts around the guess (whose steps carry the assumed scales and heading) for the
/// place where the map resembles `z` best. z has shape.size() finite numbers. One surface costs O(n log n)
/// with n the samples of region and patch; one surface a member of the bank.
template <FieldInterpolant Map>
[[nodiscard]] Fix correlation_search(const Map& map, const PatchShape& shape, std::span<const double> z,
                                     const PatchPlacement& guess,
                                     const CorrelationSearchOptions& options = {}) {
  CAIRN_EXPECTS(z.size() == shape.size(), "correlation_search needs one number a sample of the patch");
  CAIRN_EXPECTS(options.radius > 0.0 && !options.headings.empty() && !options.scales.empty(),
                "correlation_search needs a positive radius and a bank of at least one heading and scale");
  Fix fix;
  fix.placement = guess;
  const detail::Plane patch = detail::centred_patch(shape, z);
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
  const bool interior = best.column > 0 && best.row > 0 && best.column + 1 < best.surface.columns &&
                        best.row + 1 < best.surface.rows;
  detail::refine(fix, map, shape, z, best, along, across, interior, options);
  const detail::PatchAgreement agreement = detail::patch_agreement(map, shape, z, fix.placement);
  fix.peak = std::max(agreement.correlation, best.peak);
  fix.residual_correlation = agreement.residual_correlation;
  fix.covariance /= agreement.independent_share;
  const double samples = agreement.independent_share * static_cast<double>(z.size());
  detail::judge(fix, best.all, best.column, best.row, options.exclusion, samples);
  detail::judge_by_others(fix, map, shape, z, best, samples, options);
  fix.verdict = detail::verdict_of(fix, interior, options);
  return fix;
}

}}  // namespace cairn::CAIRN_ABI
