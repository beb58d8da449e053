// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Q and R from a record, by expectation-maximisation: smooth with the noise known so far, then take for Q
/// and R the mean squares that the smoothed states explain,
///   Q = 1/T  sum  e e^T + (I - F G(k)) P(k+1) (I - F G(k))^T + F V(k) F^T,   e = x(k+1) (-) f(x(k))
///   R = 1/T' sum  r r^T + H P(k) H^T,                            r = z (-) h(x(k))
/// with the states given the whole record, G and V of smoother.hpp and T' measurements (R. Shumway, D.
/// Stoffer, "An approach to time series smoothing and forecasting using the EM algorithm", J. Time Series
/// Analysis 3, 1982). The likelihood never falls where the models are linear, and converges linearly: tens to
/// hundreds of rounds. Elsewhere the linearisation makes both approximate.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/smoother.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/structured.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The process with another noise: the same covariance at every step.
template <ProcessModel F>
struct FixedProcessNoise : F {
  CovarianceOf<typename F::State> fixed;
  [[nodiscard]] const CovarianceOf<typename F::State>& noise(const typename F::State&,
                                                             const typename F::Control&, double) const {
    return fixed;
  }
};
/// The sensor with another noise.
template <MeasurementModel H>
struct FixedSensorNoise : H {
  CovarianceOf<typename H::Measurement> fixed;
  [[nodiscard]] const CovarianceOf<typename H::Measurement>& noise(const typename H::State&) const {
    return fixed;
  }
};

/// A run: the belief at its start, what was seen then, and steps with what was seen after each. Steps should
/// be equally long, since Q is per step.
template <LinearisedProcess F, LinearisedMeasurement H>
struct NoiseRecord {
  struct Step {
    typename F::Control control;
    double dt;
    std::optional<typename H::Measurement> z;
  };
  Gaussian<typename F::State> prior;
  std::optional<typename H::Measurement> first;
  std::vector<Step> steps;
};

/// Result of fit_noise(). Not accepted: the matrices and likelihoods are those reached before.
template <LinearisedProcess F, LinearisedMeasurement H>
struct NoiseFit {
  CovarianceOf<typename F::State> process;
  CovarianceOf<typename H::Measurement> sensor;
  std::vector<double> log_likelihoods;  ///< of the noise before each round; the last is that of the result
  Status status = Status::accepted;
};

/// How far fit_noise() goes.
struct NoiseFitting {
  int rounds = 100;         ///< at most; >= 0
  double tolerance = 1e-9;  ///< ends where the log-likelihood rises by less than this part of itself
  bool process = true;      ///< whether Q is estimated
  bool sensor = true;       ///< whether R is estimated
};

namespace detail {

/// Sums of the expected squares of one run.
template <class F, class H>
struct NoiseSums {
  CovarianceOf<typename F::State> process;
  CovarianceOf<typename H::Measurement> sensor;
  std::size_t steps = 0, sightings = 0;

  void add_step(const F& f, const typename F::Control& u, double dt,
                const RecordedStep<typename F::State>& step, const Gaussian<typename F::State>& before,
                const Gaussian<typename F::State>& after) {
    using X = typename F::State;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    const PlainProcess plain(f, common_size(before.mean, before.covariance), u);
    const CovarianceOf<X> jacobian = dense_of(plain.jacobian(before.mean, dt));
    const Tangent<X> e = local(X(plain.propagate(before.mean, dt)), after.mean);
    CovarianceOf<X> left = -column_product(jacobian, step.gain);
    for (int i = 0; i < static_cast<int>(process.rows()); ++i) left(i, i) += S(1);
    const CovarianceOf<X> of_after = column_product(left, semi_definite_root<n, S>(after.covariance));
    const CovarianceOf<X> of_before = column_product(jacobian, semi_definite_root<n, S>(step.given_after));
    process += squared_root<n, S>(of_after) + squared_root<n, S>(of_before) + e * e.transpose();
    ++steps;
  }
  void add_sighting(const H& h, const typename H::Measurement& z, const Gaussian<typename H::State>& belief) {
    using Z = typename H::Measurement;
    const PlainSensor plain(h, common_size(belief.mean, belief.covariance), z);
    const JacobianOf<Z, typename H::State> jacobian = dense_of(plain.jacobian(belief.mean));
    const Tangent<Z> r = plain.residual(belief.mean);
    sensor += r * r.transpose() + jacobian * belief.covariance * jacobian.transpose();
    ++sightings;
  }
};

/// What the sensor says of its noise at x.
template <MeasurementModel H>
[[nodiscard]] CovarianceOf<typename H::Measurement> noise_at(const H& sensor, const typename H::State& x,
                                                             bool& misfit) {
  using Z = typename H::Measurement;
  auto&& noise = sensor.noise(x);
  const Eigen::Index size = dof<Z> != dynamic ? dof<Z> : noise.rows();
  return plain_matrix<dof<Z>, dof<Z>, ScalarOf<Z>>(noise, size, size, misfit);
}

/// Smooths the record with the given noise; sums the log-likelihood and the expected squares.
template <class Filter, class F, class H>
Status smooth_record(const Filter& filter, const NoiseRecord<F, H>& record,
                     const FixedProcessNoise<F>& process, const FixedSensorNoise<H>& sensor,
                     double& log_likelihood, NoiseSums<F, H>& sums) {
  Recorder<Filter, typename F::State> recorder(filter, record.prior);
  const auto see = [&](const std::optional<typename H::Measurement>& z) {
    if (!z) return Status::accepted;
    const auto innovation = recorder.update(sensor, *z);
    log_likelihood += static_cast<double>(innovation.log_likelihood());
    return innovation.status;
  };
  log_likelihood = 0.0;
  Status status = see(record.first);
  for (const auto& step : record.steps) {
    if (status == Status::accepted) status = recorder.predict(process, step.dt, step.control);
    if (status == Status::accepted) status = see(step.z);
    if (status != Status::accepted) return status;
  }
  const auto path = recorder.smoothed();
  if (record.first) sums.add_sighting(sensor, *record.first, path[0]);
  for (std::size_t k = 0; k < record.steps.size(); ++k) {
    const auto& step = record.steps[k];
    sums.add_step(process, step.control, step.dt, recorder.steps()[k], path[k], path[k + 1]);
    if (step.z) sums.add_sighting(sensor, *step.z, path[k + 1]);
  }
  return status;
}

}  // namespace detail

