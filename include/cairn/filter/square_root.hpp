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
///   unscented the columns odd, even and m of sigma_points.hpp in place of F L and H L
/// (P. Kaminski, A. Bryson, S. Schmidt, "Discrete square root filtering", IEEE Trans. Automatic Control 16,
/// 1971; R. van der Merwe, E. Wan, "The square-root unscented Kalman filter", ICASSP 2001.)
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <type_traits>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/correct.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kernels.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/plain_model.hpp>
#include <cairn/filter/sigma_points.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// Truth = retract(mean, d), d ~ N(0, root root^T), root lower triangular.
template <Manifold X>
struct SquareRootGaussian {
  using State = X;
  X mean;
  CovarianceOf<X> root;

  [[nodiscard]] static SquareRootGaussian from(const Gaussian<X>& belief) {
    CAIRN_EXPECTS(detail::common_size(belief.mean, belief.covariance) > 0,
                  "SquareRootGaussian::from needs a covariance of the mean's size");
    return {belief.mean, detail::semi_definite_root<dof<X>, ScalarOf<X>>(belief.covariance)};
  }
  [[nodiscard]] CovarianceOf<X> covariance() const { return root * root.transpose(); }
  [[nodiscard]] Gaussian<X> gaussian() const { return {mean, covariance()}; }
};

namespace detail {

/// Householder: makes the C x R matrix `a` upper triangular in its first R rows, a^T a unchanged, diagonal
/// not negative. C >= R.
template <int C, int R, class S>
void triangularise(Matrix<C, R, S>& a) {
  using std::sqrt;
  const int rows = static_cast<int>(a.rows());
  const int columns = static_cast<int>(a.cols());
  for (int k = 0; k < columns; ++k) {
    S squared(0);
    for (int i = k + 1; i < rows; ++i) squared += a(i, k) * a(i, k);
    const S head = a(k, k);
    const S norm = sqrt(head * head + squared);
    if (squared > S(0)) {
      const S first =
          head > S(0) ? -squared / (head + norm) : head - norm;  // head - norm without cancellation
      const S factor = S(2) / (first * first + squared);
      for (int j = k + 1; j < columns; ++j) {
        S dot = first * a(k, j);
        for (int i = k + 1; i < rows; ++i) dot += a(i, k) * a(i, j);
        dot *= factor;
        a(k, j) -= dot * first;
        for (int i = k + 1; i < rows; ++i) a(i, j) -= dot * a(i, k);
      }
    } else if (head < S(0)) {
      for (int j = k + 1; j < columns; ++j) a(k, j) = -a(k, j);
    }
    a(k, k) = norm;
    for (int i = k + 1; i < rows; ++i) a(i, k) = S(0);
  }
}

/// The transpose of the upper triangle of `array` that starts at (from, from).
template <class Root, class Array>
[[nodiscard]] Root lower_part(const Array& array, int from, int size) {
  Root root = Root::Zero(size, size);
  for (int j = 0; j < size; ++j)
    for (int i = j; i < size; ++i) root(i, j) = array(from + j, from + i);
  return root;
}

/// Writes a^T into `array` from (row, column) on.
template <class Array, class A>
void put_transposed(Array& array, int row, int column, const A& a) {
  for (int j = 0; j < static_cast<int>(a.cols()); ++j)
    for (int i = 0; i < static_cast<int>(a.rows()); ++i) array(row + j, column + i) = a(i, j);
}

/// Keeps L' = top^T of a triangularised array if it is finite.
template <Manifold X, class Array>
Status keep_root(SquareRootGaussian<X>& belief, const X& mean, const Array& array, int n) {
  const CovarianceOf<X> root = lower_part<CovarianceOf<X>>(array, 0, n);
  if (!all_finite(root) || !finite_state(mean)) return Status::not_finite;
  belief.mean = mean;
  belief.root = root;
  return Status::accepted;
}

/// The update from a filled array of M + N columns, [S-part; P-part] transposed.
template <Manifold X, int M, class Array>
[[nodiscard]] Innovation<M, ScalarOf<X>> correct_by_array(SquareRootGaussian<X>& belief, Array& array,
                                                          const Vector<M, ScalarOf<X>>& residual,
                                                          double gate) {
  using S = ScalarOf<X>;
  const int m = static_cast<int>(residual.size());
  const int n = static_cast<int>(belief.root.rows());
  const bool finite_array = all_finite(array);
  triangularise(array);
  const Matrix<M, M, S> root_s = lower_part<Matrix<M, M, S>>(array, 0, m);
  Innovation<M, S> in = fresh_innovation<M, S>(residual, root_s * root_s.transpose());
  Vector<M, S> y = residual;
  bool regular = true;
  for (int i = 0; i < m; ++i) {
    for (int k = 0; k < i; ++k) y(i) -= root_s(i, k) * y(k);
    regular = regular && root_s(i, i) > S(0);
    y(i) /= root_s(i, i);
  }
  in.nis = y.dot(y);
  const CovarianceOf<X> root = lower_part<CovarianceOf<X>>(array, m, n);
  Tangent<X> step = Tangent<X>::Zero(n);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < m; ++k) step(i) += array(k, m + i) * y(k);
  if (!(gate > 0.0))
    in.status = Status::bad_option;
  else if (!finite_array || !all_finite(residual) || !finite_state(belief.mean))
    in.status = Status::not_finite;
  else if (!regular || !all_finite(root) || !all_finite(step))
    in.status = Status::not_positive_definite;
  else if (!(in.nis <= static_cast<S>(gate)))
    in.status = Status::gated;
  if (in.status != Status::accepted) return in;
  belief.mean = retract(belief.mean, step);
  belief.root = root;
  return in;
}

}  // namespace detail

