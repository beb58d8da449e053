// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Square-root filters: the belief carries L with P = L L^T, so P cannot lose its definiteness and keeps
/// twice the digits.
///
/// Every step is one orthogonal triangularisation of an array (no Cholesky downdate anywhere):
///   predict   [F L, Q^1/2] -> [L', 0]
///   update    [R^1/2  H L; 0  L] -> [S^1/2 0; K S^1/2  L']
///   unscented the columns odd, even and m of unscented_transform.hpp in place of F L and H L
/// (P. Kaminski, A. Bryson, S. Schmidt, "Discrete square root filtering", IEEE Trans. Automatic Control 16,
/// 1971; R. van der Merwe, E. Wan, "The square-root unscented Kalman filter", ICASSP 2001.)
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <type_traits>

#include <cairn/core/check.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/array_update.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/unscented_transform.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Truth = retract(mean, d), d ~ N(0, root root^T), root lower triangular.
template <Manifold X>
struct SquareRootGaussian {
  using State = X;
  X mean;
  CovarianceOf<X> root;

  /// Throws Error where the covariance is none.
  [[nodiscard]] static SquareRootGaussian from(const Gaussian<X>& belief) {
    CAIRN_EXPECTS(detail::common_size(belief.mean, belief.covariance) > 0,
                  "SquareRootGaussian::from needs a covariance of the mean's size");
    SquareRootGaussian result{belief.mean, belief.covariance};
    if (!detail::checked_root<dof<X>, ScalarOf<X>>(belief.covariance, result.root))
      raise("SquareRootGaussian: the covariance is not finite and positive semi-definite");
    return result;
  }
  /// Symmetric bit for bit.
  [[nodiscard]] CovarianceOf<X> covariance() const { return detail::squared_root<dof<X>, ScalarOf<X>>(root); }
  [[nodiscard]] Gaussian<X> gaussian() const { return {mean, covariance()}; }
};

namespace detail {

/// Keeps L' = top^T of a triangularised array if it is finite.
template <Manifold X, class Array>
Status keep_root(SquareRootGaussian<X>& belief, const X& mean, const Array& array, int n) {
  const CovarianceOf<X> root = lower_part<CovarianceOf<X>>(array, 0, n);
  if (!all_finite(root) || !finite_state(mean)) return Status::not_finite;
  belief.mean = mean;
  belief.root = root;
  return Status::accepted;
}

/// The update from a filled array of M + N columns, [S-part; P-part] transposed, with the noise's root in it.
/// `good`: that is one.
template <Manifold X, int M, class Array>
[[nodiscard]] Innovation<M, ScalarOf<X>> correct_by_array(
    SquareRootGaussian<X>& belief, Array& array, const Vector<M, ScalarOf<X>>& residual,
    const Matrix<M, dof<X>, ScalarOf<X>>& h, const Matrix<M, M, ScalarOf<X>>& r, double gate, bool good,
    ScalarOf<X> digits = root_digits_left<ScalarOf<X>>) {
  using S = ScalarOf<X>;
  const int m = static_cast<int>(residual.size());
  auto in = fresh_innovation<M, S>(residual, Matrix<M, M, S>::Zero(m, m));
  const bool finite_numbers = all_finite(array) && all_finite(residual) && finite_state(belief.mean);
  if (!(gate > 0.0))
    in.status = Status::bad_option;
  else if (!finite_numbers || !good)
    in.status = finite_numbers ? Status::not_positive_definite : Status::not_finite;
  if (in.status != Status::accepted) return in;
  const auto update = update_by_array<dof<X>, M, S>(array, residual, static_cast<int>(belief.root.rows()));
  in.status = judge_array<Wanted::always>(update, in, gate);
  if (in.status == Status::accepted &&
      !determined<dof<X>, M, S>(update, belief.root, h, r, KeptAs::root, digits))
    in.status = Status::not_positive_definite;
  if (in.status != Status::accepted) return in;
  if (move_by(belief.mean, Tangent<X>(update.step)))
    belief.root = update.root;
  else
    in.status = Status::not_finite;
  return in;
}

}  // namespace detail

