// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A belief: the mean of a state and the covariance of the step from the mean to the truth.
#pragma once

#include <cmath>
#include <limits>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/elimination.hpp>
#include <cairn/filter/kernels.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

namespace detail {

[[noreturn, gnu::cold, gnu::noinline]] inline void raise_sizes(Eigen::Index numbers, Eigen::Index rows,
                                                               Eigen::Index columns) {
  std::string text("Gaussian: expected a mean and a square covariance of the size of the state; found ");
  text.append(std::to_string(numbers)).append(" numbers, ").append(std::to_string(rows)).append(" x ");
  raise(text.append(std::to_string(columns)));
}

}  // namespace detail

/// Truth = retract(mean, d), d ~ N(0, covariance). A plain aggregate; checked() is for numbers from outside.
template <Manifold X>
struct Gaussian {
  using State = X;
  using Scalar = ScalarOf<X>;
  using Covariance = CovarianceOf<X>;

  X mean;
  Covariance covariance;

  /// The belief, after checking that the covariance is finite, symmetric (to 1e-9 of its diagonal) and
  /// positive semi-definite and fits the mean. Throws Error naming the entry.
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

template <int N, class S>
[[nodiscard]] inline bool is_valid_covariance(const Matrix<N, N, S>& a) {
  if constexpr (N != dynamic) {
    return is_covariance<N, S>(a);
  } else {
    const int n = static_cast<int>(a.rows());
    Matrix<N, N, S> work = a;
    const S slack = S(64) * std::numeric_limits<S>::epsilon();
    bool good = all_finite(a);
    for (int j = 0; j < n && good; ++j) {
      const S pivot = work(j, j);
      const S floor = slack * a(j, j);
      good = pivot >= -floor && a(j, j) >= S(0);
      for (int k = j + 1; k < n; ++k) {
        if (pivot > floor)
          work.col(k).tail(n - j) -= work.col(j).tail(n - j) * (work(k, j) / pivot);
        else
          good = good && work(k, j) * work(k, j) <= S(4) * slack * a(j, j) * a(k, k);
      }
    }
    return good;
  }
}

/// Lower triangular L with L L^T = a for a symmetric positive semi-definite a; directions without variance
/// give columns of zeros.
template <int N, class S>
[[nodiscard]] Matrix<N, N, S> semi_definite_root(const Matrix<N, N, S>& a) {
  using std::sqrt;
  const int n = static_cast<int>(a.rows());
  Matrix<N, N, S> lower = Matrix<N, N, S>::Zero(n, n);
  if constexpr (N != dynamic) {
    static_cast<void>(covariance_root<N, S>(a, lower));
    return lower;
  }
  const S slack = S(64) * std::numeric_limits<S>::epsilon();
  for (int j = 0; j < n; ++j) {
    S pivot = a(j, j);
    for (int k = 0; k < j; ++k) pivot -= lower(j, k) * lower(j, k);
    if (!(pivot > slack * a(j, j))) continue;
    lower(j, j) = sqrt(pivot);
    for (int i = j + 1; i < n; ++i) {
      S sum = a(i, j);
      for (int k = 0; k < j; ++k) sum -= lower(i, k) * lower(j, k);
      lower(i, j) = sum / lower(j, j);
    }
  }
  return lower;
}

/// The root of a covariance and whether it is one.
template <int N, class S>
[[nodiscard]] bool checked_root(const Matrix<N, N, S>& a, Matrix<N, N, S>& root) {
  if constexpr (N != dynamic) {
    return covariance_root<N, S>(a, root);
  } else {
    if (!is_valid_covariance<N, S>(a)) return false;
    root = semi_definite_root<N, S>(a);
    return true;
  }
}

/// d^T a^-1 d for positive definite a; infinity where a is singular in a direction that d has.
template <int N, class S>
[[nodiscard]] S squared_mahalanobis(const Vector<N, S>& d, const Matrix<N, N, S>& a) {
  const int n = static_cast<int>(a.rows());
  const Matrix<N, N, S> lower = semi_definite_root<N, S>(a);
  Vector<N, S> y = d;
  S sum(0);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) y(i) -= lower(i, k) * y(k);
    if (lower(i, i) == S(0)) {
      if (y(i) != S(0)) return std::numeric_limits<S>::infinity();
      continue;
    }
    y(i) /= lower(i, i);
    sum += y(i) * y(i);
  }
  return sum;
}

}  // namespace detail

template <Manifold X>
Gaussian<X> Gaussian<X>::checked(const X& mean, const Covariance& covariance) {
  using std::abs;
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
    for (int j = 0; j < n; ++j) {
      if (!detail::finite(covariance(i, j)))
        complain("Gaussian: covariance entry is not finite: row ", i, ", column ", j);
      const Scalar scale = abs(covariance(i, i)) + abs(covariance(j, j));
      if (abs(covariance(i, j) - covariance(j, i)) > Scalar(1e-9) * scale)
        complain("Gaussian: the covariance is not symmetric: row ", i, ", column ", j);
    }
  const Covariance symmetric = symmetrised(covariance);
  if (!detail::is_valid_covariance<dof<X>, Scalar>(symmetric))
    raise("Gaussian: the covariance is not positive semi-definite");
  return {mean, symmetric};
}

/// Normalised estimation error squared of the belief at `truth`: d^T P^-1 d with d = local(mean, truth);
/// chi-square of dof numbers for a consistent filter.
template <Manifold X>
[[nodiscard]] ScalarOf<X> nees(const Gaussian<X>& belief, const X& truth) {
  CAIRN_EXPECTS(detail::common_size(belief.mean, belief.covariance) == dof_of(truth),
                "nees needs a covariance and a truth of the mean's size");
  const Tangent<X> d = local(belief.mean, truth);
  return detail::squared_mahalanobis<dof<X>, ScalarOf<X>>(d, belief.covariance);
}

/// A state drawn from the belief.
template <Manifold X>
[[nodiscard]] X sample(const Gaussian<X>& belief, Random& random) {
  CAIRN_EXPECTS(detail::common_size(belief.mean, belief.covariance) > 0,
                "sample needs a covariance of the mean's size");
  Tangent<X> d = manifold_traits<X>::local(belief.mean, belief.mean);
  for (int i = 0; i < static_cast<int>(d.size()); ++i) d(i) = static_cast<ScalarOf<X>>(random.normal());
  const Tangent<X> step = detail::semi_definite_root<dof<X>, ScalarOf<X>>(belief.covariance) * d;
  return retract(belief.mean, step);
}

}  // namespace cairn::inline CAIRN_ABI
