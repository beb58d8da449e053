// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Where states live: a point x, and small steps d from it in a vector space of `dof` numbers.
///
///   retract(x, d)  the point reached from x by the step d          x (+) d
///   local(x, y)    the step that leads from x to y                 y (-) x
///
/// Laws: retract(x, local(x, y)) = y near x; local(x, retract(x, d)) = d for small d; retract(x, 0) = x.
/// Covariances of a state are covariances of d, in the tangent space at the mean (Hertzberg, Wagner, Frese,
/// Schroeder, "Integrating generic sensor fusion algorithms with sound state representations", Information
/// Fusion 14, 2013). Groups of motions step on the right, x * exp(d), translation before rotation.
///
/// A foreign type becomes a state by specialising manifold_traits, without touching the type itself.
#pragma once

#include <concepts>
#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Teaches cairn a state type X. A specialisation has
///   using Scalar   the number type,
///   dof            size of a step, or cairn::dynamic,
///   using Tangent  Vector<dof, Scalar>,
///   static X retract(const X&, const Tangent&) and static Tangent local(const X&, const X&).
template <class X>
struct manifold_traits;

namespace detail {

/// A plain vector of Eigen's, with any options.
template <class X>
inline constexpr bool is_vector = false;
template <class S, int N, int Options, int MaxRows, int MaxColumns>
inline constexpr bool is_vector<Eigen::Matrix<S, N, 1, Options, MaxRows, MaxColumns>> = true;

/// Converts to a step, and is not a vector of another size: a size that is wrong, or known at run time only
/// where the step's is fixed, would be found out by nobody.
template <class A, class Step>
concept StepLike = std::convertible_to<A, Step> &&
                   (!requires { std::remove_cvref_t<A>::RowsAtCompileTime; } ||
                    requires {
                      requires Step::RowsAtCompileTime == dynamic ||
                                   std::remove_cvref_t<A>::RowsAtCompileTime == Step::RowsAtCompileTime;
                    });

/// A state as it is; of Eigen's expressions, maps and rows the vector that they stand for. What they refer to
/// need not outlive the call.
template <class Y>
[[nodiscard]] auto evaluated(const Y& y) {
  if constexpr (is_vector<Y> || !requires { Y::RowsAtCompileTime; }) {
    return y;
  } else {
    constexpr bool row = Y::RowsAtCompileTime == 1 && Y::ColsAtCompileTime != 1;
    using Numbers = Vector<row ? Y::ColsAtCompileTime : Y::RowsAtCompileTime, typename Y::Scalar>;
    if constexpr (row)
      return Numbers(y.eval().transpose());
    else
      return Numbers(y);
  }
}

}  // namespace detail

/// A state type: what manifold_traits knows.
template <class X>
concept Manifold = std::copyable<X> && requires(const X& x, const typename manifold_traits<X>::Tangent& d) {
  typename manifold_traits<X>::Scalar;
  { manifold_traits<X>::dof } -> std::convertible_to<int>;
  requires std::same_as<typename manifold_traits<X>::Tangent,
                        Vector<manifold_traits<X>::dof, typename manifold_traits<X>::Scalar>>;
  { manifold_traits<X>::retract(x, d) } -> std::convertible_to<X>;
  { manifold_traits<X>::local(x, x) } -> detail::StepLike<typename manifold_traits<X>::Tangent>;
};

/// Number type of a state.
template <Manifold X>
using ScalarOf = typename manifold_traits<X>::Scalar;

/// Step between two states of type X.
template <Manifold X>
using Tangent = typename manifold_traits<X>::Tangent;

/// Size of a step, or cairn::dynamic.
template <Manifold X>
inline constexpr int dof = manifold_traits<X>::dof;

/// The state reached from `x` by the step `d`.
template <Manifold X>
[[nodiscard]] X retract(const X& x, const Tangent<X>& d) {
  return manifold_traits<X>::retract(x, d);
}

/// The step that leads from `x` to `y`.
template <Manifold X>
[[nodiscard]] Tangent<X> local(const X& x, const X& y) {
  return manifold_traits<X>::local(x, y);
}

/// Size of a step at `x`: dof<X>, or what x says where that is dynamic.
template <Manifold X>
[[nodiscard]] int dof_of(const X& x) {
  if constexpr (detail::is_vector<X>)
    return static_cast<int>(x.size());
  else if constexpr (dof<X> == dynamic)
    return static_cast<int>(manifold_traits<X>::local(x, x).size());
  else
    return dof<X>;
}

/// Plain vectors of fixed or run-time size: steps are differences.
template <class S, int N, int Options, int MaxRows, int MaxColumns>
struct manifold_traits<Eigen::Matrix<S, N, 1, Options, MaxRows, MaxColumns>> {
  using Scalar = S;
  using State = Eigen::Matrix<S, N, 1, Options, MaxRows, MaxColumns>;
  using Tangent = Vector<N, S>;
  static constexpr int dof = N;
  static State retract(const State& x, const Tangent& d) { return x + d; }
  static Tangent local(const State& x, const State& y) { return y - x; }
};

}}  // namespace cairn::CAIRN_ABI
