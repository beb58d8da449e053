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

#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// Teaches cairn a state type X. A specialisation has
///   using Scalar   the number type,
///   dof            size of a step, or cairn::dynamic,
///   using Tangent  Vector<dof, Scalar>,
///   static X retract(const X&, const Tangent&) and static Tangent local(const X&, const X&).
template <class X>
struct manifold_traits;

/// A state type: what manifold_traits knows.
template <class X>
concept Manifold = std::copyable<X> && requires(const X& x, const typename manifold_traits<X>::Tangent& d) {
  typename manifold_traits<X>::Scalar;
  { manifold_traits<X>::dof } -> std::convertible_to<int>;
  { manifold_traits<X>::retract(x, d) } -> std::convertible_to<X>;
  { manifold_traits<X>::local(x, x) } -> std::convertible_to<typename manifold_traits<X>::Tangent>;
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
  if constexpr (dof<X> == dynamic)
    return static_cast<int>(manifold_traits<X>::local(x, x).size());
  else
    return dof<X>;
}

/// Plain vectors of fixed or run-time size: steps are differences.
template <class S, int N, int Options, int MaxRows, int MaxColumns>
struct manifold_traits<Eigen::Matrix<S, N, 1, Options, MaxRows, MaxColumns>> {
  using Scalar = S;
  using State = Eigen::Matrix<S, N, 1, Options, MaxRows, MaxColumns>;
  using Tangent = State;
  static constexpr int dof = N;
  static State retract(const State& x, const Tangent& d) { return x + d; }
  static Tangent local(const State& x, const State& y) { return y - x; }
};

}  // namespace cairn::inline CAIRN_ABI
