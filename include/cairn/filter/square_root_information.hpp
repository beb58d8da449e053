// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The square-root information filter: the belief as a triangular system R d = b, with Y = R^T R.
///
/// Every step is one orthogonal triangularisation, so that Y keeps twice the digits of information.hpp and
/// cannot lose its definiteness; R may be singular, and no prior is needed:
///   update    [R b; V^-1/2 H  V^-1/2 (z (-) h)]                 -> [R' b'; 0 e],   V the sensor's noise
///   predict   [I 0 0; -R F^-1 G  R F^-1  b],   Q = G G^T         -> [* * *; 0 R' b']
/// (P. Dyer, S. McReynolds, "Extension of square-root filtering to include process noise", J. Optimization
/// Theory and Applications 3, 1969; G. Bierman, "Factorization Methods for Discrete Sequential Estimation",
/// 1977, chapters V and VI.) e^2 is what the measurement adds to the sum of squared residuals.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <optional>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/detail/products.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Truth = retract(point, d); the density of d is exp(-|R d - b|^2 / 2), R upper triangular and possibly
/// singular.
template <Manifold X>
struct SquareRootInformation {
  using State = X;
  X point;
  CovarianceOf<X> root;
  Tangent<X> vector;

  /// Nothing known, linearised at `x`.
  [[nodiscard]] static SquareRootInformation ignorant(const X& x) {
    const int n = dof_of(x);
    return {x, CovarianceOf<X>::Zero(n, n), Tangent<X>::Zero(n)};
  }
  /// The same belief; nothing where the covariance is of another size or singular, or so nearly that its
  /// inverse would not have three digits.
  [[nodiscard]] static std::optional<SquareRootInformation> from(const Gaussian<X>& belief) {
    using S = ScalarOf<X>;
    const int n = detail::common_size(belief.mean, belief.covariance);
    if (n == 0) return std::nullopt;
    CovarianceOf<X> lower = belief.covariance, inverse = lower;
    if (!detail::regular_root<dof<X>, S>(belief.covariance, lower)) return std::nullopt;
    const CovarianceOf<X> upper = transposed<dof<X>, dof<X>, S>(lower);
    if (!detail::invert_upper<dof<X>, S>(upper, inverse)) return std::nullopt;
    CovarianceOf<X> root = transposed<dof<X>, dof<X>, S>(inverse);  // L^-1, whose square is Y
    for (int i = 0; i < n; ++i) {
      S information(0);
      for (int k = 0; k < n; ++k) information += root(k, i) * root(k, i);
      if (!(detail::digits_left<S> * information * belief.covariance(i, i) < S(1))) return std::nullopt;
    }
    detail::triangularise(root);
    return SquareRootInformation{belief.mean, root, Tangent<X>::Zero(n)};
  }
  /// Mean and covariance; nothing while some direction has no information.
  [[nodiscard]] std::optional<Gaussian<X>> gaussian() const {
    if (detail::common_size(point, root, vector) == 0) return std::nullopt;
    CovarianceOf<X> inverse = root;
    Tangent<X> d = vector;
    if (!solve(inverse, d)) return std::nullopt;
    Gaussian<X> result{retract(point, d), detail::squared_root<dof<X>, ScalarOf<X>>(inverse)};
    if (!all_finite(result.covariance) || !detail::finite_state(result.mean)) return std::nullopt;
    return result;
  }

  /// R^-1 and the step to the mean; false where that would not have three digits of its standard deviations.
  [[nodiscard]] bool solve(CovarianceOf<X>& inverse, Tangent<X>& step) const {
    using S = ScalarOf<X>;
    using std::abs;
    using std::sqrt;
    if (!detail::invert_upper<dof<X>, S>(root, inverse)) return false;
    step = detail::column_product(inverse, vector);
    S size(0);  // of the step, in the deviations that each number has given the others
    for (int i = 0; i < static_cast<int>(step.size()); ++i) {
      S squares(0);
      for (int k = 0; k <= i; ++k) squares += root(k, i) * root(k, i);
      size += sqrt(squares) * abs(step(i));
    }
    return size * detail::digits_left<S> <= S(1);
  }
};

/// Square-root information filter for linear and linearised models. Options only.
struct SquareRootInformationFilter {
  double fading = 1.0;             ///< fading memory: F P F^T is multiplied by this each step; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0
  template <Manifold X>
  using BeliefOf = SquareRootInformation<X>;

