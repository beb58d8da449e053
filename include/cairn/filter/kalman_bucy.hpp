// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Kalman-Bucy filter: continuous time between measurements, or continuous measurements too.
///
/// The process is a rate, x' = f(x, u) + white noise of spectral density Q, A = df/dx; a continuous sensor
/// has noise of spectral density R:
///   x' = f(x, u) + K (z - h(x)),   P' = A P + P A^T + Q - K R K^T,   K = P H^T R^-1        (covariance)
///   Y' = -Y A - A^T Y - Y Q Y + H^T R^-1 H                                                 (information)
/// (R. E. Kalman, R. S. Bucy, "New results in linear filtering and prediction theory", 1961), integrated by
/// the classical Runge-Kutta rule of core/ode.hpp in `steps` equal parts at first: each is done whole and in
/// halves, and where the two differ by more than the tolerance the part is halved (E. Hairer, S. Norsett, G.
/// Wanner, "Solving Ordinary Differential Equations I", II.4). An explicit rule needs a part for every few
/// time constants of the filter. Measurements at instants go through Kalman, Extended or InformationFilter:
/// together that is the continuous-discrete filter.
///
/// ```cpp
/// struct Drifting {
///   using State = cairn::Vector<2>;  using Control = cairn::NoControl;
///   cairn::Tangent<State> rate(const State& x, const Control& u) const;         // per second
///   cairn::Matrix<2> rate_jacobian(const State& x, const Control& u) const;     // A
///   cairn::Matrix<2> spectral_density(const State& x, const Control& u) const;  // Q, per second
/// };
/// ```
#pragma once

#include <cmath>
#include <concepts>
#include <limits>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/ode.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// A process in continuous time.
template <class F>
concept ContinuousProcess = Manifold<typename F::State> &&
                            requires(const F& f, const typename F::State& x, const typename F::Control& u) {
                              { f.rate(x, u) } -> StateOf<Tangent<typename F::State>>;
                              { f.rate_jacobian(x, u) } -> detail::CovarianceLike<typename F::State>;
                              { f.spectral_density(x, u) } -> detail::CovarianceLike<typename F::State>;
                            };

/// Kalman-Bucy filter. Options only. For states that are not vectors the rate is taken in the tangent space
/// at the start of each part. Refused: not_converged, where most_parts do not do; a spectral density that is
/// no covariance at the start, a sensor's that is not positive definite.
struct KalmanBucy {
  int steps = 1;            ///< Runge-Kutta parts of one call to begin with; >= 1
  double tolerance = 1e-6;  ///< of one part, in standard deviations; > 0
  int most_parts = 100000;  ///< of one call, those that were too long included; >= 1

  /// Moves the belief by dt without measurement.
  template <class F, class U = detail::ControlOf<F>>
    requires(ContinuousProcess<F> || detail::explain_sizes<F>)
  Status predict(Gaussian<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    using P = CovarianceOf<X>;
    const detail::PlainProcess plain(process, detail::common_size(belief.mean, belief.covariance), control);
    if (plain.misfit()) return Status::size_mismatch;
    const auto rate = [&](const X& x, const P& p) {
      const P a = plain.rate_jacobian(x);
      const P ap = a * p;
      return Rates<X>{plain.rate(x), P(ap + ap.transpose() + plain.spectral_density(x))};
    };
    if (const Status status = judge(plain, belief.mean); status != Status::accepted) return status;
    Gaussian<X> next = belief;
    const Status status = integrate<Matrices::covariances>(next.mean, next.covariance, rate, dt);
    if (plain.misfit()) return Status::size_mismatch;
    if (status == Status::accepted) belief = next;
    return status;
  }

