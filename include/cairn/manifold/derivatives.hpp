// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Derivatives of functions between manifolds, in their tangent spaces: by central differences, and by dual
/// numbers through a templated function.
///
///   J(i, j) = d local(f(x), f(retract(x, d)))_i / d d_j   at d = 0
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/dual.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/product.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The derivative of f at x by central differences: 2 dof + 1 calls of f. The step is eps^(1/3) times
/// max(1, |x_j|) for vectors and eps^(1/3) for other states; the error is about eps^(2/3) of f'''.
/// Empty where f returns vectors of different run-time sizes.
template <Manifold X, class F>
[[nodiscard]] auto numeric_jacobian(const F& f, const X& x) {
  using S = ScalarOf<X>;
  using Y = decltype(detail::evaluated(f(x)));
  using std::abs;
  using std::cbrt;
  const Y center = detail::evaluated(f(x));
  const int n = dof_of(x);
  Matrix<dof<Y>, dof<X>, S> jacobian(dof_of(center), n);
  Tangent<X> d = manifold_traits<X>::local(x, x);
  for (int j = 0; j < n; ++j) {
    S h = static_cast<S>(cbrt(std::numeric_limits<S>::epsilon()));
    if constexpr (requires { x(j); })
      if (abs(x(j)) > S(1)) h *= abs(x(j));
    d.setZero();
    d(j) = h;
    const Y up = detail::evaluated(f(retract(x, d)));
    d(j) = -h;
    const Y down = detail::evaluated(f(retract(x, d)));
    if constexpr (dof<Y> == dynamic)
      if (dof_of(up) != dof_of(center) || dof_of(down) != dof_of(center))
        return Matrix<dof<Y>, dof<X>, S>(0, n);
    jacobian.col(j) = (local(center, up) - local(center, down)) / (S(2) * h);
  }
  return jacobian;
}

namespace detail {

/// The state type X with another scalar.
template <class X, class T>
struct Recast;
template <class S, int N, int O, int MR, int MC, class T>
struct Recast<Eigen::Matrix<S, N, 1, O, MR, MC>, T> {
  using type = Eigen::Matrix<T, N, 1, O, MR, MC>;
  static type of(const Eigen::Matrix<S, N, 1, O, MR, MC>& x) { return x.template cast<T>(); }
};
template <template <class> class Group, class S, class T>
struct Recast<Group<S>, T> {
  using type = Group<T>;
  static type of(const Group<S>& x) { return x.template cast<T>(); }
};
template <class... Parts, class T>
struct Recast<Product<Parts...>, T> {
  using type = Product<typename Recast<Parts, T>::type...>;
  static type of(const Product<Parts...>& x) {
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      return type(Recast<Parts, T>::of(x.template part<I>())...);
    }(std::index_sequence_for<Parts...>{});
  }
};

}  // namespace detail

/// The derivative of f at x by dual numbers: one call of f, which must accept the state with any scalar
/// (a generic lambda, or a template). Exact to rounding. X has a fixed size.
template <Manifold X, class F>
[[nodiscard]] auto automatic_jacobian(const F& f, const X& x) {
  using S = ScalarOf<X>;
  constexpr int n = dof<X>;
  static_assert(n != dynamic, "automatic differentiation needs a state of fixed size");
  using D = Dual<S, n>;
  const auto lifted = detail::Recast<X, D>::of(x);
  Vector<n, D> d;
  for (int j = 0; j < n; ++j) d(j) = D::variable(S(0), j);
  const auto y = detail::evaluated(f(retract(lifted, d)));
  using Y = std::decay_t<decltype(y)>;
  const auto center = detail::evaluated(f(lifted));
  const auto step = local<Y>(center, y);
  Matrix<dof<Y>, n, S> jacobian(step.size(), n);
  for (int i = 0; i < static_cast<int>(step.size()); ++i)
    for (int j = 0; j < n; ++j) jacobian(i, j) = step(i).slope[j];
  return jacobian;
}

}}  // namespace cairn::CAIRN_ABI
