// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Measurements that are worse than their R says: outliers softened instead of refused, and R learnt from the
/// residuals.
///
/// Robust raises R by the smallest factor >= 1 that brings the NIS down to `limit` (G. Chang, "Robust Kalman
/// filtering based on Mahalanobis distance as outlier judging criterion", Journal of Geodesy 88, 2014).
/// Huber and StudentT give the peak of the posterior for a sensor whose errors have heavy tails, by weighing
/// the measurement anew until its weight settles: R / w(t), t^2 = r^T R^-1 r of the residual after the
/// update,
///   Huber     w = min(1, threshold / t)      errors normal in the middle, exponential beyond
///   StudentT  w = (dof + m) / (dof + t^2)    errors of the multivariate Student distribution
/// (P. Huber, "Robust estimation of a location parameter", 1964; C. Karlgaard, H. Schaub, "Huber-based
/// divided difference filtering", J. Guidance 30, 2007; K. Lange, R. Little, J. Taylor, "Robust statistical
/// modeling using the t distribution", JASA 84, 1989.)
///
/// adapted_noise() averages r r^T + H P H^T over the residuals r after the update, which is never indefinite
/// (A. Mohamed, K. Schwarz, "Adaptive Kalman filtering for INS/GPS", Journal of Geodesy 73, 1999);
/// innovated_noise() needs no Jacobian and averages v v^T - H P H^T over the residuals v before it (R. Mehra,
/// "On the identification of variances and adaptive Kalman filtering", IEEE Trans. Automatic Control 15,
/// 1970).
#pragma once

#include <type_traits>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// R can be weighed: it is positive definite, so that every residual has a size in its units.
template <int M, class S>
[[nodiscard]] bool is_regular_noise(const Matrix<M, M, S>& r) {
  const Cholesky<M, S> root(r);
  return root.good() && root.least_share() > rounding_share<S>;
}

/// The sensor with its noise multiplied.
template <MeasurementModel H>
struct Inflated : H {
  double factor = 1.0;
  [[nodiscard]] auto noise(const typename H::State& x) const {
    auto inflated = as_found(H::noise(x));
    inflated *= static_cast<ScalarOf<typename H::State>>(factor);
    return inflated;
  }
};

}  // namespace detail

/// Any filter of Gaussian beliefs with softened outliers. Options only.
template <class Filter = Extended>
struct Robust {
  Filter filter{};
  double limit = 9.0;  ///< NIS above which R is raised; > 0, usually a chi-square quantile
  template <Manifold X>
  using BeliefOf = cairn::BeliefOf<Filter, X>;

  /// That of the filter.
  template <Belief B, class F, class U = detail::ControlOf<F>>
    requires(ProcessModel<F> || detail::explain_process<F>)
  Status predict(B& belief, const F& process, double dt, const U& control = detail::no_control<U>()) const {
    return filter.predict(belief, process, dt, control);
  }

  /// Like filter.update; where R was raised the innovation is that of the raised R. not_positive_definite
  /// where no factor would do, as for R = 0.
  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  auto update(cairn::BeliefOf<Filter, typename H::State>& belief, const H& sensor, const V& z) const {
    using S = ScalarOf<typename H::State>;
    using B = cairn::BeliefOf<Filter, typename H::State>;
    constexpr int m = dof<typename H::Measurement>;
    static_assert(detail::demand_proper_belief<B>());
    B next = belief;  // what the sensor throws comes through and leaves the belief
    auto innovation = filter.update(next, sensor, z);
    if (!(limit > 0.0)) innovation.status = Status::bad_option;
    const bool judged = innovation.accepted() || innovation.status == Status::gated;
    if (!judged || !(innovation.nis > static_cast<S>(limit))) {
      if (innovation.accepted()) belief = next;
      return innovation;
    }
    const detail::PlainSensor plain(sensor, detail::size_of_belief(belief), z);
    const Matrix<m, m, S> r = detail::dense_of(plain.noise(belief.mean));
    const auto nis = [&](double factor) {
      const Matrix<m, m, S> s = innovation.covariance + static_cast<S>(factor - 1.0) * r;
      return static_cast<double>(detail::squared_mahalanobis<m, S>(innovation.residual, s));
    };
    double low = 1.0;
    double high = 2.0;
    while (nis(high) > limit && high < 1e30) high *= 2.0;
    if (!detail::is_regular_noise<m, S>(r) || !(nis(high) <= limit)) {
      innovation.status = Status::not_positive_definite;
      return innovation;
    }
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      (nis(middle) > limit ? low : high) = middle;
    }
    return filter.update(belief, detail::Inflated<H>{sensor, high}, z);
  }
};

