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
/// one Gram matrix of nine columns (patch_gram.hpp), from which an unknown gain and bias are eliminated.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/field/patch_gram.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/field/patch_noise.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

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

  /// How the frames are linearised.
  [[nodiscard]] PatchLinearisation linearisation() const noexcept {
    return {free_bias, free_gain, smallest_share};
  }

  /// Corrects the belief with frame z (shape.size() numbers), or leaves it as it was.
  template <class Placement, FieldInterpolant Map>
    requires(FramePlacement<Placement> || detail::explain_placement<Placement>)
  [[nodiscard]] PatchUpdate update(Gaussian<typename Placement::State>& belief, const Placement& where,
                                   const Map& map, const PatchShape& shape, std::span<const double> z,
                                   const PatchNoise& noise, PatchScratch& scratch) const;

  /// H^T C^-1 H at a state: what the frame can tell, for the Cramer-Rao bound. Nothing when flat or outside.
  template <class Placement, FieldInterpolant Map>
    requires(FramePlacement<Placement> || detail::explain_placement<Placement>)
  [[nodiscard]] std::optional<Matrix<Placement::State::RowsAtCompileTime>> information(
      const typename Placement::State& x, const Placement& where, const Map& map, const PatchShape& shape,
      const PatchNoise& noise, PatchScratch& scratch) const {
    PatchGram result;
    if (linearisation().gram(map, shape, where.placement(x), {}, noise, scratch, result) !=
        PatchVerdict::accepted)
      return std::nullopt;
    constexpr int n = Placement::State::RowsAtCompileTime;
    const Matrix<6, n> J = detail::plain_copy<6, n, double>(where.jacobian(x));
    return result.information_by(J);
  }

private:
  /// Gauss-Newton over u, x = mean + L u: the minimum, the information A there and what the frame brought.
  template <FramePlacement Placement, int N, class Linearise>
  void minimise(const typename Placement::State& mean, const Matrix<N>& L, const Placement& where,
                const Linearise& linearise, Vector<N>& u, Matrix<N>& A, PatchUpdate& result) const;
};

template <class Placement, FieldInterpolant Map>
  requires(FramePlacement<Placement> || detail::explain_placement<Placement>)
PatchUpdate PatchFilter::update(Gaussian<typename Placement::State>& belief, const Placement& where,
                                const Map& map, const PatchShape& shape, std::span<const double> z,
                                const PatchNoise& noise, PatchScratch& scratch) const {
  constexpr int n = Placement::State::RowsAtCompileTime;
  CAIRN_EXPECTS(z.size() == shape.size(), "PatchFilter::update needs one number a sample of the frame");
  CAIRN_EXPECTS(iterations >= 1, "PatchFilter needs at least one linearisation");
  PatchUpdate result;
  result.verdict = PatchVerdict::not_finite;
  if (!all_finite(belief.mean) || !all_finite(belief.covariance)) return result;
  for (const double value : z)
    if (!std::isfinite(value)) return result;
  const Cholesky<n> root(belief.covariance);
  result.verdict = PatchVerdict::not_positive_definite;
  if (!root.good()) return result;
  const Matrix<n>& L = root.lower();
  Vector<n> u;
  Matrix<n> A = Matrix<n>::Zero();  // gcc 12 does not see that there is an iteration
  const auto linearise = [&](const typename Placement::State& x, PatchGram& frame) {
    return linearisation().gram(map, shape, where.placement(x), z, noise, scratch, frame);
  };
  minimise(belief.mean, L, where, linearise, u, A, result);
  if (!result.accepted()) return result;
  result.information = A.trace();
  if (!(result.information > smallest_information))
    result.verdict = PatchVerdict::flat;
  else if (!(result.residual <= gate) || result.gain < smallest_gain)
    result.verdict = PatchVerdict::gated;
  if (!result.accepted()) return result;
  const Matrix<n> M = Matrix<n>::Identity() + A;
  const Gaussian<typename Placement::State> posterior{
      belief.mean + product(L, u), symmetrised(product(L, Cholesky<n>(M).solve(transposed(L))))};  // (2)
  if (all_finite(posterior.mean) && all_finite(posterior.covariance))
    belief = posterior;
  else
    result.verdict = PatchVerdict::not_finite;
  return result;
}

template <FramePlacement Placement, int N, class Linearise>
void PatchFilter::minimise(const typename Placement::State& mean, const Matrix<N>& L, const Placement& where,
                           const Linearise& linearise, Vector<N>& u, Matrix<N>& A,
                           PatchUpdate& result) const {
  Vector<N> best = u = Vector<N>::Zero();  // x = m + L u: where to look next, and the least cost so far
  double least = std::numeric_limits<double>::infinity();
  PatchGram frame;
  for (bool done = false; !done && result.iterations < iterations;) {
    const typename Placement::State x = mean + product(L, u);
    const PatchVerdict seen = linearise(x, frame);
    ++result.iterations;
    const double cost = u.squaredNorm() + frame.squares;
    if (result.iterations > 1 && !(seen == PatchVerdict::accepted && cost < least)) {
      u = 0.5 * (u + best);  // too far: half way back
      continue;
    }
    result.verdict = seen;
    if (!result.accepted()) return;
    least = cost;
    best = u;
    const Matrix<6, N> J = product(detail::plain_copy<6, N, double>(where.jacobian(x)), L);
    A = frame.information_by(J);
    result.samples = frame.samples;
    result.residual = frame.squares / static_cast<double>(frame.samples);
    result.gain = frame.gain;
    const Matrix<N> M = Matrix<N>::Identity() + A;
    u = Cholesky<N>(M).solve(Vector<N>(frame.gradient_by(J) + product(A, best)));  // (1)
    const Vector<N> step = u - best;
    done = step.dot(product(M, step)) < tolerance * tolerance;
  }
}

}}  // namespace cairn::CAIRN_ABI
