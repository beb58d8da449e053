// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The UD filter: P = U D U^T with unit upper triangular U and diagonal D, without a square root anywhere.
///
///   predict   Thornton's weighted Gram-Schmidt on [F U, U_q] with weights (D, D_q)
///   update    Bierman's recursion, one number of the measurement after the other
/// (G. Bierman, "Factorization Methods for Discrete Sequential Estimation", 1977, chapters V and VI.) The
/// most accurate of the forms here, in float as in double, and the cheapest of the factored ones.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <type_traits>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/thornton_bierman.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Truth = retract(mean, d), d ~ N(0, U diag(D) U^T). Sizes are fixed at compile time.
template <Manifold X>
struct UDGaussian {
  using State = X;
  using Scalar = ScalarOf<X>;
  static_assert(dof<X> != dynamic, "the UD form is for states of fixed size");

  X mean;
  CovarianceOf<X> upper;  ///< U: ones on the diagonal, zeros below
  Tangent<X> diagonal;    ///< D >= 0

  [[nodiscard]] static UDGaussian from(const Gaussian<X>& belief);
  [[nodiscard]] CovarianceOf<X> covariance() const {
    const CovarianceOf<X> scaled = upper * diagonal.asDiagonal();
    return symmetrised(scaled * upper.transpose());
  }
  [[nodiscard]] Gaussian<X> gaussian() const { return {mean, covariance()}; }
};

template <Manifold X>
UDGaussian<X> UDGaussian<X>::from(const Gaussian<X>& belief) {
  UDGaussian result{belief.mean, {}, Tangent<X>::Zero()};
  if (!detail::ud_factor<dof<X>, Scalar>(belief.covariance, result.upper, result.diagonal))
    raise("UDGaussian: the covariance is not finite and positive semi-definite");
  return result;
}

/// Kalman and extended Kalman filter in UD form. Options only.
struct UDFilter {
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: F P F^T is multiplied by this at each predict; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0
  template <Manifold X>
  using BeliefOf = UDGaussian<X>;

  // A function of its own: within the caller's loop its columns would not stay in registers.
  template <class F, class U = detail::ControlOf<F>>
    requires(LinearisedProcess<F> || detail::explain_process<F> ||
             detail::explain_jacobian<F, ProcessModel<F>>)
  [[gnu::noinline]] Status predict(UDGaussian<typename F::State>& belief, const F& process, double dt,
                                   const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    const detail::PlainProcess plain(process, n, control);
    using Jacobian = std::decay_t<decltype(plain.jacobian(belief.mean, dt))>;
    detail::Column<n, S> w[2 * n], u[n], fu[n];
    S weights[2 * n];
    detail::each<n>([&](int j) { weights[j] = belief.diagonal(j); });
    const Status noise = fading == 1.0 && stabilising_noise == 0.0
                             ? factor_noise<n, S>(plain.noise(belief.mean, dt), w, weights)
                             : fade_and_stabilise<X>(plain.noise(belief.mean, dt), w, weights);
    if (plain.misfit()) return Status::size_mismatch;
    if (noise != Status::accepted) return noise;
    detail::load_columns(belief.upper, u);
    detail::each<n>([&](int j) { fu[j].set_zero(); });
    detail::add_product<detail::ProductRows::all>(plain.jacobian(belief.mean, dt), u, fu);
    detail::each<n>([&](int j) { w[j] = fu[j]; });
    const X mean = plain.propagate(belief.mean, dt);
    if (plain.misfit()) return Status::size_mismatch;
    detail::Column<n, S> d;
    detail::weighted_gram_schmidt<detail::upper_triangular<Jacobian>(), n, S>(w, weights, u, d);
    if (!finite(u, d) || !detail::finite_state(mean)) [[unlikely]]
      return Status::not_finite;
    belief.mean = mean;
    keep(belief, u, d);
    return Status::accepted;
  }