namespace detail {

template <MeasurementModel H>
[[nodiscard]] auto refused_as(Status status) {
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> innovation;
  innovation.status = status;
  return innovation;
}

/// Repeats the update with R / weight(t) until t, of the residual after it, no longer changes the weight
/// (expectation-maximisation, or iteratively reweighted least squares: the posterior rises at every round).
template <class Filter, MeasurementModel H, class V, class Weight>
auto reweighted_update(const Filter& filter, BeliefOf<Filter, typename H::State>& belief, const H& sensor,
                       const V& z, const Weight& weight) {
  using B = BeliefOf<Filter, typename H::State>;
  using S = ScalarOf<typename H::State>;
  constexpr int m = dof<typename H::Measurement>;
  static_assert(demand_proper_belief<B>());
  const PlainSensor plain(sensor, size_of_belief(belief), z);
  const auto residual_size = [&](const B& updated) {
    const Vector<m, S> r = plain.residual(updated.mean);
    const Matrix<m, m, S> noise = dense_of(plain.noise(updated.mean));
    using std::sqrt;
    return sqrt(static_cast<double>(squared_mahalanobis<m, S>(r, noise)));
  };
  B next = belief;  // what the sensor throws comes through and leaves the belief
  auto innovation = filter.update(next, sensor, z);
  if (!innovation.accepted()) return innovation;
  if (const Matrix<m, m, S> r = dense_of(plain.noise(belief.mean)); !is_regular_noise<m, S>(r)) {
    innovation.status = Status::not_positive_definite;
    return innovation;
  }
  constexpr double close = std::is_same_v<S, float> ? 1e-5 : 1e-9;
  double factor = 1.0 / weight(residual_size(next));
  for (int step = 0; step < 1000; ++step) {
    next = belief;
    innovation = filter.update(next, Inflated<H>{sensor, factor}, z);
    if (!innovation.accepted()) return innovation;
    const double wanted = 1.0 / weight(residual_size(next));
    const double change = wanted - factor;
    factor = wanted;
    if ((change < 0 ? -change : change) <= close * wanted) {
      belief = next;
      return innovation;
    }
  }
  innovation.status = Status::not_converged;
  return innovation;
}

}  // namespace detail

/// Any filter of Gaussian beliefs, for a sensor with outliers, by Huber's loss. Options only.
template <class Filter = Extended>
struct Huber {
  Filter filter{};
  double threshold = 1.345;  ///< residual in standard deviations beyond which it counts linearly; > 0
  template <Manifold X>
  using BeliefOf = cairn::BeliefOf<Filter, X>;

  /// That of the filter.
  template <Belief B, class F, class U = detail::ControlOf<F>>
    requires(ProcessModel<F> || detail::explain_process<F>)
  Status predict(B& belief, const F& process, double dt, const U& control = detail::no_control<U>()) const {
    return filter.predict(belief, process, dt, control);
  }

  /// Like filter.update; the innovation and the covariance are those of the weighed R.
  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  auto update(cairn::BeliefOf<Filter, typename H::State>& belief, const H& sensor, const V& z) const {
    if (!(threshold > 0.0)) return detail::refused_as<H>(Status::bad_option);
    const auto weight = [&](double t) { return t > threshold ? threshold / t : 1.0; };
    return detail::reweighted_update(filter, belief, sensor, z, weight);
  }
};

