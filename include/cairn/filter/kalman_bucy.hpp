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
/// the classical Runge-Kutta rule in `steps` equal parts. Measurements at instants go through Kalman,
/// Extended or InformationFilter: together that is the continuous-discrete filter.
///
///   struct Drifting {
///     using State = Vector<2>;  using Control = NoControl;
///     Tangent<State> rate(const State& x, const Control& u) const;        // per second
///     Matrix<2> rate_jacobian(const State& x, const Control& u) const;    // A
///     Matrix<2> spectral_density(const State& x, const Control& u) const; // Q, per second
///   };
#pragma once

#include <concepts>
#include <limits>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/plain_model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// A process in continuous time.
template <class F>
concept ContinuousProcess = Manifold<typename F::State> &&
                            requires(const F& f, const typename F::State& x, const typename F::Control& u) {
                              { f.rate(x, u) } -> StateOf<Tangent<typename F::State>>;
                              { f.rate_jacobian(x, u) } -> detail::CovarianceLike<typename F::State>;
                              { f.spectral_density(x, u) } -> detail::CovarianceLike<typename F::State>;
                            };

/// Kalman-Bucy filter. Options only. For states that are not vectors the rate is taken in the tangent space
/// at the start of each part.
struct KalmanBucy {
  int steps = 1;  ///< Runge-Kutta parts of one call; >= 1

  /// Moves the belief by dt without measurement.
  template <class F, class U = typename F::Control>
    requires(ContinuousProcess<F> || detail::explain_sizes<F>)
  Status predict(Gaussian<typename F::State>& belief, const F& process, const U& control, double dt) const {
    using X = typename F::State;
    using P = CovarianceOf<X>;
    const detail::PlainProcess plain(process, detail::common_size(belief.mean, belief.covariance), control);
    if (plain.misfit()) return Status::size_mismatch;
    const auto rate = [&](const X& x, const P& p) {
      const P a = plain.rate_jacobian(x);
      const P ap = a * p;
      return Rates<X>{plain.rate(x), P(ap + ap.transpose() + plain.spectral_density(x))};
    };
    const Status status = integrate(belief.mean, belief.covariance, rate, dt);
    return plain.misfit() ? Status::size_mismatch : status;
  }

  /// Moves the belief by dt while the sensor reports z, held constant; sensor.noise() is a spectral density.
  template <class F, class H, class U = typename F::Control, class V = typename H::Measurement>
    requires(ContinuousProcess<F> || detail::explain_sizes<F>) &&
            (LinearisedMeasurement<H> || detail::explain_sizes<H>)
  Status filter(Gaussian<typename F::State>& belief, const F& process, const U& control, const H& sensor,
                const V& z, double dt) const {
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
    const Status status = integrate(belief.mean, belief.covariance, rate, dt);
    return misfit() ? Status::size_mismatch : status;
  }

  /// The same in information form: point and Y move together, y is zero throughout. Y must be positive
  /// definite for the estimate to move.
  template <class F, class H, class U = typename F::Control, class V = typename H::Measurement>
    requires(ContinuousProcess<F> || detail::explain_sizes<F>) &&
            (LinearisedMeasurement<H> || detail::explain_sizes<H>)
  Status filter(InformationBelief<typename F::State>& belief, const F& process, const U& control,
                const H& sensor, const V& z, double dt) const {
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
    const Status status = integrate(next.point, next.information, rate, dt);
    if (misfit()) return Status::size_mismatch;
    if (status == Status::accepted) belief = next;
    return status;
  }

private:
  template <Manifold X>
  struct Rates {
    Tangent<X> state;
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

  template <Manifold X, class Rate>
  Status integrate(X& state, CovarianceOf<X>& matrix, const Rate& rate, double dt) const {
    using S = ScalarOf<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    if (steps < 1) return Status::bad_option;
    const S h = static_cast<S>(dt / steps);
    X x = state;
    CovarianceOf<X> p = matrix;
    const auto at = [&](const Rates<X>& k, S by) {
      return rate(retract(x, Tangent<X>(by * k.state)), CovarianceOf<X>(p + by * k.matrix));
    };
    for (int part = 0; part < steps; ++part) {
      const Rates<X> k1 = rate(x, p);
      const Rates<X> k2 = at(k1, h / S(2));
      const Rates<X> k3 = at(k2, h / S(2));
      const Rates<X> k4 = at(k3, h);
      x = retract(x, Tangent<X>(h / S(6) * (k1.state + S(2) * (k2.state + k3.state) + k4.state)));
      p = symmetrised(p + h / S(6) * (k1.matrix + S(2) * (k2.matrix + k3.matrix) + k4.matrix));
    }
    if (!all_finite(p) || !detail::finite_state(x)) return Status::not_finite;
    if (!detail::is_valid_covariance<dof<X>, S>(p)) return Status::not_positive_definite;
    state = x;
    matrix = p;
    return Status::accepted;
  }
};

}  // namespace cairn::inline CAIRN_ABI
