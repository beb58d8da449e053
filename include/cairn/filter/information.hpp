// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The information filter: the belief as Y = P^-1 and y = Y d, about a point x of linearisation.
///
///   update    Y <- Y + H^T R^-1 H,   y <- y + H^T R^-1 (z (-) h(x))          a sum: sensors in any order
///   predict   M = F^-T Y F^-1,   Y <- M - M G (I + G^T M G)^-1 G^T M,   Q = G G^T
/// (Maybeck, "Stochastic Models, Estimation, and Control", vol. 1, 5.7.) Y may be singular: a state nobody
/// has seen has zero information, and no prior is needed. Many numbers of one measurement cost one small sum
/// each. Loses digits where H^T R^-1 H swamps Y where the square-root form keeps them.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <optional>
#include <utility>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/kernels.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/plain_model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/structure.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// Truth = retract(point, d); the density of d is exp(-(d^T Y d) / 2 + y^T d). Y may be singular.
template <Manifold X>
struct InformationBelief {
  X point;
  CovarianceOf<X> information;
  Tangent<X> vector;

  /// Nothing known, linearised at `x`.
  [[nodiscard]] static InformationBelief ignorant(const X& x) {
    const int n = dof_of(x);
    return {x, CovarianceOf<X>::Zero(n, n), Tangent<X>::Zero(n)};
  }
  /// The same belief in information form; nothing where the covariance is singular or of another size.
  [[nodiscard]] static std::optional<InformationBelief> from(const Gaussian<X>& belief) {
    const int n = detail::common_size(belief.mean, belief.covariance);
    if (n == 0) return std::nullopt;
    const Cholesky<dof<X>, ScalarOf<X>> root(belief.covariance);
    if (!root.good()) return std::nullopt;
    return InformationBelief{belief.mean, root.inverse(), Tangent<X>::Zero(n)};
  }
  /// Mean and covariance; nothing while some direction has no information.
  [[nodiscard]] std::optional<Gaussian<X>> gaussian() const {
    if (detail::common_size(point, information, vector) == 0) return std::nullopt;
    const Cholesky<dof<X>, ScalarOf<X>> root(information);
    if (!root.good()) return std::nullopt;
    Gaussian<X> result{retract(point, root.solve(vector)), root.inverse()};
    if (!all_finite(result.covariance) || !detail::finite_state(result.mean)) return std::nullopt;
    return result;
  }
};

namespace detail {

/// Solves a x = b for square a by elimination with row pivots; false where a is singular.
template <int N, int C, class S>
[[nodiscard]] bool solve_square(Matrix<N, N, S> a, Matrix<N, C, S>& b) {
  using std::abs;
  const int n = static_cast<int>(a.rows());
  const int columns = static_cast<int>(b.cols());
  for (int j = 0; j < n; ++j) {
    int best = j;
    for (int i = j + 1; i < n; ++i)
      if (abs(a(i, j)) > abs(a(best, j))) best = i;
    if (!(abs(a(best, j)) > S(0))) return false;
    if (best != j) {
      for (int k = j; k < n; ++k) std::swap(a(j, k), a(best, k));
      for (int k = 0; k < columns; ++k) std::swap(b(j, k), b(best, k));
    }
    for (int i = j + 1; i < n; ++i) {
      const S factor = a(i, j) / a(j, j);
      for (int k = j; k < n; ++k) a(i, k) -= factor * a(j, k);
      for (int k = 0; k < columns; ++k) b(i, k) -= factor * b(j, k);
    }
  }
  for (int k = 0; k < columns; ++k)
    for (int j = n - 1; j >= 0; --j) {
      for (int i = j + 1; i < n; ++i) b(j, k) -= a(j, i) * b(i, k);
      b(j, k) /= a(j, j);
    }
  return true;
}

}  // namespace detail

/// Information filter for linear and linearised models. Options only.
struct InformationFilter {
  double fading = 1.0;             ///< fading memory: F P F^T is multiplied by this each step; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0

