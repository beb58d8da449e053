// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Corrects a belief with one frame of a mapped field: the iterated extended filter in information form.
///
/// Minimises (x - m)^T P^-1 (x - m) + (z - h(x))^T C^-1 (z - h(x)) by Gauss-Newton steps (one step is the
/// extended Kalman filter; B. Bell, F. Cathey, "The iterated Kalman filter update as a Gauss-Newton method",
/// IEEE T-AC 38(2), 1993). With P = L L^T and x = m + L u,
///   (I + L^T A L) u' = L^T (g + A L u),   A = H^T C^-1 H,   g = H^T C^-1 (z - h)             (1)
///   P' = L (I + L^T A L)^-1 L^T                                                              (2)
/// P is never inverted, and a frame without information (A = 0) leaves it as it was. A thousand samples cost
/// one Gram matrix of nine columns: the six of patch_model.hpp, one for a bias, h itself for a gain, z - h.
/// An unknown gain and bias, z = g h + d + noise with no prior, are eliminated from it exactly; H is then g
/// times the map's slope, with g as fitted at the point of linearisation.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/field/patch_noise.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// What became of a frame. Only `accepted` changes the belief.
enum class [[nodiscard]] PatchVerdict {
  accepted,
  flat,                   ///< the map has no slope under the frame, or no contrast to tell gain from bias
  outside,                ///< too few samples lie inside the map
  gated,                  ///< the residuals that are left are larger than the noise allows
  not_finite,             ///< NaN or infinity in the frame or the belief
  not_positive_definite,  ///< the belief's covariance
};

/// What a frame brought.
struct PatchUpdate {
  PatchVerdict verdict = PatchVerdict::flat;
  std::size_t samples = 0;  ///< inside the map
  int iterations = 0;       ///< linearisations
  double residual = 0;      ///< mean whitened square of z - h at the last linearisation: 1 when right
  double gain = 1;          ///< of the sensor, where free_gain
  double information = 0;   ///< trace of L^T A L: how much the frame says beside the prior
  [[nodiscard]] bool accepted() const noexcept { return verdict == PatchVerdict::accepted; }
};

/// Memory that updates reuse. One per thread.
struct PatchScratch {
  PatchSamples samples;
  Matrix<dynamic, 9> columns;
};

/// A frame linearised at a placement, gain and bias eliminated where asked for.
struct PatchGram {
  Matrix<6> information;  ///< of the placement's six numbers
  Vector<6> gradient;     ///< W^T C^-1 (z - h)
  double squares = 0;     ///< (z - h)^T C^-1 (z - h)
  double gain = 1;        ///< fitted where free_gain, otherwise 1
  std::size_t samples = 0;
};

/// Options of the correction; holds no state.
struct PatchFilter {
  int iterations = 4;           ///< most linearisations, >= 1; 1 is the extended Kalman filter
  double tolerance = 1e-2;      ///< stop after a step below this share of the posterior sigmas
  bool free_bias = false;       ///< eliminate an unknown bias of the sensor
  bool free_gain = false;       ///< eliminate an unknown gain (and the bias with it)
  double smallest_gain = 0.2;   ///< a fitted gain below it means that the sensor sees something else: gated
  double smallest_share = 0.5;  ///< of the samples that must lie inside the map
  double gate = std::numeric_limits<double>::infinity();  ///< of PatchUpdate::residual
  double smallest_information = 1e-9;                     ///< of PatchUpdate::information, below it: flat

  /// The frame's Gram matrix at a placement, or why there is none: outside or flat. z may be empty when only
  /// the information is wanted (the gradient is then that of a perfect frame: zero).
  template <FieldInterpolant Map>
  PatchVerdict gram(const Map& map, const PatchShape& shape, const PatchPlacement& at,
                    std::span<const double> z, const PatchNoise& noise, PatchScratch& scratch,
                    PatchGram& result) const;

  /// Corrects the belief with frame z (shape.size() numbers), or leaves it as it was.
  template <FramePlacement Placement, FieldInterpolant Map>
  [[nodiscard]] PatchUpdate update(Gaussian<typename Placement::State>& belief, const Placement& where,
                                   const Map& map, const PatchShape& shape, std::span<const double> z,
                                   const PatchNoise& noise, PatchScratch& scratch) const;

  /// H^T C^-1 H at a state: what the frame can tell, for the Cramer-Rao bound. Nothing when flat or outside.
  template <FramePlacement Placement, FieldInterpolant Map>
  [[nodiscard]] std::optional<Matrix<Placement::State::RowsAtCompileTime>> information(
      const typename Placement::State& x, const Placement& where, const Map& map, const PatchShape& shape,
      const PatchNoise& noise, PatchScratch& scratch) const {
    PatchGram result;
    if (gram(map, shape, where.placement(x), {}, noise, scratch, result) != PatchVerdict::accepted)
      return std::nullopt;
    const auto J = where.jacobian(x);
    return (J.transpose() * result.information * J).eval();
  }
};

namespace detail {

/// Eliminates row and column k of a Gram matrix. False when what is left of its diagonal is rounding.
inline bool eliminate(Matrix<9>& gram, int k, double original_diagonal) {
  if (!(gram(k, k) > 1e-12 * original_diagonal)) return false;
  const Vector<9> column = gram.col(k) / std::sqrt(gram(k, k));
  gram -= column * column.transpose();
  return true;
}

}  // namespace detail

