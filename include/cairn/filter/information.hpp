// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The information filter: the belief as Y = P^-1 and y = Y d, about a point x of linearisation.
///
///   update    Y <- Y + H^T R^-1 H,   y <- y + H^T R^-1 (z (-) h(x))          a sum: sensors in any order
///   predict   Y <- (F Y^-1 F^T + Q)^-1, also where Y has no inverse: by the array
///             [I 0 0; -C F^-1 G  C F^-1  b] -> [* * *; 0 C' b'],   Y = C^T C,  y = C^T b,  Q = G G^T
/// (Maybeck, "Stochastic Models, Estimation, and Control", vol. 1, 5.7; Bierman, "Factorization Methods for
/// Discrete Sequential Estimation", 1977, VI.) Y may be singular: a state nobody has seen has zero
/// information, and no prior is needed. Many numbers of one measurement cost one small sum each. What is less
/// than the rounding of Y says nothing: where H^T R^-1 H swamps Y by more than its digits, the weaker
/// directions count as unknown, and there is no mean and no covariance until they are seen. The square-root
/// form keeps twice as many digits.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <optional>
#include <utility>

#include <cairn/core/cholesky.hpp>
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
#include <cairn/filter/structured.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// Solves a x = b for square a by elimination with row pivots, in units of the rows' largest entries; false
/// where a is singular to rounding.
template <int N, int C, class S>
[[nodiscard]] bool solve_square(Matrix<N, N, S> a, Matrix<N, C, S>& b) {
  using std::abs;
  const int n = static_cast<int>(a.rows());
  const int columns = static_cast<int>(b.cols());
  Vector<N, S> scale = Vector<N, S>::Zero(n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j)
      if (abs(a(i, j)) > scale(i)) scale(i) = abs(a(i, j));
    if (!(scale(i) > S(0))) return false;
  }
  Vector<N, S> size = Vector<N, S>::Zero(n);  // of the columns
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      if (abs(a(i, j)) > size(j) * scale(i)) size(j) = abs(a(i, j)) / scale(i);
  for (int j = 0; j < n; ++j) {
    int best = j;
    for (int i = j + 1; i < n; ++i)
      if (abs(a(i, j)) * scale(best) > abs(a(best, j)) * scale(i)) best = i;
    if (!(abs(a(best, j)) > rounding_share<S> * size(j) * scale(best))) return false;
    if (best != j) {
      for (int k = j; k < n; ++k) std::swap(a(j, k), a(best, k));
      for (int k = 0; k < columns; ++k) std::swap(b(j, k), b(best, k));
      std::swap(scale(j), scale(best));
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

/// a^-1 of a covariance or an information; false where it would not have three digits: what the other numbers
/// leave of one, 1 / (a_ii a^-1_ii), is near its rounding.
template <int N, class S>
[[nodiscard]] bool sound_inverse(const Matrix<N, N, S>& a, Matrix<N, N, S>& inverse) {
  const Cholesky<N, S> root(a);
  if (!root.good()) return false;
  inverse = root.inverse();
  for (int i = 0; i < static_cast<int>(a.rows()); ++i)
    if (!(digits_left<S> * a(i, i) * inverse(i, i) < S(1))) return false;
  return true;
}

/// C^T with Y = C^T C, and in place of y the b with y = C^T b; false where Y is none. Not triangular where Y
/// is singular.
template <int N, class S>
[[nodiscard]] bool information_root(const Matrix<N, N, S>& information, Matrix<N, N, S>& root,
                                    Vector<N, S>& vector) {
  const int n = static_cast<int>(vector.size());
  PivotedRoot<N, S> pivoted;
  const bool regular = regular_root<N, S>(information, root);
  if (!regular && !pivoted_root<N, S>(information, pivoted)) return false;
  if (!regular) root = pivoted.root;
  Vector<N, S> left = vector;
  vector.setZero();
  for (int k = 0; k < (regular ? n : pivoted.rank); ++k) {
    const int row = regular ? k : pivoted.order(k);
    vector(k) = left(row) / root(row, k);
    for (int i = 0; i < n; ++i) left(i) -= root(i, k) * vector(k);
  }
  return true;
}

/// Inverse of an upper triangular matrix; false where what the other numbers leave of one, the reciprocal of
/// its column's length times its inverse row's, is near its rounding.
template <int N, class S>
[[nodiscard]] bool invert_upper(const Matrix<N, N, S>& root, Matrix<N, N, S>& inverse) {
  using std::sqrt;
  const int n = static_cast<int>(root.rows());
  inverse = Matrix<N, N, S>::Identity(n, n);
  for (int i = n - 1; i >= 0; --i) {
    if (!(root(i, i) > S(0))) return false;
    for (int j = i; j < n; ++j) {
      for (int k = i + 1; k <= j; ++k) inverse(i, j) -= root(i, k) * inverse(k, j);
      inverse(i, j) /= root(i, i);
    }
  }
  for (int i = 0; i < n; ++i) {
    S column(0), row(0);
    for (int k = 0; k <= i; ++k) column += root(k, i) * root(k, i);
    for (int k = i; k < n; ++k) row += inverse(i, k) * inverse(i, k);
    if (!(digits_left<S> * sqrt(column) * sqrt(row) < S(1))) return false;
  }
  return true;
}

/// C and b of a density exp(-|C d - b|^2 / 2) after a prediction by F and Q; C comes back upper triangular.
/// Refused: a singular F; an F, or a Q of lower rank, that would let the rounding of what is known best or
/// worst swamp what is known in other directions.
template <int N, class S>
[[nodiscard]] Status predict_root(Matrix<N, N, S>& root, Vector<N, S>& vector, Matrix<N, N, S> f,
                                  const Matrix<N, N, S>& q, double fading) {
  using std::abs;
  using std::sqrt;
  const int n = static_cast<int>(vector.size());
  const S faded = sqrt(static_cast<S>(fading));
  f *= faded;
  Matrix<N, N, S> moved = transposed<N, N, S>(root);       // (C F^-1)^T solves F^T x = C^T
  Matrix<N, N, S> back = Matrix<N, N, S>::Identity(n, n);  // F^-T
  if (!solve_square<N, N, S>(transposed<N, N, S>(f), moved) ||
      !solve_square<N, N, S>(transposed<N, N, S>(f), back))
    return Status::not_positive_definite;
  Vector<N, S> sums = Vector<N, S>::Zero(n);  // of magnitudes that make up a column of C F^-1
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      S sum(0);
      for (int k = 0; k < n; ++k) sum += abs(root(i, k)) * abs(back(j, k));
      if (sum > sums(j)) sums(j) = sum;
    }
  const Matrix<N, N, S> moved_root = transposed<N, N, S>(moved);
  const Matrix<N, N, S> g = semi_definite_root<N, S>(q);
  const Matrix<N, N, S> of_noise = column_product(moved_root, g);
  S largest(0);  // of the sums that make up C F^-1 G
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      S sum(0);
      for (int k = 0; k < n; ++k) sum += abs(moved_root(i, k)) * abs(g(k, j));
      if (sum > largest) largest = sum;
    }
  constexpr int width = N == dynamic ? dynamic : 2 * N + 1;
  // Rows that say much about the noise come first: below others, what is left of them would be a difference
  // of nearly equal numbers (A. Cox, N. Higham, "Stability of Householder QR factorization for weighted least
  // squares problems", 1998).
  Matrix<width, width, S> array = Matrix<width, width, S>::Zero(2 * n + 1, 2 * n + 1);
  Vector<N, S> size = Vector<N, S>::Zero(n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) size(i) += abs(of_noise(i, j));
  int row = 0;
  Vector<N, S> waits = Vector<N, S>::Ones(n);
  const auto put_rows = [&](const S& least) {
    for (;;) {
      int best = -1;
      for (int i = 0; i < n; ++i)
        if (waits(i) > S(0) && size(i) >= (best < 0 ? least : size(best))) best = i;
      if (best < 0) return;
      waits(best) = S(0);
      array(row, 2 * n) = vector(best) / faded;
      for (int j = 0; j < n; ++j) {
        array(row, j) = -of_noise(best, j);
        array(row, n + j) = moved_root(best, j);
      }
      ++row;
    }
  };
  put_rows(S(1));
  for (int j = 0; j < n; ++j) array(row++, j) = S(1);
  put_rows(S(0));
  if (row != 2 * n) return Status::not_finite;
  triangularise(array);
  // What the noise swamps in one direction must not reach another by its rounding.
  S least = array(0, 0);
  for (int j = 1; j < n; ++j)
    if (array(j, j) < least) least = array(j, j);
  if (!(largest * digits_left<S> <= least)) return Status::not_positive_definite;
  for (int j = 0; j < n; ++j) {
    vector(j) = array(n + j, 2 * n);
    for (int i = 0; i < n; ++i) root(i, j) = array(n + i, n + j);
  }
  S error(0);  // of C F^-1 in the deviations that are left, where there are any
  if (invert_upper<N, S>(root, moved))
    for (int j = 0; j < n; ++j) {
      S variance(0);
      for (int k = j; k < n; ++k) variance += moved(j, k) * moved(j, k);
      error += sums(j) * sqrt(variance);
    }
  return error * digits_left<S> <= S(4) ? Status::accepted : Status::not_positive_definite;
}

}  // namespace detail