/// Square-root form of the Kalman and extended Kalman filters. Options only.
struct SquareRoot {
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: the propagated P is multiplied by this; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0
  template <Manifold X>
  using BeliefOf = SquareRootGaussian<X>;

  template <class F, class U = detail::ControlOf<F>>
    requires(LinearisedProcess<F> || detail::explain_process<F> ||
             detail::explain_jacobian<F, ProcessModel<F>>)
  Status predict(SquareRootGaussian<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    using S = ScalarOf<X>;
    using std::sqrt;
    constexpr int n = dof<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    const int size = detail::common_size(belief.mean, belief.root);
    const detail::PlainProcess plain(process, size, control);
    const CovarianceOf<X> f = detail::dense_of(plain.jacobian(belief.mean, dt));
    CovarianceOf<X> q = detail::dense_of(plain.noise(belief.mean, dt));
    if (plain.misfit()) return Status::size_mismatch;
    const X mean = plain.propagate(belief.mean, dt);
    if (plain.misfit()) return Status::size_mismatch;
    const Status status = detail::stabilise<X>(q, fading, stabilising_noise);
    if (status != Status::accepted) return status;
    Matrix<detail::size_sum<n, n>, n, S> array(2 * size, size);
    CovarianceOf<X> moved = detail::column_product(f, belief.root);
    if (fading != 1.0) moved *= sqrt(static_cast<S>(fading));
    detail::put_transposed(array, 0, 0, moved);
    detail::put_transposed(array, size, 0, detail::semi_definite_root<n, S>(q));
    detail::triangularise(array);
    return detail::keep_root(belief, mean, array, size);
  }

  template <class H, class V = typename H::Measurement>
    requires(LinearisedMeasurement<H> || detail::explain_sensor<H> ||
             detail::explain_jacobian<H, MeasurementModel<H>>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      SquareRootGaussian<typename H::State>& belief, const H& sensor, const V& z) const {
    using X = typename H::State;
    using Z = typename H::Measurement;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    constexpr int m = dof<Z>;
    const int ns = detail::common_size(belief.mean, belief.root);
    const detail::PlainSensor plain(sensor, ns, z);
    const int ms = plain.numbers();
    const Matrix<m, n, S> h = detail::dense_of(plain.jacobian(belief.mean));
    const Matrix<m, m, S> r = detail::dense_of(plain.noise(belief.mean));
    if (plain.misfit()) return detail::misfitting(plain);
    const Vector<m, S> residual = plain.residual(belief.mean);
    if (plain.misfit()) return detail::misfitting(plain);
    Matrix<detail::size_sum<m, n>, detail::size_sum<m, n>, S> array(ms + ns, ms + ns);
    array.setZero();
    Matrix<m, m, S> root_r = r;
    const bool good = detail::checked_root<m, S>(r, root_r);
    detail::put_transposed(array, 0, 0, root_r);
    detail::put_transposed(array, ms, 0, detail::column_product(h, belief.root));
    detail::put_transposed(array, ms, ms, belief.root);
    if (!all_finite(r)) array(0, 0) = std::numeric_limits<S>::quiet_NaN();
    return detail::correct_by_array<X, m>(belief, array, residual, h, r, gate, good);
  }
};

/// Square-root unscented (and, with alpha = 1 and beta = 1, third-order) filter. Needs beta >= alpha^2, so
/// that nothing is ever subtracted; refuses other options. Options only.
struct SquareRootUnscented {
  SigmaPoints points{};
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: the propagated P is multiplied by this; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0
  template <Manifold X>
  using BeliefOf = SquareRootGaussian<X>;