  /// Moves the belief by one step of dt, and the point of linearisation to the estimate before, where there
  /// is one. Refused: a singular F. O(n^3).
  template <class F, class U = detail::ControlOf<F>>
    requires(LinearisedProcess<F> || detail::explain_process<F> ||
             detail::explain_jacobian<F, ProcessModel<F>>)
  Status predict(SquareRootInformation<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    const int size = detail::common_size(belief.point, belief.root, belief.vector);
    const detail::PlainProcess plain(process, size, control);
    if (plain.misfit()) return Status::size_mismatch;
    SquareRootInformation<X> next = belief;
    recentre(next);
    CovarianceOf<X> f = detail::dense_of(plain.jacobian(next.point, dt));
    CovarianceOf<X> q = detail::dense_of(plain.noise(next.point, dt));
    if (plain.misfit()) return Status::size_mismatch;
    if (!all_finite(f)) return Status::not_finite;
    const Status status = detail::stabilise<X>(q, fading, stabilising_noise);
    if (status != Status::accepted) return status;
    const Status moved = detail::predict_root<n, S>(next.root, next.vector, f, q, fading);
    if (moved != Status::accepted) return moved;
    next.point = plain.propagate(next.point, dt);
    if (plain.misfit()) return Status::size_mismatch;
    return keep(belief, next);
  }

  /// Adds the information of the measurement z, linearised at the belief's point. O((n + m) n^2).
  template <class H, class V = typename H::Measurement>
    requires(LinearisedMeasurement<H> || detail::explain_sensor<H> ||
             detail::explain_jacobian<H, MeasurementModel<H>>)
  UpdateResult update(SquareRootInformation<typename H::State>& belief, const H& sensor, const V& z) const {
    using X = typename H::State;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    constexpr int m = dof<typename H::Measurement>;
    const int ns = detail::common_size(belief.point, belief.root, belief.vector);
    const detail::PlainSensor plain(sensor, ns, z);
    const int ms = plain.numbers();
    const Matrix<m, n, S> h = detail::dense_of(plain.jacobian(belief.point));
    const Matrix<m, m, S> v = detail::dense_of(plain.noise(belief.point));
    if (plain.misfit()) return Status::size_mismatch;
    const Vector<m, S> residual = plain.residual(belief.point);
    if (plain.misfit()) return Status::size_mismatch;
    if (!all_finite(v) || !all_finite(h)) return Status::not_finite;
    constexpr int rows = detail::size_sum<n, m>;
    Matrix<rows, detail::size_sum<n, 1>, S> array(ns + ms, ns + 1);
    for (int i = 0; i < ns; ++i) {
      for (int j = 0; j < ns; ++j) array(i, j) = belief.root(i, j);
      array(i, ns) = belief.vector(i);
    }
    Matrix<m, m, S> lower = v;
    if (!detail::regular_root<m, S>(v, lower)) return Status::not_positive_definite;
    for (int i = 0; i < ms; ++i) {  // V^-1/2 times (H, residual), row by row
      if (!(lower(i, i) * lower(i, i) > detail::digits_left<S> * v(i, i)))
        return Status::not_positive_definite;
      for (int j = 0; j <= ns; ++j) {
        S entry = j < ns ? h(i, j) : residual(i);
        for (int k = 0; k < i; ++k) entry -= lower(i, k) * array(ns + k, j);
        array(ns + i, j) = entry / lower(i, i);
      }
    }
    detail::triangularise(array);
    SquareRootInformation<X> next = belief;
    for (int i = 0; i < ns; ++i) {
      for (int j = 0; j < ns; ++j) next.root(i, j) = array(i, j);
      next.vector(i) = array(i, ns);
    }
    return keep(belief, next);
  }

  /// Moves the point of linearisation to the mean; false, and nothing changed, while that is unknown.
  template <Manifold X>
  static bool recentre(SquareRootInformation<X>& belief) {
    if (detail::common_size(belief.point, belief.root, belief.vector) == 0) return false;
    CovarianceOf<X> inverse = belief.root;
    Tangent<X> d = belief.vector;
    if (!belief.solve(inverse, d) || !all_finite(d)) return false;
    if (!detail::move_by(belief.point, d)) return false;
    belief.vector.setZero();
    return true;
  }

private:
  template <Manifold X>
  static Status keep(SquareRootInformation<X>& belief, const SquareRootInformation<X>& next) {
    if (!all_finite(next.root) || !all_finite(next.vector) || !detail::finite_state(next.point))
      return Status::not_finite;
    belief = next;
    return Status::accepted;
  }
};

}}  // namespace cairn::CAIRN_ABI