/// Truth = retract(point, d); the density of d is exp(-(d^T Y d) / 2 + y^T d). Y may be singular.
template <Manifold X>
struct InformationBelief {
  using State = X;
  X point;
  CovarianceOf<X> information;
  Tangent<X> vector;

  /// Nothing known, linearised at `x`.
  [[nodiscard]] static InformationBelief ignorant(const X& x) {
    const int n = dof_of(x);
    return {x, CovarianceOf<X>::Zero(n, n), Tangent<X>::Zero(n)};
  }
  /// The same belief in information form; nothing where the covariance is of another size or singular, or so
  /// nearly that its inverse would not have three digits.
  [[nodiscard]] static std::optional<InformationBelief> from(const Gaussian<X>& belief) {
    using S = ScalarOf<X>;
    const int n = detail::common_size(belief.mean, belief.covariance);
    if (n == 0) return std::nullopt;
    InformationBelief result{belief.mean, belief.covariance, Tangent<X>::Zero(n)};
    if (!detail::sound_inverse<dof<X>, S>(belief.covariance, result.information)) return std::nullopt;
    return result;
  }
  /// Mean and covariance; nothing while some direction has no information beyond the rounding of Y.
  [[nodiscard]] std::optional<Gaussian<X>> gaussian() const {
    if (detail::common_size(point, information, vector) == 0) return std::nullopt;
    Gaussian<X> result{point, information};
    Tangent<X> d = vector;
    if (!solve(result.covariance, d)) return std::nullopt;
    result.mean = retract(point, d);
    if (!all_finite(result.covariance) || !detail::finite_state(result.mean)) return std::nullopt;
    return result;
  }