template <FieldInterpolant Map>
PatchVerdict PatchFilter::gram(const Map& map, const PatchShape& shape, const PatchPlacement& at,
                               std::span<const double> z, const PatchNoise& noise, PatchScratch& scratch,
                               PatchGram& result) const {
  PatchSamples& f = scratch.samples;
  sample_patch(map, shape, at, f);
  result.samples = f.count_inside;
  if (static_cast<double>(f.count_inside) < std::max(1.0, smallest_share * static_cast<double>(shape.size())))
    return PatchVerdict::outside;
  double mean = 0;  // of h: subtracted from the gain's column, which leaves the span of both as it is
  for (const double value : f.value) mean += value;
  mean /= static_cast<double>(f.count_inside);
  double contrast = 0;
  for (std::size_t k = 0; k < shape.size(); ++k) contrast += f.inside[k] * std::pow(f.value[k] - mean, 2);
  constexpr double rounding = 1e-11;  // of an interpolated value, relative: with room for its sums
  if (free_gain && !(contrast > std::pow(rounding * mean, 2) * static_cast<double>(f.count_inside)))
    return PatchVerdict::flat;
  scratch.columns.resize(static_cast<Eigen::Index>(shape.size()), 9);
  std::size_t i = 0;
  for (int b = shape.half_width; b >= -shape.half_width; --b)
    for (int a = -shape.behind; a <= shape.ahead; ++a, ++i) {
      double* row = scratch.columns.data() + i;
      const std::size_t stride = shape.size();
      const double inside = f.inside[i];
      row[0] = f.dx[i];
      row[stride] = f.dy[i];
      row[2 * stride] = a * f.dx[i];
      row[3 * stride] = a * f.dy[i];
      row[4 * stride] = b * f.dx[i];
      row[5 * stride] = b * f.dy[i];
      row[6 * stride] = inside;
      row[7 * stride] = inside * (f.value[i] - mean);
      row[8 * stride] = z.empty() ? 0.0 : inside * (z[i] - f.value[i]);
    }
  Matrix<9> all = noise.weigh<9>(scratch.columns, f.count_inside == shape.size());
  const double value_diagonal = all(7, 7);
  result.gain = 1.0;
  if ((free_bias || free_gain) && !detail::eliminate(all, 6, all(6, 6))) return PatchVerdict::flat;
  if (free_gain) {
    const double excess = all(7, 8) / all(7, 7);
    if (!detail::eliminate(all, 7, value_diagonal)) return PatchVerdict::flat;
    result.gain = 1.0 + excess;
  }
  result.information = (result.gain * result.gain) * all.topLeftCorner<6, 6>();
  result.gradient = result.gain * all.topRightCorner<6, 1>();
  result.squares = all(8, 8);
  return PatchVerdict::accepted;
}

template <FramePlacement Placement, FieldInterpolant Map>
PatchUpdate PatchFilter::update(Gaussian<typename Placement::State>& belief, const Placement& where,
                                const Map& map, const PatchShape& shape, std::span<const double> z,
                                const PatchNoise& noise, PatchScratch& scratch) const {
  using State = typename Placement::State;
  constexpr int n = State::RowsAtCompileTime;
  CAIRN_EXPECTS(z.size() == shape.size(), "PatchFilter::update needs one number a sample of the frame");
  CAIRN_EXPECTS(iterations >= 1, "PatchFilter needs at least one linearisation");
  PatchUpdate result;
  result.verdict = PatchVerdict::not_finite;
  if (!belief.mean.allFinite() || !belief.covariance.allFinite()) return result;
  for (const double value : z)
    if (!std::isfinite(value)) return result;
  const Eigen::LLT<Matrix<n>> root(belief.covariance);
  result.verdict = PatchVerdict::not_positive_definite;
  if (root.info() != Eigen::Success) return result;
  const Matrix<n> L = root.matrixL();

  Vector<n> u = Vector<n>::Zero(), best_u = u;  // x = m + L u: where to look, and the least cost so far
  Matrix<n> A = Matrix<n>::Zero();
  double least = std::numeric_limits<double>::infinity();
  PatchGram frame;
  for (bool done = false; !done && result.iterations < iterations;) {
    const State x = belief.mean + L * u;
    const PatchVerdict seen = gram(map, shape, where.placement(x), z, noise, scratch, frame);
    ++result.iterations;
    if (result.iterations > 1 && !(seen == PatchVerdict::accepted &&
                                   u.squaredNorm() + frame.squares < least)) {  // too far: half way back
      u = 0.5 * (u + best_u);
      continue;
    }
    result.verdict = seen;
    if (!result.accepted()) return result;
    least = u.squaredNorm() + frame.squares;
    best_u = u;
    const auto J = (where.jacobian(x) * L).eval();
    A = J.transpose() * frame.information * J;
    result.samples = frame.samples;
    result.residual = frame.squares / static_cast<double>(frame.samples);
    result.gain = frame.gain;
    const Matrix<n> M = Matrix<n>::Identity() + A;
    u = M.llt().solve(J.transpose() * frame.gradient + A * best_u);  // (1)
    const Vector<n> step = u - best_u;
    done = step.dot(M * step) < tolerance * tolerance;
  }
  result.information = A.trace();
  if (!(result.information > smallest_information))
    result.verdict = PatchVerdict::flat;
  else if (!(result.residual <= gate) || result.gain < smallest_gain)
    result.verdict = PatchVerdict::gated;
  if (!result.accepted()) return result;
  const Matrix<n> M = Matrix<n>::Identity() + A;
  belief.mean += L * u;
  belief.covariance = symmetrised(L * M.llt().solve(Matrix<n>(L.transpose())));  // (2)
  return result;
}

}  // namespace cairn::inline CAIRN_ABI