/// Square-root form of the Kalman and extended Kalman filters. Options only.
struct SquareRoot {
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: the propagated P is multiplied by this; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0

  template <class F, class U = typename F::Control>
    requires(LinearisedProcess<F> || detail::explain_sizes<F>)
  Status predict(SquareRootGaussian<typename F::State>& belief, const F& process, const U& control,
                 double dt) const {
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
  template <class F>
    requires(LinearisedProcess<F> || detail::explain_sizes<F>) && std::same_as<typename F::Control, NoControl>
  Status predict(SquareRootGaussian<typename F::State>& belief, const F& process, double dt) const {
    return predict(belief, process, NoControl{}, dt);
  }

  template <class H, class V = typename H::Measurement>
    requires(LinearisedMeasurement<H> || detail::explain_sizes<H>)
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
    detail::put_transposed(array, 0, 0, detail::semi_definite_root<m, S>(r));
    detail::put_transposed(array, ms, 0, detail::column_product(h, belief.root));
    detail::put_transposed(array, ms, ms, belief.root);
    if (!all_finite(r)) array(0, 0) = std::numeric_limits<S>::quiet_NaN();
    return detail::correct_by_array<X, m>(belief, array, residual, gate);
  }
};

/// Square-root unscented (and, with alpha = 1 and beta = 1, third-order) filter. Needs beta >= alpha^2, so
/// that nothing is ever subtracted; refuses other options. Options only.
struct SquareRootUnscented {
  SigmaPoints points{};
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: the propagated P is multiplied by this; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0

  template <class F, class U = typename F::Control>
    requires(ProcessModel<F> || detail::explain_sizes<F>)
  Status predict(SquareRootGaussian<typename F::State>& belief, const F& process, const U& control,
                 double dt) const {
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
  template <class F>
    requires(ProcessModel<F> || detail::explain_sizes<F>) && std::same_as<typename F::Control, NoControl>
  Status predict(SquareRootGaussian<typename F::State>& belief, const F& process, double dt) const {
    return predict(belief, process, NoControl{}, dt);
  }

  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sizes<H>)
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
    Matrix<n == dynamic ? dynamic : 2 * n + 1, m, S> seen(2 * ns + 1, ms);
    const auto h = [&](const X& x) -> Z { return plain.predict(x); };
    const Z mean = spread(belief, h, seen);
    if (plain.misfit()) return detail::misfitting(plain);
    for (int j = 0; j < ms; ++j)
      for (int i = 0; i <= 2 * ns; ++i) array(i, j) = seen(i, j);
    detail::put_transposed(array, 0, ms, belief.root);
    detail::put_transposed(array, 2 * ns + 1, 0, detail::semi_definite_root<m, S>(r));
    if (!all_finite(r)) array(0, 0) = std::numeric_limits<S>::quiet_NaN();
    return detail::correct_by_array<X, m>(belief, array, local(mean, plain.z()), sound(ns) ? gate : 0.0);
  }

private:
  [[nodiscard]] bool sound(int n) const noexcept {
    return points.spread_squared(n) > 0.0 && points.beta >= points.alpha * points.alpha;
  }

  /// Rows: odd_i / c for i < n, even_i / c, sqrt(beta - alpha^2) m. Returns the transformed mean.
  template <Manifold X, class F, class Array>
  auto spread(const SquareRootGaussian<X>& belief, const F& f, Array& rows) const {
    using S = ScalarOf<X>;
    using Y = std::decay_t<decltype(f(belief.mean))>;
    using std::sqrt;
    const int n = static_cast<int>(belief.root.rows());
    const S wanted = sqrt(static_cast<S>(points.spread_squared(n)));
    const S nearest = sqrt(sqrt(std::numeric_limits<S>::epsilon()));
    const S c = wanted > nearest ? wanted : nearest;
    const Y center = f(belief.mean);
    Tangent<Y> mean = Tangent<Y>::Zero(dof_of(center));
    for (int i = 0; i < n; ++i) {
      Tangent<X> step = c * belief.root.col(i);
      const Tangent<Y> up = local(center, Y(f(retract(belief.mean, step))));
      step = -step;
      const Tangent<Y> down = local(center, Y(f(retract(belief.mean, step))));
      Tangent<Y> odd = up, even = down;
      for (int k = 0; k < static_cast<int>(mean.size()); ++k) {
        odd(k) = S(0.5) * (up(k) - down(k));
        even(k) = S(0.5) * (up(k) + down(k));
      }
      detail::drop_noise<Y>(center, odd, even);
      for (int k = 0; k < static_cast<int>(mean.size()); ++k) {
        rows(i, k) = odd(k) / c;
        rows(n + i, k) = even(k) / c;
        mean(k) += even(k) / (c * c);
      }
    }
    const S of_mean = sqrt(static_cast<S>(points.beta - points.alpha * points.alpha));
    for (int k = 0; k < static_cast<int>(mean.size()); ++k) rows(2 * n, k) = of_mean * mean(k);
    return retract(center, mean);
  }
};

}  // namespace cairn::inline CAIRN_ABI
