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
/// augmented_unscented.hpp.
#pragma once

#include <concepts>
#include <limits>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/array_update.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/unscented_transform.hpp>
#include <cairn/filter/vectorised.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// The update when only moments are known: C = cov(x, z) and S = cov(z), both used up, S lower triangle.
/// Same checks as correct(); digits_of_points(), and again() as in reconsider().
template <Manifold X, int M, class S, class Again>
[[gnu::always_inline]] inline void correct_by_moments(Gaussian<X>& belief, Column<dof<X>, S> (&cross)[M],
                                                      Innovation<M, S>& in, double gate, S digits,
                                                      const Again& again) {
  constexpr int n = dof<X>;
  Candidate<n, M, S> out{};
  Column<n, S>(&p)[n] = out.covariance;
  load_columns(belief.covariance, p);
  Correction<n, M, S> c;
  const bool regular = c.fill(in.covariance, cross);
  digits *= c.loss;
  const bool sound = regular && digits < S(1);
  in.nis = c.take(in.residual.data(), out.step);
  lower_by_squares(p, c.w);
  const bool good =
      sound && gate > 0.0 && in.nis <= static_cast<S>(gate) && in.nis <= std::numeric_limits<S>::max() &&
      keeps_digits<n, S>(p, belief.covariance, digits) && is_covariance(p) && finite_state(belief.mean);
  if (!good) [[unlikely]] {
    out.innovation = in;
    if (finite_state(belief.mean))
      reconsider(out, belief.covariance, gate, sound, again);
    else
      out.innovation.status = gate > 0.0 ? Status::not_finite : Status::bad_option;
    in = out.innovation;
    if (in.status != Status::accepted) return;
  }
  Tangent<X> step;
  out.step_to(step);
  if (move_by(belief.mean, step)) [[likely]]
    out.covariance_to(belief.covariance);
  else
    in.status = Status::not_finite;
}

/// The same from matrices.
template <Manifold X, int M, class S, class Again>
void correct_by_moments(Gaussian<X>& belief, const Matrix<dof<X>, M, S>& cross, Innovation<M, S>& in,
                        double gate, S digits, const Again& again) {
  constexpr int n = dof<X>;
  in.covariance = symmetrised(in.covariance);
  Column<n, S> columns[M];
  for (int j = 0; j < M; ++j) columns[j].load(cross.data() + j * n);
  correct_by_moments<X, M, S>(belief, columns, in, gate, digits, again);
}
template <Manifold X, int M, class S, class Again>
  requires(dof<X> == dynamic || M == dynamic)
void correct_by_moments(Gaussian<X>& belief, const Matrix<dof<X>, M, S>& cross, Innovation<M, S>& in,
                        double gate, S digits, const Again& again) {
  constexpr int n = dof<X>;
  in.covariance = symmetrised(in.covariance);
  const Cholesky<M, S> root(in.covariance);
  digits /= root.least_share();
  const bool sound = root.good() && digits < S(1);
  const Matrix<M, n, S> w = root.whiten(transposed(cross));  // S^-1/2 C^T
  const Vector<M, S> y = root.whiten(in.residual);
  in.nis = y.dot(y);
  Candidate<n, M, S> out{in, transposed_product(w, y),
                         symmetrised(belief.covariance - transposed_product(w, w))};
  if (!finite_state(belief.mean)) {
    in.status = gate > 0.0 ? Status::not_finite : Status::bad_option;
    return;
  }
  if (!sound || !(gate > 0.0) || !(in.nis <= static_cast<S>(gate)) ||
      !(in.nis <= std::numeric_limits<S>::max()) ||
      !keeps_digits<n, S>(out.covariance, belief.covariance, digits) ||
      !is_valid_covariance<n, S>(out.covariance)) {
    reconsider(out, belief.covariance, gate, sound, again);
    in = out.innovation;
    if (in.status != Status::accepted) return;
  }
  if (move_by(belief.mean, Tangent<X>(out.step)))
    belief.covariance = out.covariance;
  else
    in.status = Status::not_finite;
}

}  // namespace detail

/// Unscented Kalman filter with additive noise. Options only: may serve any number of beliefs and threads.
struct Unscented {
  SigmaPoints points{};
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: the propagated P is multiplied by this; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0

  /// Moves the belief by one step of dt. Refused: dt < 0, anything not finite, a P that is no covariance.
  template <class F, class U = detail::ControlOf<F>>
    requires(ProcessModel<F> || detail::explain_process<F>)
  Status predict(Gaussian<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    const int n = detail::common_size(belief.mean, belief.covariance);
    const detail::PlainProcess plain(process, n, control);
    if (plain.misfit()) return Status::size_mismatch;
    const double c2 = points.spread_squared(n);
    if (!(fading >= 1.0) || !(stabilising_noise >= 0.0) || !(c2 > 0.0)) return Status::bad_option;
    const auto f = [&](const auto& x) { return plain.propagate(x, dt); };
    const detail::PointFunction<detail::is_vectorised<F>, decltype(f)> points_to{f};
    decltype(auto) q = plain.noise(belief.mean, dt);
    if (plain.misfit()) return Status::size_mismatch;
    return advance(belief, plain, points_to, q, c2);
  }

