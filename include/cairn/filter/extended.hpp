// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The extended Kalman filter on manifolds, and its iterated update.
///
///   predict   x <- f(x, u),   P <- F P F^T + Q,   F the Jacobian at the old x
///   update    x <- x (+) K (z (-) h(x)),   P <- P - K S K^T,   H the Jacobian at x
/// With iterations > 1 the update relinearises: e_{k+1} = K_k (z (-) h(x_k) + H_k e_k), x_k = x (+) e_k,
/// which is Gauss-Newton on the posterior density (B. Bell, F. Cathey, "The iterated Kalman filter update as
/// a Gauss-Newton method", IEEE Trans. Automatic Control 38, 1993); a step that does not lower the cost is
/// halved. The error lives in the tangent space at the mean (an error-state filter).
#pragma once

#include <concepts>
#include <limits>

#include <cairn/filter/correct.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/jacobian.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// Extended Kalman filter. Options only: may serve any number of beliefs and threads.
struct Extended {
  Form form = Form::standard;
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: F P F^T is multiplied by this each step; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0
  int iterations = 1;              ///< of the update; 1 is the plain filter
  double tolerance = 1e-10;        ///< iterations end when the step changes by less, in standard deviations

  /// Moves the belief by one step of dt. Refused: dt < 0, anything not finite.
  template <class F, class U = typename F::Control>
    requires(LinearisedProcess<F> || detail::explain_sizes<F>)
  Status predict(Gaussian<typename F::State>& belief, const F& process, const U& control, double dt) const {
    return detail::predict_linearised(belief, process, control, dt, fading, stabilising_noise);
  }
  template <class F>
    requires(LinearisedProcess<F> || detail::explain_sizes<F>) && std::same_as<typename F::Control, NoControl>
  Status predict(Gaussian<typename F::State>& belief, const F& process, double dt) const {
    return predict(belief, process, NoControl{}, dt);
  }

  /// Takes in the measurement z, or refuses it and leaves the belief as it was. The innovation is the one
  /// before the update, whatever the iterations.
  template <class H, class V = typename H::Measurement>
    requires(LinearisedMeasurement<H> || detail::explain_sizes<H>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      Gaussian<typename H::State>& belief, const H& sensor, const V& z) const {
    const detail::PlainSensor plain(sensor, detail::common_size(belief.mean, belief.covariance), z);
    if (iterations == 1) [[likely]]
      return detail::update_linearised(belief, plain, gate, form);
    Gaussian<typename H::State> first = belief;
    auto innovation = detail::update_linearised(first, plain, gate, form);
    if (iterations < 1) innovation.status = Status::bad_option;
    if (!innovation.accepted()) return innovation;
    first = belief;
    innovation.status = iterate(first, plain, plain.z());
    if (plain.misfit()) innovation.status = Status::size_mismatch;
    if (innovation.accepted()) belief = first;
    return innovation;
  }

private:
  template <class H>
  Status iterate(Gaussian<typename H::State>& belief, const H& sensor,
                 const typename H::Measurement& z) const;
};

namespace detail {

/// Twice the negative logarithm of the posterior at prior (+) e, without constants.
template <class H, Manifold X>
[[nodiscard]] ScalarOf<X> posterior_cost(const Gaussian<X>& prior, const Tangent<X>& e, const H& sensor,
                                         const typename H::Measurement& z) {
  using S = ScalarOf<X>;
  constexpr int m = dof<typename H::Measurement>;
  const X x = retract(prior.mean, e);
  const Vector<m, S> residual = local(typename H::Measurement(sensor.predict(x)), z);
  const Matrix<m, m, S> r = sensor.noise(x);
  return squared_mahalanobis<dof<X>, S>(e, prior.covariance) + squared_mahalanobis<m, S>(residual, r);
}

/// Derivative at d = e of the step seen from x = prior (+) e: how tangent vectors move from the prior's mean
/// to x. Nothing to move between vectors: their tangent space is one.
template <Manifold X>
[[nodiscard]] CovarianceOf<X> transport(const X& prior, const Tangent<X>& e) {
  return numeric_jacobian([&](const Tangent<X>& d) -> X { return retract(prior, d); }, e);
}

}  // namespace detail

template <class H>
Status Extended::iterate(Gaussian<typename H::State>& belief, const H& sensor,
                         const typename H::Measurement& z) const {
  using X = typename H::State;
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  constexpr int m = dof<typename H::Measurement>;
  constexpr double no_gate = std::numeric_limits<double>::infinity();
  Tangent<X> e = local(belief.mean, belief.mean);
  S cost = detail::posterior_cost(belief, e, sensor, z);
  CovarianceOf<X> covariance = belief.covariance;
  for (int k = 0; k < iterations; ++k) {
    const X x = retract(belief.mean, e);
    Matrix<m, n, S> h = detail::dense_of(sensor.jacobian(x));
    if constexpr (!detail::is_vector<X>) h = (h * detail::transport(belief.mean, e)).eval();
    Vector<m, S> residual = local(typename H::Measurement(sensor.predict(x)), z);
    residual += h * e;
    const Matrix<m, m, S> noise = sensor.noise(x);
    detail::Candidate<n, m, S> next{detail::fresh_innovation<m, S>(residual, noise), {}, {}};
    detail::correct_into<n, m, S>(next, belief.covariance, h, noise, no_gate, form);
    if (next.innovation.status != Status::accepted) return next.innovation.status;
    next.covariance_to(covariance);
    Tangent<X> change = e;
    next.step_to(change);
    change -= e;
    S lower = detail::posterior_cost(belief, Tangent<X>(e + change), sensor, z);
    for (int halving = 0; halving < 10 && !(lower <= cost); ++halving) {
      change *= S(0.5);
      lower = detail::posterior_cost(belief, Tangent<X>(e + change), sensor, z);
    }
    if (!(lower <= cost)) break;  // no descent left above rounding
    e += change;
    cost = lower;
    const S size = detail::squared_mahalanobis<n, S>(change, belief.covariance);
    if (size <= static_cast<S>(tolerance * tolerance)) break;
  }
  if (!all_finite(e) || !detail::finite_state(belief.mean)) return Status::not_finite;
  if constexpr (!detail::is_vector<X>) {
    const CovarianceOf<X> transport = detail::transport(belief.mean, e);
    covariance = (transport * covariance * transport.transpose()).eval();
  }
  belief.mean = retract(belief.mean, e);
  belief.covariance = symmetrised(covariance);
  return Status::accepted;
}

}  // namespace cairn::inline CAIRN_ABI