/// Any filter of Gaussian beliefs, for a sensor whose errors are Student's. Options only.
template <class Filter = Extended>
struct StudentT {
  Filter filter{};
  double degrees = 4.0;  ///< of freedom, dof above; small for heavy tails; > 0
  template <Manifold X>
  using BeliefOf = cairn::BeliefOf<Filter, X>;

  /// That of the filter.
  template <Belief B, class F, class U = detail::ControlOf<F>>
    requires(ProcessModel<F> || detail::explain_process<F>)
  Status predict(B& belief, const F& process, double dt, const U& control = detail::no_control<U>()) const {
    return filter.predict(belief, process, dt, control);
  }

  /// Like filter.update; the innovation and the covariance are those of the weighed R.
  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  auto update(cairn::BeliefOf<Filter, typename H::State>& belief, const H& sensor, const V& z) const {
    if (!(degrees > 0.0)) return detail::refused_as<H>(Status::bad_option);
    const int m = dof_of(detail::Given<typename H::Measurement, V>(z).value());
    const auto weight = [&](double t) { return (degrees + m) / (degrees + t * t); };
    return detail::reweighted_update(filter, belief, sensor, z, weight);
  }
};

/// R after one more measurement: (1 - rate) R + rate (r r^T + H P H^T), r = z - h(x) with the updated belief.
/// 0 < rate < 1; about 1 / rate measurements count.
template <class H, class V = typename H::Measurement>
  requires(LinearisedMeasurement<H> || detail::explain_sensor<H>)
[[nodiscard]] CovarianceOf<typename H::Measurement> adapted_noise(
    const CovarianceOf<typename H::Measurement>& r, const Gaussian<typename H::State>& updated,
    const H& sensor, const V& z, double rate) {
  using S = ScalarOf<typename H::State>;
  using Z = typename H::Measurement;
  CAIRN_EXPECTS(rate > 0.0 && rate < 1.0, "adapted_noise needs a rate between 0 and 1");
  const detail::PlainSensor plain(sensor, detail::common_size(updated.mean, updated.covariance), z);
  const Matrix<dof<Z>, dof<typename H::State>, S> h = detail::dense_of(plain.jacobian(updated.mean));
  const Tangent<Z> left = plain.residual(updated.mean);
  CAIRN_EXPECTS(!plain.misfit() && detail::has_size(r, plain.numbers(), plain.numbers()),
                "adapted_noise needs a noise, a belief, a sensor and a measurement whose sizes fit");
  const CovarianceOf<Z> seen = left * left.transpose() + h * updated.covariance * h.transpose();
  return symmetrised(static_cast<S>(1.0 - rate) * r + static_cast<S>(rate) * seen);
}

/// R after one more measurement, from its innovation by the R it was taken in with: R + rate (v v^T - S),
/// which is (1 - rate) R + rate (v v^T - H P H^T). The step is halved until at least half of R is left in
/// every direction, so that R stays positive definite. 0 < rate < 1; about 1 / rate measurements count.
template <int M, class S>
[[nodiscard]] Matrix<M, M, S> innovated_noise(const Matrix<M, M, S>& r, const Innovation<M, S>& innovation,
                                              double rate) {
  CAIRN_EXPECTS(rate > 0.0 && rate < 1.0, "innovated_noise needs a rate between 0 and 1");
  CAIRN_EXPECTS(detail::has_size(r, innovation.residual.size(), innovation.residual.size()) &&
                    detail::has_size(innovation.covariance, r.rows(), r.cols()),
                "innovated_noise needs a noise of the innovation's size");
  const Matrix<M, M, S> change =
      innovation.residual * innovation.residual.transpose() - innovation.covariance;
  if (!all_finite(change)) return r;
  for (S part = static_cast<S>(rate); part > S(1e-6) * static_cast<S>(rate); part *= S(0.5)) {
    const Matrix<M, M, S> next = symmetrised(r + part * change);
    if (detail::is_valid_covariance<M, S>(next - S(0.5) * r)) return next;
  }
  return r;
}

}}  // namespace cairn::CAIRN_ABI