  /// Takes in the measurement z, or refuses it and leaves the belief as it was.
  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      Gaussian<typename H::State>& belief, const H& sensor, const V& z) const {
    const int size = detail::common_size(belief.mean, belief.covariance);
    const detail::PlainSensor plain(sensor, size, z);
    if (plain.misfit()) return detail::misfitting(plain);
    const double c2 = points.spread_squared(size);
    if (!(c2 > 0.0)) return refused(belief, plain, Status::bad_option);
    return updated(belief, plain, c2);
  }

private:
  /// The update by the array of square_root.hpp, for reconsider().
  template <class H, Manifold X, int M, class S>
  [[nodiscard]] auto by_array(const Gaussian<X>& belief, const H& sensor, const Matrix<M, M, S>& r,
                              const Innovation<M, S>& in, double c2, S digits) const {
    return [&, c2, digits](detail::ArrayUpdate<dof<X>, M, S>& update) {
      using Z = typename H::Measurement;
      constexpr int n = dof<X>;
      const int ns = static_cast<int>(belief.covariance.rows()), ms = static_cast<int>(in.residual.size());
      constexpr bool fixed = n != dynamic && M != dynamic;
      constexpr int of_array = fixed ? (2 * n + 1 + M) * (M + n) : dynamic;
      CovarianceOf<X> root = belief.covariance;
      if (!detail::rare_root<n, S>(belief.covariance, root)) return Status::not_positive_definite;
      detail::Room<S, of_array> room_of_array((2 * ns + 1 + ms) * (ms + ns));
      detail::View<S> array(room_of_array.data(), 2 * ns + 1 + ms, ms + ns);
      static_cast<void>(detail::sigma_rows(
          belief.mean, root, [&](const X& x) -> Z { return sensor.predict(x); }, c2, beta_minus_alpha2(),
          array));
      update.make_room(ns, ms);
      Vector<M, S> y = in.residual;
      detail::Room<S, detail::room_by_points(n, M)> numbers(detail::room_by_points(ns, ms));
      return detail::update_by_points<S>(array, detail::view(root), detail::view(r),
                                         detail::view(update.root_s), detail::view(update.root),
                                         detail::view(update.white), detail::view(update.step),
                                         detail::view(y), digits, update, numbers.data());
    };
  }

  /// Update for sizes known at compile time.
  template <Manifold X, class H, class V>
    requires(dof<X> != dynamic && dof<typename H::Measurement> != dynamic)
  [[gnu::always_inline]] Innovation<dof<typename H::Measurement>, ScalarOf<X>> updated(
      Gaussian<X>& belief, const detail::PlainSensor<H, V>& plain, double c2) const {
    using Z = typename H::Measurement;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>, m = dof<Z>;
    detail::Column<n, S> root[n];
    if (!detail::covariance_root(belief.covariance, root)) [[unlikely]]
      return refused(belief, plain, refusal<X>(belief));
    const Z center = plain.predict(belief.mean);
    const auto f = [&](const auto& x) { return plain.predict(x); };
    const detail::PointFunction<detail::is_vectorised<H>, decltype(f)> h{f};
    auto moments = detail::sum_points<detail::Pairs::with_cross>(belief.mean, root, h, detail::spread<S>(c2),
                                                                 beta_minus_alpha2(), center);
    Tangent<Z> mean;
    moments.mean.store(mean.data());
    Innovation<m, S> in;
    in.residual = local(Z(retract(center, mean)), plain.z());
    const Matrix<m, m, S> r = detail::dense_of(plain.noise(belief.mean));
    if (plain.misfit()) return detail::misfitting(plain);
    detail::each<m>([&](int b) __attribute__((always_inline)) {
      detail::each<m>(b, m, [&](int a) {
        in.covariance(a, b) = in.covariance(b, a) = moments.covariance[b][a] + r(a, b);
      });
    });
    const S digits = detail::digits_of_points(belief.mean, belief.covariance, center, in.covariance);
    detail::correct_by_moments<X, m, S>(belief, moments.cross, in, gate, digits,
                                        by_array(belief, plain, r, in, c2, digits));
    return in;
  }

  /// The same for sizes known at run time, where points go one by one.
  template <Manifold X, class H, class V>
    requires(dof<X> == dynamic || dof<typename H::Measurement> == dynamic)
  Innovation<dof<typename H::Measurement>, ScalarOf<X>> updated(Gaussian<X>& belief,
                                                                const detail::PlainSensor<H, V>& plain,
                                                                double c2) const {
    using Z = typename H::Measurement;
    using S = ScalarOf<X>;
    constexpr int m = dof<Z>;
    CovarianceOf<X> root = belief.covariance;
    if (!detail::checked_root<dof<X>, S>(belief.covariance, root))
      return refused(belief, plain, refusal<X>(belief));
    const auto out = detail::unscented_transform(
        belief.mean, root, [&](const X& x) -> Z { return plain.predict(x); }, c2, beta_minus_alpha2());
    const Matrix<m, m, S> r = detail::dense_of(plain.noise(belief.mean));
    if (plain.misfit()) return detail::misfitting(plain);
    auto in = detail::fresh_innovation<m, S>(local(out.mean, plain.z()), out.covariance);
    in.covariance += r;
    const S digits = detail::digits_of_points(belief.mean, belief.covariance, out.mean, in.covariance);
    detail::correct_by_moments<X, m, S>(belief, out.cross, in, gate, digits,
                                        by_array(belief, plain, r, in, c2, digits));
    return in;
  }

  /// Predict for sizes known at compile time.
  template <Manifold X, class Process, class F, class Q>
    requires(dof<X> != dynamic)
  [[gnu::always_inline]] Status advance(Gaussian<X>& belief, const Process& process, const F& f, const Q& q,
                                        double c2) const {
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    detail::Column<n, S> root[n], noise[n];
    if (!detail::covariance_root(belief.covariance, root)) [[unlikely]]
      return refusal<X>(belief);
    const X center = f(belief.mean);
    auto moments = detail::sum_points<detail::Pairs::without_cross>(
        belief.mean, root, f, detail::spread<S>(c2), beta_minus_alpha2(), center);
    detail::load_columns(q, noise);
    if constexpr (!detail::is_diagonal<Q>) detail::mirror_lower(noise);
    detail::Column<n, S>(&p)[n] = moments.covariance;
    detail::each<n>([&](int j) {
      p[j].scale(static_cast<S>(fading));
      p[j].add(noise[j]);
    });
    if (stabilising_noise > 0.0) [[unlikely]]
      detail::add_to_diagonal(p, static_cast<S>(stabilising_noise));
    Tangent<X> step;
    moments.mean.store(step.data());
    const X mean = retract(center, step);
    if (process.misfit()) return Status::size_mismatch;
    if (!detail::finite_variances(p) || !detail::finite_state(mean)) [[unlikely]]
      return detail::diagnose_prediction(p, mean);
    if (!detail::looks_like_noise<n>(q)) [[unlikely]]
      if (const Status status = detail::judge_noise<n, S>(detail::dense_of(q)); status != Status::accepted)
        return status;
    if (!detail::is_covariance(p)) [[unlikely]]
      return Status::not_positive_definite;
    belief.mean = mean;
    detail::each<n>([&](int j) { p[j].store(belief.covariance.data() + j * n); });
    return Status::accepted;
  }

  /// The same for sizes known at run time.
  template <Manifold X, class Process, class F>
    requires(dof<X> == dynamic)
  Status advance(Gaussian<X>& belief, const Process& process, const F& f, const CovarianceOf<X>& q,
                 double c2) const {
    using S = ScalarOf<X>;
    CovarianceOf<X> root = belief.covariance;
    if (!detail::checked_root<dof<X>, S>(belief.covariance, root)) return refusal<X>(belief);
    if (const Status status = detail::check_noise<dof<X>, S>(q); status != Status::accepted) return status;
    const auto next = detail::unscented_transform(
        belief.mean, root, [&](const X& x) -> X { return f(x); }, c2, beta_minus_alpha2());
    if (process.misfit()) return Status::size_mismatch;
    CovarianceOf<X> covariance = next.covariance * static_cast<S>(fading);
    covariance += symmetrised(q);
    for (int i = 0; i < static_cast<int>(covariance.rows()); ++i)
      covariance(i, i) += static_cast<S>(stabilising_noise);
    if (!all_finite(covariance) || !detail::finite_state(next.mean)) return Status::not_finite;
    if (!detail::is_valid_covariance<dof<X>, S>(covariance)) return Status::not_positive_definite;
    belief.mean = next.mean;
    belief.covariance = covariance;
    return Status::accepted;
  }

  template <class H, class V>
  [[gnu::cold]] Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> refused(
      const Gaussian<typename H::State>& belief, const detail::PlainSensor<H, V>& sensor,
      Status status) const {
    using S = ScalarOf<typename H::State>;
    const auto residual = sensor.residual(belief.mean);
    const CovarianceOf<typename H::Measurement> r = detail::dense_of(sensor.noise(belief.mean));
    if (sensor.misfit()) return detail::misfitting(sensor);
    auto in = detail::fresh_innovation<dof<typename H::Measurement>, S>(residual, r);
    in.status = status;
    return in;
  }

  [[nodiscard]] double beta_minus_alpha2() const noexcept {
    return points.beta - points.alpha * points.alpha;
  }

  template <Manifold X>
  [[nodiscard]] static Status refusal(const Gaussian<X>& belief) {
    return all_finite(belief.covariance) ? Status::not_positive_definite : Status::not_finite;
  }
};

/// The cubature Kalman filter: 2n equally weighted points at sqrt(n) standard deviations.
[[nodiscard]] inline Unscented cubature() {
  return {.points = {.alpha = 1.0, .beta = 0.0, .kappa = 0.0}};
}

}}  // namespace cairn::CAIRN_ABI