  template <class H, class V = typename H::Measurement>
    requires(LinearisedMeasurement<H> || detail::explain_sensor<H> ||
             detail::explain_jacobian<H, MeasurementModel<H>>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      UDGaussian<typename H::State>& belief, const H& sensor, const V& z) const {
    using X = typename H::State;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    constexpr int m = dof<typename H::Measurement>;
    static_assert(m != dynamic, "the UD form takes measurements of fixed size");
    const detail::PlainSensor plain(sensor, n, z);
    const Matrix<m, m, S> r = detail::dense_of(plain.noise(belief.mean));
    const auto jacobian = plain.jacobian(belief.mean);
    Innovation<m, S> in = detail::fresh_innovation<m, S>(plain.residual(belief.mean), r);
    if (plain.misfit()) return detail::misfitting(plain);
    detail::Column<n, S> u[n], d, step;
    detail::load_columns(belief.upper, u);
    d.load(belief.diagonal.data());
    step.set_zero();
    detail::each<n>([&](int j) __attribute__((always_inline)) {  // S += (H u_j) d_j (H u_j)^T
      S seen[m];
      detail::each<m>([&](int i) { seen[i] = row_dot(jacobian, i, u[j]); });
      detail::each<m>([&](int b) __attribute__((always_inline)) {
        detail::each<m>(b, m, [&](int a) { in.covariance(a, b) += seen[a] * (seen[b] * d[j]); });
      });
    });
    detail::mirror_lower(in.covariance);
    if (!(gate > 0.0)) in.status = Status::bad_option;
    bool correlated = false;
    for (int b = 0; b < m; ++b)
      for (int a = b + 1; a < m; ++a) correlated = correlated || r(a, b) != S(0);
    bool regular = !correlated && take(in, jacobian, in.residual, r, u, d, step);
    if (correlated && in.status == Status::accepted)
      in.status = take_correlated(in, detail::dense_of(jacobian), r, belief, u, d, step);
    regular = regular || correlated;
    if (in.status == Status::accepted && !(regular && sound(in, u, d, step))) [[unlikely]]
      in.status = verdict(in, regular, belief, u, d, step);
    if (in.status == Status::accepted) [[likely]] {
      Tangent<X> moved;
      step.store(moved.data());
      if (detail::move_by(belief.mean, moved)) [[likely]]
        keep(belief, u, d);
      else
        in.status = Status::not_finite;
    }
    return in;
  }

private:
  template <int N, class S>
  using Columns = detail::Column<N, S>[static_cast<std::size_t>(N)];

  /// Row i of H times a column.
  template <class H, int N, class S>
  [[gnu::always_inline]] static S row_dot(const H& h, int i, const detail::Column<N, S>& column) {
    S sum(0);
    if constexpr (detail::is_structured<H>) {
      detail::unrolled<H::entries.size()>([&](auto e) __attribute__((always_inline)) {
        if (H::entries[e].row == i) sum += h.template value<e>() * column[H::entries[e].column];
      });
    } else {
      for (int k = 0; k < N; ++k) sum += h(i, k) * column[k];
    }
    return sum;
  }

  /// Takes the numbers of a measurement one after the other; their noises are independent.
  template <class H, int N, int M, class S>
  [[gnu::always_inline]] static bool take(Innovation<M, S>& in, const H& h, const Vector<M, S>& residual,
                                          const Matrix<M, M, S>& r, Columns<N, S>& u, detail::Column<N, S>& d,
                                          detail::Column<N, S>& step) {
    bool regular = true, lost = false;
    S variances[M];
    detail::each<M>([&](int i) {
      S products[N];
      detail::each<N>([&](int j) { products[j] = row_dot(h, i, u[j]); });
      detail::Column<N, S> f, gain;
      f.gather(products);
      const S variance = r(i, i) > S(0) ? detail::bierman<N, S>(u, d, f, r(i, i), gain)
                                        : detail::bierman_without_noise<N, S>(u, d, f, r(i, i), gain);
      regular = regular && r(i, i) >= S(0) && variance > S(0);
      variances[i] = variance;
      lost = lost || variance < detail::digits_left<S> * in.covariance(i, i);
      const S error = residual(i) - row_dot(h, i, step);
      const S scaled = error / variance;
      step.add(gain, scaled);
      in.nis += error * scaled;
    });
    if (lost && regular) [[unlikely]] {  // by the rounding of S as it is written
      using std::log;
      in.log_determinant = S(0);
      for (const S& variance : variances) in.log_determinant += log(variance);
    }
    return regular;
  }