  /// Y^-1 and the step to the mean; false where that would not have three digits of its standard deviations.
  [[nodiscard]] bool solve(CovarianceOf<X>& inverse, Tangent<X>& step) const {
    using S = ScalarOf<X>;
    using std::abs;
    using std::sqrt;
    if (!detail::sound_inverse<dof<X>, S>(information, inverse)) return false;
    step = detail::column_product(inverse, vector);
    S size(0), most(1);  // of the step, in the deviations that each number has given the others
    for (int i = 0; i < static_cast<int>(step.size()); ++i) {
      size += sqrt(information(i, i)) * abs(step(i));
      if (information(i, i) * inverse(i, i) > most) most = information(i, i) * inverse(i, i);
    }
    return S(4) * size * sqrt(most) * detail::digits_left<S> <= S(1);
  }
};

/// Information filter for linear and linearised models. Options only.
struct InformationFilter {
  double fading = 1.0;             ///< fading memory: F P F^T is multiplied by this each step; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0
  template <Manifold X>
  using BeliefOf = InformationBelief<X>;

  /// Moves the belief by one step of dt. The mean of what is known is moved by the process first, so the
  /// point of linearisation follows the estimate. Refused: a singular F, a Q that is no covariance.
  template <class F, class U = detail::ControlOf<F>>
    requires(LinearisedProcess<F> || detail::explain_process<F> ||
             detail::explain_jacobian<F, ProcessModel<F>>)
  Status predict(InformationBelief<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
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
    if (plain.misfit()) return Status::size_mismatch;
    if (!all_finite(f) || !all_finite(next.information) || !all_finite(next.vector))
      return Status::not_finite;
    Status status = detail::stabilise<X>(q, fading, stabilising_noise);
    CovarianceOf<X> root = next.information;  // C^T
    Tangent<X> b = next.vector;
    if (status == Status::accepted && !detail::information_root<n, S>(next.information, root, b))
      status = Status::not_positive_definite;
    if (status != Status::accepted) return status;
    root = transposed<n, n, S>(root);
    status = detail::predict_root<n, S>(root, b, f, q, fading);
    if (status != Status::accepted) return status;
    root = transposed<n, n, S>(root);
    next.information = detail::squared_root<n, S>(root);
    next.vector = detail::column_product(root, b);
    next.point = plain.propagate(next.point, dt);
    if (plain.misfit()) return Status::size_mismatch;
    return keep(belief, next);
  }

  /// Adds the information of the measurement z, linearised at the belief's point. O(M^2 N + M N^2).
  template <class H, class V = typename H::Measurement>
    requires(LinearisedMeasurement<H> || detail::explain_sensor<H> ||
             detail::explain_jacobian<H, MeasurementModel<H>>)
  UpdateResult update(InformationBelief<typename H::State>& belief, const H& sensor, const V& z) const {
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
    if (!all_finite(r)) return Status::not_finite;
    if (!root.good() || !(root.least_share() > detail::digits_left<S>)) return Status::not_positive_definite;
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
    CovarianceOf<X> inverse = belief.information;
    Tangent<X> d = belief.vector;
    if (!belief.solve(inverse, d) || !all_finite(d)) return false;
    if (!detail::move_by(belief.point, d)) return false;
    belief.vector.setZero();
    return true;
  }

private:
  template <Manifold X>
  static Status keep(InformationBelief<X>& belief, const InformationBelief<X>& next) {
    if (!all_finite(next.information) || !all_finite(next.vector) || !detail::finite_state(next.point))
      return Status::not_finite;
    const CovarianceOf<X> symmetric = symmetrised(next.information);
    if (!detail::is_valid_covariance<dof<X>, ScalarOf<X>>(symmetric)) return Status::not_positive_definite;
    belief = next;
    belief.information = symmetric;
    return Status::accepted;
  }
};

}}  // namespace cairn::CAIRN_ABI
