// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The founding document's estimator: the extended Kalman-Bucy filter in information form, integrated.
///
///   dX/dt     = f(X, u) + P H^T S^-1 (z(t) - h(X)),      P = Sigma^-1                              (1)
///   dSigma/dt = H^T S^-1 H - Sigma A - A^T Sigma - Sigma Q Sigma,      A = df/dX                   (2)
/// with H = dh/dX at the estimate, S = S_0 I the spectral density of the samples' noise and Q that of the
/// states' (zero in the document, whose A has the other sign). filter/kalman_bucy.hpp is the same filter for
/// any sensor in fixed steps; this one knows that a frame is a thousand samples of one field. Integrated by
/// DormandPrince of core/ode.hpp, with step control: the gain is large at the start and falls like 1/t, so no
/// fixed step serves both ends.
///
/// A frame that arrives at one instant is an impulse: (1) and (2) without the motion over a unit of
/// artificial time, with the frame's covariance in place of S. In the linear case that is exactly the Kalman
/// update; impulses and integration over the frame interval with S_0 = variance * interval agree to first
/// order in the interval.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/ode.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/field/patch_gram.hpp>
#include <cairn/field/patch_model.hpp>
#include <cairn/field/patch_noise.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kalman_bucy.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// Mean and information matrix as one vector, which is what is integrated.
template <int N>
using PackedBelief = Vector<N + N * N>;

template <int N>
bool pack_belief(const Gaussian<Vector<N>>& belief, PackedBelief<N>& y) {
  const Cholesky<N> prior(belief.covariance);
  if (!prior.good()) return false;
  const Matrix<N> sigma = prior.inverse();
  std::copy_n(belief.mean.data(), N, y.data());
  std::copy_n(sigma.data(), N * N, y.data() + N);
  return true;
}

template <int N>
Vector<N> packed_mean(const PackedBelief<N>& y) {
  return Vector<N>(y.data());
}
template <int N>
Matrix<N> packed_information(const PackedBelief<N>& y) {
  return Matrix<N>(y.data() + N);
}

/// False, and the belief as it was, when the information is not positive definite.
template <int N>
bool unpack_belief(const PackedBelief<N>& y, Gaussian<Vector<N>>& belief) {
  const Cholesky<N> posterior(symmetrised(packed_information<N>(y)));
  if (!posterior.good()) return false;
  belief.mean = packed_mean<N>(y);
  belief.covariance = posterior.inverse();
  return true;
}

/// What errors of y are compared with: sigmas, and products of the information's diagonal.
template <int N>
PackedBelief<N> error_scales(const PackedBelief<N>& y) {
  double root[N];
  for (int i = 0; i < N; ++i) root[i] = std::sqrt(y(N + i * (N + 1)));
  PackedBelief<N> result;
  for (int j = 0; j < N; ++j) {
    result(j) = 1.0 / root[j];
    for (int i = 0; i < N; ++i) result(N + j * N + i) = root[i] * root[j];
  }
  return result;
}

/// (1) and (2), given what the motion says (dX/dt, A, Q) and the frame, by which the placement has the
/// derivative J.
template <int N>
PackedBelief<N> belief_rate(const Matrix<N>& sigma, const Cholesky<N>& factor, const PatchGram& frame,
                            const Matrix<6, N>& J, const Vector<N>& rate, const Matrix<N>& A,
                            const Matrix<N>& Q) {
  const Vector<N> step = factor.solve(frame.gradient_by(J));
  const Matrix<N> gained = frame.information_by(J), moved = product(sigma, A);
  const Matrix<N> lost = product(sigma, product(Q, sigma));
  PackedBelief<N> result;
  for (int j = 0; j < N; ++j) {
    result(j) = rate(j) + step(j);
    for (int i = 0; i < N; ++i) result(N + j * N + i) = gained(i, j) - moved(i, j) - moved(j, i) - lost(i, j);
  }
  return result;
}

/// A process in which nothing moves.
template <class X>
struct Standstill {
  using State = X;
  using Control = NoControl;
  using Square = CovarianceOf<X>;
  [[nodiscard]] X rate(const X&, const Control&) const { return X::Zero(); }
  [[nodiscard]] Square rate_jacobian(const X&, const Control&) const { return Square::Zero(); }
  [[nodiscard]] Square spectral_density(const X&, const Control&) const { return Square::Zero(); }
};

}  // namespace detail