  /// Moves the belief by one step of dt. The mean of what is known is moved by the process first, so the
  /// point of linearisation follows the estimate. Refused: a singular F.
  template <class F, class U = typename F::Control>
    requires(LinearisedProcess<F> || detail::explain_sizes<F>)
  Status predict(InformationBelief<typename F::State>& belief, const F& process, const U& control,
                 double dt) const {
    using X = typename F::State;
    using S = ScalarOf<X>;
    constexpr int n = dof<X>;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    const int size = detail::common_size(belief.point, belief.information, belief.vector);
    const detail::PlainProcess plain(process, size, control);
    if (plain.misfit()) return Status::size_mismatch;
    InformationBelief<X> next = belief;
    recentre(next);
    const CovarianceOf<X> f = detail::dense_of(plain.jacobian(next.point, dt));
    CovarianceOf<X> q = detail::dense_of(plain.noise(next.point, dt));
    CovarianceOf<X> inverse = CovarianceOf<X>::Identity(size, size);
    if (plain.misfit()) return Status::size_mismatch;
    if (!(fading >= 1.0) || !(stabilising_noise >= 0.0)) return Status::bad_option;
    for (int i = 0; i < size; ++i) q(i, i) += static_cast<S>(stabilising_noise);
    const CovarianceOf<X> g = detail::semi_definite_root<n, S>(q);
    if (!all_finite(f) || !all_finite(q)) return Status::not_finite;
    if (!detail::solve_square<n, n, S>(f, inverse)) return Status::not_positive_definite;
    const CovarianceOf<X> back = transposed<n, n, S>(inverse) / static_cast<S>(fading);
    const CovarianceOf<X> m =
        symmetrised(detail::column_product(back, detail::column_product(next.information, inverse)));
    const Tangent<X> y = detail::column_product(back, next.vector);
    const CovarianceOf<X> gt = transposed<n, n, S>(g);
    const CovarianceOf<X> mg = detail::column_product(m, g);
    CovarianceOf<X> inner = detail::column_product(gt, mg);
    for (int i = 0; i < size; ++i) inner(i, i) += S(1);
    const Cholesky<n, S> root(inner);
    if (!root.good()) return Status::not_positive_definite;
    const CovarianceOf<X> lost = detail::column_product(mg, root.solve(transposed<n, n, S>(mg)));
    next.information = symmetrised(m - lost);
    next.vector = y - detail::column_product(mg, root.solve(detail::column_product(gt, y)));
    next.point = plain.propagate(next.point, dt);
    if (plain.misfit()) return Status::size_mismatch;
    return keep(belief, next);
  }
  template <class F>
    requires(LinearisedProcess<F> || detail::explain_sizes<F>) && std::same_as<typename F::Control, NoControl>
  Status predict(InformationBelief<typename F::State>& belief, const F& process, double dt) const {
    return predict(belief, process, NoControl{}, dt);
  }

  /// Adds the information of the measurement z, linearised at the belief's point. O(M^2 N + M N^2).
  template <class H, class V = typename H::Measurement>
    requires(LinearisedMeasurement<H> || detail::explain_sizes<H>)
  Status update(InformationBelief<typename H::State>& belief, const H& sensor, const V& z) const {
    using X = typename H::State;
    using S = ScalarOf<X>;
    constexpr int m = dof<typename H::Measurement>;
    const int size = detail::common_size(belief.point, belief.information, belief.vector);
    const detail::PlainSensor plain(sensor, size, z);
    const Matrix<m, dof<X>, S> h = detail::dense_of(plain.jacobian(belief.point));
    const Matrix<m, m, S> r = detail::dense_of(plain.noise(belief.point));
    if (plain.misfit()) return Status::size_mismatch;
    const Vector<m, S> residual = plain.residual(belief.point);
    if (plain.misfit()) return Status::size_mismatch;
    const Cholesky<m, S> root(r);
    if (!root.good() || !all_finite(r))
      return all_finite(r) ? Status::not_positive_definite : Status::not_finite;
    const Matrix<m, dof<X>, S> white = root.whiten(h);
    InformationBelief<X> next = belief;
    add_transposed_product(next.information, white, white);
    add_transposed_product(next.vector, white, root.whiten(residual));
    return keep(belief, next);
  }

  /// Moves the point of linearisation to the mean; false, and nothing changed, while that is unknown.
  template <Manifold X>
  static bool recentre(InformationBelief<X>& belief) {
    if (detail::common_size(belief.point, belief.information, belief.vector) == 0) return false;
    const Cholesky<dof<X>, ScalarOf<X>> root(belief.information);
    if (!root.good()) return false;
    const Tangent<X> d = root.solve(belief.vector);
    if (!all_finite(d)) return false;
    belief.point = retract(belief.point, d);
    belief.vector.setZero();
    return true;
  }

private:
  template <Manifold X>
  static Status keep(InformationBelief<X>& belief, const InformationBelief<X>& next) {
    if (!all_finite(next.information) || !all_finite(next.vector) || !detail::finite_state(next.point))
      return Status::not_finite;
    if (!detail::is_valid_covariance<dof<X>, ScalarOf<X>>(symmetrised(next.information)))
      return Status::not_positive_definite;
    belief = next;
    return Status::accepted;
  }
};

}  // namespace cairn::inline CAIRN_ABI