  /// Moves the belief by dt while the sensor reports z, held constant; sensor.noise() is a spectral density.
  template <class F, class H, class U = detail::ControlOf<F>, class V = typename H::Measurement>
    requires(ContinuousProcess<F> || detail::explain_sizes<F>) &&
            (LinearisedMeasurement<H> || detail::explain_sensor<H>)
  Status filter(Gaussian<typename F::State>& belief, const F& process, const H& sensor, const V& z, double dt,
                const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    using P = CovarianceOf<X>;
    const int n = detail::common_size(belief.mean, belief.covariance);
    const detail::PlainProcess plain(process, n, control);
    const detail::PlainSensor plain_sensor(sensor, n, z);
    const auto misfit = [&] { return plain.misfit() || plain_sensor.misfit(); };
    if (misfit()) return Status::size_mismatch;
    const auto rate = [&](const X& x, const P& p) {
      const auto seen = look(plain_sensor, x);
      const P a = plain.rate_jacobian(x);
      const P ap = a * p;
      const Tangent<X> pull = p * seen.state;
      return Rates<X>{plain.rate(x) + pull,
                      P(ap + ap.transpose() + plain.spectral_density(x) - p * seen.matrix * p)};
    };
    if (const Status status = judge(plain, belief.mean); status != Status::accepted) return status;
    if (const Status status = judge(plain_sensor, belief.mean); status != Status::accepted) return status;
    Gaussian<X> next = belief;
    const Status status = integrate<Matrices::covariances>(next.mean, next.covariance, rate, dt);
    if (misfit()) return Status::size_mismatch;
    if (status == Status::accepted) belief = next;
    return status;
  }

  /// The same in information form: point and Y move together, y is zero throughout. Y must be positive
  /// definite for the estimate to move.
  template <class F, class H, class U = detail::ControlOf<F>, class V = typename H::Measurement>
    requires(ContinuousProcess<F> || detail::explain_sizes<F>) &&
            (LinearisedMeasurement<H> || detail::explain_sensor<H>)
  Status filter(InformationBelief<typename F::State>& belief, const F& process, const H& sensor, const V& z,
                double dt, const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    using P = CovarianceOf<X>;
    const int n = detail::common_size(belief.point, belief.information, belief.vector);
    const detail::PlainProcess plain(process, n, control);
    const detail::PlainSensor plain_sensor(sensor, n, z);
    const auto misfit = [&] { return plain.misfit() || plain_sensor.misfit(); };
    if (misfit()) return Status::size_mismatch;
    InformationBelief<X> next = belief;
    if (!InformationFilter::recentre(next)) return Status::not_positive_definite;
    const auto rate = [&](const X& x, const P& y) {
      const auto seen = look(plain_sensor, x);
      const P a = plain.rate_jacobian(x);
      const P ya = y * a;
      const Tangent<X> pull = Cholesky<dof<X>, ScalarOf<X>>(y).solve(seen.state);
      return Rates<X>{plain.rate(x) + pull,
                      P(seen.matrix - ya - ya.transpose() - y * plain.spectral_density(x) * y)};
    };
    Status status = judge(plain, next.point);
    if (status == Status::accepted) status = judge(plain_sensor, next.point);
    if (status == Status::accepted)
      status = integrate<Matrices::informations>(next.point, next.information, rate, dt);
    if (misfit()) return Status::size_mismatch;
    if (status == Status::accepted) belief = next;
    return status;
  }

private:
  enum class Matrices { covariances, informations };

  template <class F, class U, Manifold X>
  static Status judge(const detail::PlainProcess<F, U>& process, const X& x) {
    const CovarianceOf<X> q = process.spectral_density(x);
    if (process.misfit()) return Status::size_mismatch;
    return detail::check_noise<dof<X>, ScalarOf<X>>(q);
  }
  template <class H, class V, Manifold X>
  static Status judge(const detail::PlainSensor<H, V>& sensor, const X& x) {
    using S = ScalarOf<X>;
    constexpr int m = dof<typename H::Measurement>;
    const Matrix<m, m, S> r = detail::dense_of(sensor.noise(x));
    if (sensor.misfit()) return Status::size_mismatch;
    if (!all_finite(r)) return Status::not_finite;
    const Cholesky<m, S> root(r);
    return root.good() && root.least_share() > detail::digits_left<S> ? Status::accepted
                                                                      : Status::not_positive_definite;
  }

  template <Manifold X>
  struct Rates {
    Tangent<X> state;
    CovarianceOf<X> matrix;

    friend Rates operator+(const Rates& a, const Rates& b) {
      return {a.state + b.state, a.matrix + b.matrix};
    }
    friend Rates operator*(const ScalarOf<X>& by, const Rates& a) { return {by * a.state, by * a.matrix}; }
  };
  template <Manifold X>
  struct Moving {
    X state;
    CovarianceOf<X> matrix;
  };

  /// What the sensor says at x: H^T R^-1 H and H^T R^-1 (z - h(x)); NaN where R is not positive definite.
  template <class H, class V, Manifold X>
  static Rates<X> look(const detail::PlainSensor<H, V>& sensor, const X& x) {
    using S = ScalarOf<X>;
    constexpr int m = dof<typename H::Measurement>;
    const Matrix<m, dof<X>, S> h = detail::dense_of(sensor.jacobian(x));
    const Matrix<m, m, S> r = detail::dense_of(sensor.noise(x));
    const Vector<m, S> residual = sensor.residual(x);
    const Cholesky<m, S> root(r);
    return {h.transpose() * root.solve(residual), h.transpose() * root.solve(h)};
  }