  template <class F, class U = detail::ControlOf<F>>
    requires(ProcessModel<F> || detail::explain_process<F>)
  Status predict(SquareRootGaussian<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    using S = ScalarOf<X>;
    using std::sqrt;
    constexpr int n = dof<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    const int size = detail::common_size(belief.mean, belief.root);
    const detail::PlainProcess plain(process, size, control);
    if (plain.misfit()) return Status::size_mismatch;
    if (!sound(size)) return Status::bad_option;
    CovarianceOf<X> q = detail::dense_of(plain.noise(belief.mean, dt));
    if (plain.misfit()) return Status::size_mismatch;
    const Status status = detail::stabilise<X>(q, fading, stabilising_noise);
    if (status != Status::accepted) return status;
    constexpr int rows = n == dynamic ? dynamic : 3 * n + 1;
    Matrix<rows, n, S> array(3 * size + 1, size);
    const auto f = [&](const X& x) -> X { return plain.propagate(x, dt); };
    const X mean = spread(belief, f, array);
    if (plain.misfit()) return Status::size_mismatch;
    const S faded = sqrt(static_cast<S>(fading));
    for (int j = 0; j < size; ++j)
      for (int i = 0; i <= 2 * size; ++i) array(i, j) *= faded;
    detail::put_transposed(array, 2 * size + 1, 0, detail::semi_definite_root<n, S>(q));
    detail::triangularise(array);
    return detail::keep_root(belief, mean, array, size);
  }

  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      SquareRootGaussian<typename H::State>& belief, const H& sensor, const V& z) const {
    using X = typename H::State;
    using Z = typename H::Measurement;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    constexpr int m = dof<Z>;
    const int ns = detail::common_size(belief.mean, belief.root);
    const detail::PlainSensor plain(sensor, ns, z);
    const int ms = plain.numbers();
    const Matrix<m, m, S> r = detail::dense_of(plain.noise(belief.mean));
    if (plain.misfit()) return detail::misfitting(plain);
    constexpr int rows = n == dynamic || m == dynamic ? dynamic : 2 * n + 1 + m;
    Matrix<rows, detail::size_sum<m, n>, S> array(2 * ns + 1 + ms, ms + ns);
    array.setZero();
    const auto h = [&](const X& x) -> Z { return plain.predict(x); };
    const Z mean = spread(belief, h, array);
    if (plain.misfit()) return detail::misfitting(plain);
    Matrix<m, m, S> root_r = r;
    const bool good = detail::checked_root<m, S>(r, root_r);
    detail::put_transposed(array, 0, ms, belief.root);
    detail::put_transposed(array, 2 * ns + 1, 0, root_r);
    if (!all_finite(r)) array(0, 0) = std::numeric_limits<S>::quiet_NaN();
    const Matrix<m, n, S> slope = detail::mean_slope<m, n, S>(array, belief.root, ms);
    Vector<detail::size_sum<m, n>, S> variances(ms + ns);
    for (int j = 0; j < ms + ns; ++j) {
      variances(j) = S(0);
      for (int i = 0; i < static_cast<int>(array.rows()); ++i) variances(j) += array(i, j) * array(i, j);
    }
    const S digits = detail::digits_of_points(
        belief.mean, [&](int i, int) { return variances(ms + i); }, mean,
        [&](int i, int) { return variances(i); });
    return detail::correct_by_array<X, m>(belief, array, local(mean, plain.z()), slope, r,
                                          sound(ns) ? gate : 0.0, good, digits);
  }

private:
  [[nodiscard]] bool sound(int n) const noexcept {
    return points.spread_squared(n) > 0.0 && points.beta >= points.alpha * points.alpha;
  }

  template <Manifold X, class F, class Array>
  auto spread(const SquareRootGaussian<X>& belief, const F& f, Array& rows) const {
    return detail::sigma_rows(belief.mean, belief.root, f,
                              points.spread_squared(static_cast<int>(belief.root.rows())),
                              points.beta - points.alpha * points.alpha, rows);
  }
};

}}  // namespace cairn::CAIRN_ABI