/// The continuous filter; holds options only.
struct PatchBucy {
  double tolerance = 1e-9;  ///< of a step's error, in sigmas and relative to the information
  int most_steps = 10000;

  /// Integrates the belief from time t to `end`, with frame_at(time) the frame seen then (anything a
  /// span of shape.size() numbers comes from) and `density` the spectral density of the samples' noise
  /// [unit^2 s]. `accepted`, or the belief as it was: outside, flat or not_finite frames, sizes that do not
  /// fit and not_positive_definite when the integration fails.
  template <class Motion, class Placement, FieldInterpolant Map, class FrameAt>
    requires(ContinuousProcess<Motion> || detail::explain_sizes<Motion>) &&
            (FramePlacement<Placement> || detail::explain_placement<Placement>)
  PatchVerdict integrate(Gaussian<typename Placement::State>& belief, const Motion& motion,
                         const typename Motion::Control& control, const Placement& where, const Map& map,
                         const PatchShape& shape, FrameAt&& frame_at, double density, double t, double end,
                         PatchScratch& scratch) const;

  /// Takes in one frame of samples with noise of this variance, at an instant.
  template <class Placement, FieldInterpolant Map>
    requires(FramePlacement<Placement> || detail::explain_placement<Placement>)
  PatchVerdict impulse(Gaussian<typename Placement::State>& belief, const Placement& where, const Map& map,
                       const PatchShape& shape, std::span<const double> z, double variance,
                       PatchScratch& scratch) const {
    return integrate(
        belief, detail::Standstill<typename Placement::State>{}, NoControl{}, where, map, shape,
        [z](double) { return z; }, variance, 0.0, 1.0, scratch);
  }
};

template <class Motion, class Placement, FieldInterpolant Map, class FrameAt>
  requires(ContinuousProcess<Motion> || detail::explain_sizes<Motion>) &&
          (FramePlacement<Placement> || detail::explain_placement<Placement>)
PatchVerdict PatchBucy::integrate(Gaussian<typename Placement::State>& belief, const Motion& motion,
                                  const typename Motion::Control& control, const Placement& where,
                                  const Map& map, const PatchShape& shape, FrameAt&& frame_at, double density,
                                  double t, double end, PatchScratch& scratch) const {
  constexpr int N = Placement::State::RowsAtCompileTime;
  CAIRN_EXPECTS(density > 0.0 && end >= t, "the Kalman-Bucy filter needs a density above 0 and end >= start");
  using Packed = detail::PackedBelief<N>;
  if (!(end > t)) return PatchVerdict::accepted;
  Packed y;
  if (!detail::pack_belief(belief, y)) return PatchVerdict::not_positive_definite;
  const PatchNoise noise(density);
  const detail::PlainProcess moved(motion, N, control);
  PatchVerdict verdict = PatchVerdict::accepted;
  const auto slope = [&](double time, const Packed& at, Packed& result) {
    const Vector<N> x = detail::packed_mean<N>(at);
    const Matrix<N> sigma = detail::packed_information<N>(at);
    const Cholesky<N> factor(sigma);
    auto&& seen = frame_at(time);
    const std::span<const double> z(seen);
    PatchGram frame;
    if (z.size() != shape.size())  // an empty one too, which says nothing
      verdict = PatchVerdict::size_mismatch;
    else if (!all_finite(at) || !factor.good())
      verdict = PatchVerdict::not_positive_definite;
    else
      verdict = PatchLinearisation{}.gram(map, shape, where.placement(x), z, noise, scratch, frame);
    if (verdict == PatchVerdict::accepted && !all_finite(frame.gradient)) verdict = PatchVerdict::not_finite;
    if (verdict != PatchVerdict::accepted) return false;
    result = detail::belief_rate<N>(sigma, factor, frame, detail::plain_copy<6, N, double>(where.jacobian(x)),
                                    moved.rate(x), moved.rate_jacobian(x), moved.spectral_density(x));
    if (moved.misfit()) verdict = PatchVerdict::size_mismatch;
    return verdict == PatchVerdict::accepted;
  };
  const bool arrived = DormandPrince{.tolerance = tolerance, .most_steps = most_steps}
                           .integrate(y, t, end, slope, detail::error_scales<N>)
                           .arrived;
  if (!arrived && verdict != PatchVerdict::accepted) return verdict;
  return arrived && detail::unpack_belief(y, belief) ? PatchVerdict::accepted
                                                     : PatchVerdict::not_positive_definite;
}

}}  // namespace cairn::CAIRN_ABI