  /// One part of the rule.
  template <Manifold X, class Rate>
  static void advance(X& x, CovarianceOf<X>& p, const Rate& rate, ScalarOf<X> h) {
    const auto slope = [&](ScalarOf<X>, const Moving<X>& at) { return rate(at.state, at.matrix); };
    const auto move = [](const Moving<X>& from, const Rates<X>& by) {
      return Moving<X>{retract(from.state, by.state), from.matrix + by.matrix};
    };
    const Moving<X> to = runge_kutta_4(Moving<X>{x, p}, ScalarOf<X>(0), h, slope, move);
    x = to.state;
    p = symmetrised(to.matrix);
  }

  /// How far two results are apart, in standard deviations of the second; infinity where one is no number.
  /// What rounding of the way from (start, before) may explain does not count.
  template <Matrices Kept, Manifold X>
  static ScalarOf<X> distance(const X& start, const CovarianceOf<X>& before, const X& x,
                              const CovarianceOf<X>& p, const X& to, const CovarianceOf<X>& after) {
    using S = ScalarOf<X>;
    using std::abs;
    using std::sqrt;
    constexpr S rounding = S(64) * std::numeric_limits<S>::epsilon();
    if (!all_finite(p) || !all_finite(after) || !detail::finite_state(x) || !detail::finite_state(to))
      return std::numeric_limits<S>::infinity();
    const Tangent<X> gap = local(x, to), way = local(start, to);
    const int n = static_cast<int>(gap.size());
    S worst(0);
    const auto note = [&](S error, S allowed, S unit) {
      error = abs(error) - allowed;
      if (error > S(0) && !(error <= worst * unit)) worst = error / unit;
    };
    for (int i = 0; i < n; ++i) {
      S size = abs(way(i));
      if constexpr (detail::is_vector<X>) size += abs(to(i));
      const S root = after(i, i) > S(0) ? S(sqrt(after(i, i))) : S(0);
      note(gap(i), rounding * size, Kept == Matrices::covariances ? root : S(1) / root);
      for (int j = 0; j <= i; ++j) {
        const S unit = root * (after(j, j) > S(0) ? S(sqrt(after(j, j))) : S(0));
        const S old = sqrt(abs(before(i, i))) * sqrt(abs(before(j, j)));
        note(p(i, j) - after(i, j), rounding * (unit + old), unit);
      }
    }
    return worst;
  }

  template <Matrices Kept, Manifold X, class Rate>
  Status integrate(X& state, CovarianceOf<X>& matrix, const Rate& rate, double dt) const {
    using S = ScalarOf<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    if (steps < 1 || most_parts < 1 || !(tolerance > 0.0)) return Status::bad_option;
    if (!all_finite(matrix) || !detail::finite_state(state)) return Status::not_finite;
    if (!detail::is_valid_covariance<dof<X>, S>(matrix)) return Status::not_positive_definite;
    X x = state;
    CovarianceOf<X> p = matrix;
    double time = 0.0, part = dt / steps;
    int parts = 0, kept = 0;
    const auto limit = static_cast<S>(tolerance);
    while (time < dt) {
      if (++parts > most_parts || !(time + part > time)) return Status::not_converged;
      const bool last = !(time + part * (1.0 + 1e-9) < dt);
      const S h = static_cast<S>(last ? dt - time : part);
      X whole = x, halves = x;
      CovarianceOf<X> whole_p = p, halves_p = p;
      advance(whole, whole_p, rate, h);
      advance(halves, halves_p, rate, h / S(2));
      advance(halves, halves_p, rate, h / S(2));
      const S error = distance<Kept>(x, p, whole, whole_p, halves, halves_p);
      if (!(error <= limit) || !detail::is_valid_covariance<dof<X>, S>(halves_p)) {
        part = static_cast<double>(h) / 2;
        kept = 0;
        continue;
      }
      x = halves;
      p = halves_p;
      time = last ? dt : time + part;
      if (++kept > 4 && error < limit / S(64) && 2 * part <= dt / steps) part *= 2;
    }
    state = x;
    matrix = p;
    return Status::accepted;
  }
};

}}  // namespace cairn::CAIRN_ABI
