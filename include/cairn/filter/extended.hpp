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
/// a Gauss-Newton method", IEEE Trans. Automatic Control 38, 1993); a step that does not lower the cost
///   |u|^2 + r^T R^-1 r,   e = L u,   P = L L^T,   r = z (-) h(x (+) L u),   R as at the last x_k
/// is halved. P may be singular: what it is certain of does not move. Each step is solved by the array of
/// array_update.hpp. The error lives in the tangent space at the mean (an error-state filter).
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <utility>

#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/array_update.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/derivatives.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Extended Kalman filter. Options only: may serve any number of beliefs and threads.
struct Extended {
  Form form = Form::standard;
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: F P F^T is multiplied by this each step; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0
  int iterations = 1;              ///< of the update, at most; 1 is the plain filter
  double tolerance = 1e-10;        ///< iterations end when the step changes by less, in the new deviations
  double settled = 1e-3;           ///< refused as not_converged where they end with a larger change

  /// Moves the belief by one step of dt. Refused: dt < 0, anything not finite.
  template <class F, class U = detail::ControlOf<F>>
    requires(LinearisedProcess<F> || detail::explain_process<F> ||
             detail::explain_jacobian<F, ProcessModel<F>>)
  Status predict(Gaussian<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
    return detail::predict_linearised(belief, process, control, dt, fading, stabilising_noise);
  }

  /// Takes in the measurement z, or refuses it and leaves the belief as it was. The innovation is the one
  /// before the update, whatever the iterations. Where R is singular there is no cost to compare, and
  /// iterations take full steps.
  template <class H, class V = typename H::Measurement>
    requires(LinearisedMeasurement<H> || detail::explain_sensor<H> ||
             detail::explain_jacobian<H, MeasurementModel<H>>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      Gaussian<typename H::State>& belief, const H& sensor, const V& z) const {
    const detail::PlainSensor plain(sensor, detail::common_size(belief.mean, belief.covariance), z);
    if (iterations == 1) [[likely]]
      return detail::update_linearised(belief, plain, gate, form);
    Gaussian<typename H::State> first = belief;
    auto innovation = detail::update_linearised(first, plain, gate, form);
    if (iterations < 1 || !(tolerance >= 0.0) || !(settled >= 0.0)) innovation.status = Status::bad_option;
    if (!innovation.accepted()) return innovation;
    first = belief;
    innovation.status = iterate(first, plain);
    if (plain.misfit()) innovation.status = Status::size_mismatch;
    if (innovation.accepted()) belief = first;
    return innovation;
  }

private:
  template <class H, class V>
  Status iterate(Gaussian<typename H::State>& belief, const detail::PlainSensor<H, V>& sensor) const;
};

namespace detail {

/// Derivative at d = e of the step seen from x = prior (+) e: how tangent vectors move from the prior's mean
/// to x. Nothing to move between vectors: their tangent space is one.
template <Manifold X>
[[nodiscard]] CovarianceOf<X> transport(const X& prior, const Tangent<X>& e) {
  return numeric_jacobian([&](const Tangent<X>& d) -> X { return retract(prior, d); }, e);
}

/// The longest of the steps `moved`, made at `e`, in standard deviations after the update; less what rounding
/// alone moves. Roots of the covariances before and after.
template <int N, class S>
[[nodiscard]] S deviations_moved(const Vector<N, S>& moved, const Vector<N, S>& e,
                                 const Matrix<N, N, S>& root, const Matrix<N, N, S>& updated) {
  using std::abs;
  using std::sqrt;
  const int n = static_cast<int>(moved.size());
  S size(0);
  for (int i = 0; i < n; ++i) {
    S after(0), before(0);
    for (int j = 0; j < n; ++j) {
      after += updated(i, j) * updated(i, j);
      before += root(i, j) * root(i, j);
    }
    const S rounding = S(64) * std::numeric_limits<S>::epsilon() * (sqrt(before) + abs(e(i)));
    const S beyond = abs(moved(i)) - rounding;
    if (beyond > S(0) && !(beyond <= size * sqrt(after))) size = beyond / sqrt(after);
  }
  return size;
}

/// What the iteration lowers: |u|^2 + |W^-1 r|^2, W the lower root of the noise's covariance.
template <int N, int M, class S>
[[nodiscard]] S cost_of(const Vector<N, S>& u, const Vector<M, S>& r, const Matrix<M, M, S>& white) {
  S sum(0);
  for (int i = 0; i < static_cast<int>(u.size()); ++i) sum += u(i) * u(i);
  Vector<M, S> y = r;
  for (int i = 0; i < static_cast<int>(r.size()); ++i) {
    for (int j = 0; j < i; ++j) y(i) -= white(i, j) * y(j);
    y(i) /= white(i, i);
    sum += y(i) * y(i);
  }
  return sum;
}

}  // namespace detail

