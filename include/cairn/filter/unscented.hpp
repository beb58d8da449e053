// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The unscented Kalman filter on manifolds, and the cubature filter.
///
///   predict   (x, P) <- transform of (x, P) by f, then P + Q
///   update    points drawn anew from the predicted P (so that they know Q), z and S from h, plus R:
///             x <- x (+) C S^-1 (z (-) h),   P <- P - C S^-1 C^T
/// (S. Julier, J. Uhlmann, "Unscented filtering and nonlinear estimation", Proc. IEEE 92, 2004; I.
/// Arasaratnam, S. Haykin, "Cubature Kalman filters", IEEE Trans. Automatic Control 54, 2009.) On a linear
/// model this is the Kalman filter for every alpha, beta and kappa. Noise that is not additive:
/// augmented.hpp.
#pragma once

#include <concepts>
#include <limits>

#include <cairn/filter/correct.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/sigma_points.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

namespace detail {

/// The update when only moments are known: C = cov(x, z), S = cov(z). Same checks as correct().
template <Manifold X, int M>
[[nodiscard]] Innovation<M, ScalarOf<X>> correct_by_moments(Gaussian<X>& belief,
                                                            const Matrix<dof<X>, M, ScalarOf<X>>& cross,
                                                            const Matrix<M, M, ScalarOf<X>>& covariance,
                                                            const Vector<M, ScalarOf<X>>& residual,
                                                            double gate) {
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  Innovation<M, S> in = fresh_innovation<M, S>(residual, symmetrised(covariance));
  const int m = static_cast<int>(residual.size());
  Matrix<M, M, S> lower = in.covariance;
  const bool regular = checked_root<M, S>(in.covariance, lower) && (lower.diagonal().array() > S(0)).all();
  Matrix<n, M, S> w = cross;
  Vector<M, S> y = residual;
  for (int j = 0; j < m; ++j) {
    for (int k = 0; k < j; ++k) {
      w.col(j) -= lower(j, k) * w.col(k);
      y(j) -= lower(j, k) * y(k);
    }
    w.col(j) /= lower(j, j);
    y(j) /= lower(j, j);
  }
  in.nis = y.dot(y);
  CovarianceOf<X> next = belief.covariance;
  const Tangent<X> step = w * y;
  if constexpr (n != dynamic && M != dynamic) {
    Column<n, S> columns[n], squares[M];
    for (int j = 0; j < n; ++j) columns[j].load(next.data() + j * n);
    for (int k = 0; k < M; ++k) squares[k].load(w.data() + k * n);
    lower_by_squares(columns, squares);
    for (int j = 0; j < n; ++j) columns[j].store(next.data() + j * n);
  } else {
    next = symmetrised(next - w * w.transpose());
  }
  if (!regular || !(gate > 0.0) || !(in.nis <= static_cast<S>(gate)) ||
      !(in.nis <= std::numeric_limits<S>::max()) || !is_valid_covariance<n, S>(next) ||
      !finite_state(belief.mean)) {
    in.status = diagnose<M, S>(in, belief.covariance, gate);
    return in;
  }
  belief.mean = retract(belief.mean, step);
  belief.covariance = next;
  return in;
}

}  // namespace detail

/// Unscented Kalman filter with additive noise. Options only: may serve any number of beliefs and threads.
struct Unscented {
  SigmaPoints points{};
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: the propagated P is multiplied by this; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0

  /// Moves the belief by one step of dt. Refused: dt < 0, anything not finite, a P that is no covariance.
  template <ProcessModel F>
  Status predict(Gaussian<typename F::State>& belief, const F& process, const typename F::Control& control,
                 double dt) const {
    using X = typename F::State;
    using S = ScalarOf<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    const int n = dof_of(belief.mean);
    if (belief.covariance.rows() != n) return Status::size_mismatch;
    const double c2 = points.spread_squared(n);
    if (!(fading >= 1.0) || !(stabilising_noise >= 0.0) || !(c2 > 0.0)) return Status::bad_option;
    CovarianceOf<X> root = belief.covariance;
    if (!detail::checked_root<dof<X>, S>(belief.covariance, root)) return refusal<X>(belief);
    const auto f = [&](const X& x) -> X { return process.propagate(x, control, dt); };
    const auto next = detail::unscented_transform(belief.mean, root, f, c2, beta_minus_alpha2());
    CovarianceOf<X> covariance = next.covariance * static_cast<S>(fading);
    covariance += symmetrised(CovarianceOf<X>(process.noise(belief.mean, control, dt)));
    for (int i = 0; i < n; ++i) covariance(i, i) += static_cast<S>(stabilising_noise);
    if (!detail::all_finite(covariance) || !detail::finite_state(next.mean)) return Status::not_finite;
    if (!detail::is_valid_covariance<dof<X>, S>(covariance)) return Status::not_positive_definite;
    belief.mean = next.mean;
    belief.covariance = covariance;
    return Status::accepted;
  }
  template <ProcessModel F>
    requires std::same_as<typename F::Control, NoControl>
  Status predict(Gaussian<typename F::State>& belief, const F& process, double dt) const {
    return predict(belief, process, NoControl{}, dt);
  }

  /// Takes in the measurement z, or refuses it and leaves the belief as it was.
  template <MeasurementModel H>
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      Gaussian<typename H::State>& belief, const H& sensor, const typename H::Measurement& z) const {
    using X = typename H::State;
    using Z = typename H::Measurement;
    using S = ScalarOf<X>;
    constexpr int m = dof<Z>;
    const double c2 = points.spread_squared(static_cast<int>(belief.covariance.rows()));
    CovarianceOf<X> root = belief.covariance;
    if (!(c2 > 0.0) || !detail::checked_root<dof<X>, S>(belief.covariance, root)) {
      auto in =
          detail::fresh_innovation<m, S>(local(Z(sensor.predict(belief.mean)), z), sensor.noise(belief.mean));
      in.status = c2 > 0.0 ? refusal<X>(belief) : Status::bad_option;
      return in;
    }
    const auto h = [&](const X& x) -> Z { return sensor.predict(x); };
    const auto out = detail::unscented_transform(belief.mean, root, h, c2, beta_minus_alpha2());
    return detail::correct_by_moments<X, m>(belief, out.cross, out.covariance + sensor.noise(belief.mean),
                                            local(out.mean, z), gate);
  }

private:
  [[nodiscard]] double beta_minus_alpha2() const noexcept {
    return points.beta - points.alpha * points.alpha;
  }

  template <Manifold X>
  [[nodiscard]] static Status refusal(const Gaussian<X>& belief) {
    return detail::all_finite(belief.covariance) ? Status::not_positive_definite : Status::not_finite;
  }
};

/// The cubature Kalman filter: 2n equally weighted points at sqrt(n) standard deviations.
[[nodiscard]] inline Unscented cubature() {
  return {.points = {.alpha = 1.0, .beta = 0.0, .kappa = 0.0}};
}

}  // namespace cairn::inline CAIRN_ABI
