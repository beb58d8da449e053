// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A belief: the mean of a state and the covariance of the step from the mean to the truth.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/factor.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/detail/explain_sizes.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

[[noreturn, gnu::cold, gnu::noinline]] inline void raise_sizes(Eigen::Index numbers, Eigen::Index rows,
                                                               Eigen::Index columns) {
  std::string text("Gaussian: expected a mean and a square covariance of the size of the state; found ");
  text.append(std::to_string(numbers)).append(" numbers, ").append(std::to_string(rows)).append(" x ");
  raise(text.append(std::to_string(columns)));
}

}  // namespace detail

/// How the covariance is lowered by a measurement.
enum class Form { standard, joseph, sequential };

/// Truth = retract(mean, d), d ~ N(0, covariance). A plain aggregate; checked() is for numbers from outside.
template <detail::StateAsked X>
struct Gaussian {
  using State = X;
  using Scalar = ScalarOf<X>;
  using Covariance = CovarianceOf<X>;

  X mean;
  Covariance covariance;

  /// Itself, as every belief gives and is made of one (filter.hpp).
  [[nodiscard]] static Gaussian from(const Gaussian& belief) { return belief; }
  [[nodiscard]] Gaussian gaussian() const { return *this; }

  /// The belief, after checking that the covariance is finite, symmetric (to 1e-9 of the two standard
  /// deviations, 1e-4 in float) and positive semi-definite and fits the mean. Throws Error naming the entry.
  [[nodiscard]] static Gaussian checked(const X& mean, const Covariance& covariance);
  /// The same of anything that stands for them: run-time sizes are checked too.
  template <StateOf<X> M, MatrixOf<dof<X>, dof<X>, Scalar> P>
  [[nodiscard]] static Gaussian checked(const M& mean, const P& covariance) {
    bool misfit = false;
    const int n = dof<X> != dynamic ? dof<X> : static_cast<int>(covariance.rows());
    const Covariance matrix = detail::plain_matrix<dof<X>, dof<X>, Scalar>(covariance, n, n, misfit);
    if constexpr (detail::is_vector<X>) {
      const X center = detail::plain_vector<X>(mean, n, misfit);
      if (misfit) detail::raise_sizes(mean.size(), covariance.rows(), covariance.cols());
      return checked(center, matrix);
    } else {
      if (misfit) detail::raise_sizes(n, covariance.rows(), covariance.cols());
      return checked(X(mean), matrix);
    }
  }
};

/// `Gaussian belief{Vector<4>::Zero(), 100 * Matrix<4>::Identity()}` is of a Vector<4>.
template <Manifold X, class P>
Gaussian(const X& mean, const P& covariance) -> Gaussian<X>;
template <detail::EigenExpression M, class P>
Gaussian(const M& mean, const P& covariance) -> Gaussian<Vector<M::RowsAtCompileTime, typename M::Scalar>>;

namespace detail {

template <class S>
[[nodiscard]] inline bool finite(const S& value) {
  return value - value == S(0);
}

/// Every number of the state is finite. A step from x to itself is zero unless something is not.
template <Manifold X>
[[nodiscard]] inline bool finite_state(const X& x) {
  if constexpr (is_vector<X>)
    return all_finite(x);
  else if constexpr (requires { manifold_traits<X>::finite(x); })
    return manifold_traits<X>::finite(x);
  else
    return all_finite(manifold_traits<X>::local(x, x));
}

/// x moved by d, unless that leaves what numbers can hold: false then, and x as it was.
template <Manifold X>
[[nodiscard]] inline bool move_by(X& x, const Tangent<X>& d) {
  const X moved = manifold_traits<X>::retract(x, d);
  if (!finite_state(moved)) [[unlikely]]
    return false;
  x = moved;
  return true;
}

/// d^T a^-1 d, of the pseudo-inverse, for a singular a; infinity where d leaves the directions in which a has
/// variance by more than the deviation that rounding of a may have hidden, or a is no covariance.
template <int N, class S>
[[nodiscard, gnu::cold, gnu::noinline]] S mahalanobis_of_singular(const Vector<N, S>& d,
                                                                  const Matrix<N, N, S>& a) {
  PivotedRoot<N, S> p;
  if (!pivoted_root<N, S>(a, p)) return std::numeric_limits<S>::infinity();
  Vector<N, S> left = d;
  S sum(0);
  for (int k = 0; k < p.rank; ++k) {
    const S y = left(p.order(k)) / p.root(p.order(k), k);
    sum += y * y;
    for (int i = 0; i < static_cast<int>(d.size()); ++i) left(i) -= p.root(i, k) * y;
  }
  for (int i = 0; i < static_cast<int>(d.size()); ++i)
    if (!(left(i) * left(i) <= rounding_share<S> * a(i, i) * (S(1) + sum)))
      return std::numeric_limits<S>::infinity();
  return sum;
}

/// d^T a^-1 d of a covariance a; where that is singular, of its pseudo-inverse.
template <int N, class S>
[[nodiscard]] S squared_mahalanobis(const Vector<N, S>& d, const Matrix<N, N, S>& a) {
  const int n = static_cast<int>(a.rows());
  Matrix<N, N, S> lower;
  if (!regular_root<N, S>(a, lower)) return mahalanobis_of_singular<N, S>(d, a);
  Vector<N, S> y = d;
  S sum(0);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) y(i) -= lower(i, k) * y(k);
    y(i) /= lower(i, i);
    sum += y(i) * y(i);
  }
  return sum;
}

}  // namespace detail