template <class H, class V>
Status Extended::iterate(Gaussian<typename H::State>& belief, const detail::PlainSensor<H, V>& sensor) const {
  using X = typename H::State;
  using Z = typename H::Measurement;
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  constexpr int m = dof<Z>;
  CovarianceOf<X> root = belief.covariance;
  if (!detail::checked_root<n, S>(belief.covariance, root)) return Status::not_positive_definite;
  const int ns = static_cast<int>(root.rows());
  Tangent<X> u = Tangent<X>::Zero(ns), e = u;
  Vector<m, S> residual = sensor.residual(belief.mean);
  const int ms = static_cast<int>(residual.size());
  CovarianceOf<X> updated = root;  // a root of the covariance in the tangent space of the prior
  bool done = false;
  S size(0);  // of the last change
  for (int k = 0; k < iterations && !done; ++k) {
    const X x = retract(belief.mean, e);
    Matrix<m, n, S> h = detail::dense_of(sensor.jacobian(x));
    if constexpr (!detail::is_vector<X>) h = (h * detail::transport(belief.mean, e)).eval();
    const Matrix<m, m, S> noise = detail::dense_of(sensor.noise(x));
    if (sensor.misfit()) return Status::size_mismatch;
    if (!all_finite(h) || !all_finite(noise) || !all_finite(residual)) return Status::not_finite;
    Matrix<m, m, S> root_r = noise, white_r = noise;
    if (!detail::rare_root<m, S>(noise, root_r)) return Status::not_positive_definite;
    const bool has_cost = detail::regular_root<m, S>(noise, white_r);
    const Matrix<m, n, S> g = detail::column_product(h, root);
    Matrix<detail::size_sum<m, n>, detail::size_sum<m, n>, S> array(ms + ns, ms + ns);
    array.setZero();
    detail::put_transposed(array, 0, 0, root_r);
    detail::put_transposed(array, ms, 0, g);
    for (int i = 0; i < ns; ++i) array(ms + i, ms + i) = S(1);
    auto update = detail::update_by_array<n, m, S, detail::Wanted::rarely>(
        array, Vector<m, S>(residual + detail::column_product(g, u)), ns);
    if (!update.regular || !all_finite(update.step)) return Status::not_positive_definite;
    updated = detail::column_product(root, update.root);
    update.white = detail::column_product(root, update.white);
    std::swap(update.root, updated);  // determined() looks at the roots of the result
    if (!detail::determined<n, m, S, detail::Wanted::rarely>(update, root, h, noise,
                                                             detail::KeptAs::covariance))
      return Status::not_positive_definite;
    std::swap(update.root, updated);
    Tangent<X> change = update.step - u;
    const Tangent<X> moved = detail::column_product(root, change);
    size = detail::deviations_moved<n, S>(moved, e, root, updated);
    done = size <= static_cast<S>(tolerance);
    const S now = has_cost ? detail::cost_of<n, m, S>(u, residual, white_r) : S(0);
    const S enough = now + S(16) * std::numeric_limits<S>::epsilon() * now;
    bool lower = false;
    for (int halving = 0; halving < 40 && !lower; ++halving) {
      const Tangent<X> next = u + change;
      const Tangent<X> next_e = detail::column_product(root, next);
      const Vector<m, S> next_residual = sensor.residual(retract(belief.mean, next_e));
      lower = done || (has_cost ? detail::cost_of<n, m, S>(next, next_residual, white_r) <= enough
                                : all_finite(next_residual));
      if (lower) {
        u = next;
        e = next_e;
        residual = next_residual;
      }
      change *= S(0.5);
    }
    if (!lower) break;  // no descent left above rounding
  }
  if (!(size <= static_cast<S>(settled))) return Status::not_converged;
  const X mean = retract(belief.mean, e);
  if constexpr (!detail::is_vector<X>)
    updated = detail::column_product(detail::transport(belief.mean, e), updated);
  const CovarianceOf<X> covariance = detail::squared_root<n, S>(updated);
  if (!all_finite(covariance) || !detail::finite_state(mean)) return Status::not_finite;
  belief.mean = mean;
  belief.covariance = covariance;
  return Status::accepted;
}

}}  // namespace cairn::CAIRN_ABI