/// Estimates the noise of `process` and `sensor`, beginning with what they say themselves at the start of the
/// record. not_converged: `rounds` are spent (the result is usable); depleted: nothing to learn from;
/// size_mismatch: a size of the record's and the models' does not fit. O(rounds * steps).
template <class Filter = Kalman, class F, class H>
  requires(LinearisedProcess<F> || detail::explain_process<F>) &&
          (LinearisedMeasurement<H> || detail::explain_sensor<H>)
[[nodiscard]] NoiseFit<F, H> fit_noise(const NoiseRecord<F, H>& record, const F& process, const H& sensor,
                                       const NoiseFitting& options = {}, const Filter& filter = {}) {
  using Q = CovarianceOf<typename F::State>;
  using R = CovarianceOf<typename H::Measurement>;
  const int n = detail::common_size(record.prior.mean, record.prior.covariance);
  bool misfit = n == 0;
  NoiseFit<F, H> fit{
      Q::Zero(n, n).eval(), detail::noise_at(sensor, record.prior.mean, misfit), {}, Status::depleted};
  if (record.steps.empty()) return fit;
  if (n > 0 && !detail::is_valid_covariance<dof<typename F::State>, ScalarOf<typename F::State>>(
                   record.prior.covariance)) {
    fit.status = all_finite(record.prior.covariance) ? Status::not_positive_definite : Status::not_finite;
    return fit;
  }
  const detail::PlainProcess plain(process, n, record.steps[0].control);
  fit.process = detail::dense_of(plain.noise(record.prior.mean, record.steps[0].dt));
  if (misfit || plain.misfit()) {
    fit.status = Status::size_mismatch;
    return fit;
  }
  if (options.rounds < 0 || !(options.tolerance >= 0.0)) {
    fit.status = Status::bad_option;
    return fit;
  }
  for (int round = 0;; ++round) {
    detail::NoiseSums<F, H> sums{Q::Zero(fit.process.rows(), fit.process.cols()).eval(),
                                 R::Zero(fit.sensor.rows(), fit.sensor.cols()).eval()};
    double likelihood = 0.0;
    fit.status = detail::smooth_record(filter, record, FixedProcessNoise<F>{process, fit.process},
                                       FixedSensorNoise<H>{sensor, fit.sensor}, likelihood, sums);
    if (fit.status != Status::accepted) return fit;
    const double before = fit.log_likelihoods.empty() ? 0.0 : fit.log_likelihoods.back();
    fit.log_likelihoods.push_back(likelihood);
    const double size = likelihood < 0 ? -likelihood : likelihood;
    if (round > 0 && likelihood - before <= options.tolerance * size) return fit;
    if (round == options.rounds) break;
    if (sums.sightings == 0) {
      fit.status = Status::depleted;
      return fit;
    }
    using S = ScalarOf<typename F::State>;
    if (options.process) fit.process = symmetrised(Q(sums.process / static_cast<S>(sums.steps)));
    if (options.sensor) fit.sensor = symmetrised(R(sums.sensor / static_cast<S>(sums.sightings)));
  }
  fit.status = Status::not_converged;
  return fit;
}

}}  // namespace cairn::CAIRN_ABI