template <detail::StateAsked X>
Gaussian<X> Gaussian<X>::checked(const X& mean, const Covariance& covariance) {
  using std::abs;
  using std::sqrt;
  const Scalar tolerance = std::max(Scalar(1e-9), Scalar(1024) * std::numeric_limits<Scalar>::epsilon());
  const int n = dof_of(mean);
  const auto complain = [](const char* what, Eigen::Index i, const char* between, Eigen::Index j) {
    std::string text(what);  // appended piecewise: gcc 12 warns wrongly about "literal" + string
    text.append(std::to_string(i)).append(between).append(std::to_string(j));
    raise(text);
  };
  if (covariance.rows() != n || covariance.cols() != n)
    complain(
        "Gaussian: expected a square covariance, one row for each of the numbers of a step; found rows: ",
        covariance.rows(), ", numbers: ", n);
  if (!detail::finite_state(mean)) raise("Gaussian: the mean is not finite");
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      if (!detail::finite(covariance(i, j)))
        complain("Gaussian: covariance entry is not finite: row ", i, ", column ", j);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const Scalar scale = sqrt(abs(covariance(i, i))) * sqrt(abs(covariance(j, j)));
      if (!(abs(covariance(i, j) - covariance(j, i)) <= tolerance * scale))
        complain("Gaussian: the covariance is not symmetric: row ", i, ", column ", j);
    }
  const Covariance symmetric = symmetrised(covariance);
  Covariance root = symmetric;
  if (!detail::dense_root<dof<X>, Scalar>(symmetric, root))
    raise("Gaussian: the covariance is not positive semi-definite");
  return {mean, symmetric};
}

/// Normalised estimation error squared of the belief at `truth`: d^T P^-1 d with d = local(mean, truth). For
/// a consistent filter it is chi-square of as many degrees of freedom as P has rank: dof where P is regular.
/// Where P is singular its pseudo-inverse stands for P^-1, and the result is infinity for an error in a
/// direction without variance, one that exceeds the deviation that the rounding of P may hide.
template <Manifold X>
[[nodiscard]] ScalarOf<X> nees(const Gaussian<X>& belief, const std::type_identity_t<X>& truth) {
  CAIRN_EXPECTS(detail::common_size(belief.mean, belief.covariance) == dof_of(truth),
                "nees needs a covariance and a truth of the mean's size");
  const Tangent<X> d = local(belief.mean, truth);
  return detail::squared_mahalanobis<dof<X>, ScalarOf<X>>(d, belief.covariance);
}

namespace detail {

/// A state drawn from the belief; nothing where its covariance is none.
template <Manifold X>
[[nodiscard]] std::optional<X> drawn_from(const Gaussian<X>& belief, Random& random) {
  if (common_size(belief.mean, belief.covariance) <= 0) return std::nullopt;
  Tangent<X> d = manifold_traits<X>::local(belief.mean, belief.mean);
  for (int i = 0; i < static_cast<int>(d.size()); ++i) d(i) = static_cast<ScalarOf<X>>(random.normal());
  CovarianceOf<X> root = belief.covariance;
  if (!dense_root<dof<X>, ScalarOf<X>>(belief.covariance, root)) return std::nullopt;
  const Tangent<X> step = root * d;
  return retract(belief.mean, step);
}

}  // namespace detail

/// A state drawn from the belief, whose covariance may be singular but must be one.
template <Manifold X>
[[nodiscard]] X sample(const Gaussian<X>& belief, Random& random) {
  CAIRN_EXPECTS(detail::common_size(belief.mean, belief.covariance) > 0,
                "sample needs a covariance of the mean's size");
  std::optional<X> drawn = detail::drawn_from(belief, random);
  CAIRN_EXPECTS(drawn, "sample needs a covariance: finite, symmetric and positive semi-definite");
  return *std::move(drawn);
}

}}  // namespace cairn::CAIRN_ABI