  /// Correlated noise, by the array of array_update.hpp: to make its numbers independent first would multiply
  /// the precise ones into the others.
  template <Manifold X, int N, int M, class S>
  [[gnu::noinline]] static Status take_correlated(Innovation<M, S>& in, const Matrix<M, N, S>& h,
                                                  const Matrix<M, M, S>& r, const UDGaussian<X>& belief,
                                                  Columns<N, S>& u, detail::Column<N, S>& d,
                                                  detail::Column<N, S>& step) {
    using std::sqrt;
    Matrix<M, M, S> root_r = r;
    if (!all_finite(r) || !all_finite(h) || !all_finite(in.residual)) return Status::not_finite;
    if (!detail::rare_root<M, S>(r, root_r)) return Status::not_positive_definite;
    Matrix<N, N, S> root = belief.upper;
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) root(i, j) *= sqrt(belief.diagonal(j));
    Matrix<M + N, M + N, S> array = Matrix<M + N, M + N, S>::Zero();
    detail::put_transposed(array, 0, 0, root_r);
    detail::put_transposed(array, M, 0, detail::column_product(h, root));
    detail::put_transposed(array, M, M, root);
    const auto update = detail::update_by_array<N, M, S, detail::Wanted::rarely>(array, in.residual, N);
    constexpr double no_gate = std::numeric_limits<double>::infinity();
    const Status status = detail::judge_array<detail::Wanted::rarely>(update, in, no_gate);
    if (status != Status::accepted) return status;
    if (!detail::determined<N, M, S, detail::Wanted::rarely>(update, root, h, r, detail::KeptAs::root))
      return Status::not_positive_definite;
    Matrix<N, N, S> upper;
    Vector<N, S> diagonal;
    detail::ud_of_root<N, S>(update.root, upper, diagonal);
    detail::load_columns(upper, u);
    d.load(diagonal.data());
    step.load(update.step.data());
    return Status::accepted;
  }

  /// The process noise as weighted columns N to 2N: U_q and D_q.
  template <int N, class S, class Q>
  [[gnu::always_inline]] static Status factor_noise(const Q& q, detail::Column<N, S> (&w)[2 * N],
                                                    S (&weights)[2 * N]) {
    if constexpr (detail::is_structured<Q> && N <= 10) {
      detail::Column<N, S> u[N];
      S d[N];
      const bool good = detail::ud_factor(q, u, d);
      detail::each<N>([&](int j) {
        w[N + j] = u[j];
        weights[N + j] = d[j];
      });
      if (good) [[likely]]
        return Status::accepted;
      return factor_dense<N, S>(q.dense(), w, weights);
    } else if constexpr (detail::is_diagonal<Q>) {
      bool finite = true, positive = true;
      detail::each<N>([&](int j) {
        w[N + j].set_zero();
        detail::cut_below(w[N + j], j);
        const S variance = q.values[static_cast<std::size_t>(j)];
        weights[N + j] = variance;
        finite = finite && detail::finite(variance);
        positive = positive && variance >= S(0);
      });
      if (!finite) return Status::not_finite;
      return positive ? Status::accepted : Status::not_positive_definite;
    } else {
      return factor_dense<N, S>(detail::dense_of(q), w, weights);
    }
  }
  /// The same with the stabilising noise, and D multiplied by the fading; judges both.
  template <Manifold X, int N, class S, class Q>
  [[gnu::cold, gnu::noinline]] Status fade_and_stabilise(const Q& noise, detail::Column<N, S> (&w)[2 * N],
                                                         S (&weights)[2 * N]) const {
    CovarianceOf<X> q = detail::dense_of(noise);
    if (!all_finite(q)) return Status::not_finite;
    const Status status = detail::stabilise<X>(q, fading, stabilising_noise);
    if (status != Status::accepted) return status;
    for (int j = 0; j < N; ++j) weights[j] *= static_cast<S>(fading);
    return factor_dense<N, S>(q, w, weights);
  }
  template <int N, class S>
  static Status factor_dense(const Matrix<N, N, S>& q, detail::Column<N, S> (&w)[2 * N],
                             S (&weights)[2 * N]) {
    Matrix<N, N, S> upper;
    Vector<N, S> diagonal = Vector<N, S>::Zero();
    if (!detail::ud_factor<N, S>(q, upper, diagonal))
      return all_finite(q) ? Status::not_positive_definite : Status::not_finite;
    detail::each<N>([&](int j) {
      w[N + j].load(upper.data() + j * N);
      weights[N + j] = diagonal(j);
    });
    return Status::accepted;
  }

  template <int N, class S, class... More>
  [[gnu::always_inline]] static bool finite(const Columns<N, S>& u, const detail::Column<N, S>& d,
                                            const More&... more) {
    detail::Column<N, S> none = d;
    none.scale(S(0));
    detail::each<N>([&](int j) { none.add(u[j], S(0)); });
    (none.add(more, S(0)), ...);
    S sum(0);
    detail::each<N>([&](int i) { sum += none[i]; });
    return sum == S(0);
  }
  template <Manifold X, int N, class S>
  [[gnu::always_inline]] static void keep(UDGaussian<X>& belief, const Columns<N, S>& u,
                                          const detail::Column<N, S>& d) {
    detail::each<N>([&](int j) { u[j].store(belief.upper.data() + j * N); });
    d.store(belief.diagonal.data());
  }

  /// Within the gate, and what is kept is finite. The mean shows where it moves, the residual in the NIS,
  /// what stands beside the diagonal of S in its variances.
  template <int M, int N, class S>
  [[gnu::always_inline]] bool sound(const Innovation<M, S>& in, const Columns<N, S>& u,
                                    const detail::Column<N, S>& d, const detail::Column<N, S>& step) const {
    return in.nis <= static_cast<S>(gate) && in.covariance.trace() <= std::numeric_limits<S>::max() &&
           finite(u, d, step);
  }
  /// Why an update is not sound, if it is not.
  template <int M, int N, class S, Manifold X>
  [[gnu::cold, gnu::noinline]] Status verdict(const Innovation<M, S>& in, bool regular,
                                              const UDGaussian<X>& belief, const Columns<N, S>& u,
                                              const detail::Column<N, S>& d,
                                              const detail::Column<N, S>& step) const {
    if (!all_finite(in.residual) || !all_finite(in.covariance) || !detail::finite_state(belief.mean))
      return Status::not_finite;
    if (!regular || !finite(u, d, step)) return Status::not_positive_definite;
    return in.nis <= static_cast<S>(gate) ? Status::accepted : Status::gated;
  }
};

}}  // namespace cairn::CAIRN_ABI
