// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the compiler says about a model whose matrices have a wrong size or number type, whose functions are
/// not const, or which is no model for the filter that it is given to.
///
/// A filter takes F where `LinearProcess<F> || detail::explain_sizes<F>`: the concept is the condition; only
/// where it is false is the model looked through here, and a matrix that cannot fit ends in a sentence with
/// the sizes Expected<rows, columns, number> and Found<...> (-1 for one known at run time) instead of a list
/// of failed overloads; so does a function that is not const. explain_linear and explain_jacobian stand
/// behind it where a filter asks for more. Everything else that a model may lack is left to what the compiler
/// says of concepts. The sentences themselves: agreement.hpp.
#pragma once

#include <concepts>
#include <type_traits>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

template <class A>
using FoundIn = Found<ShapeOf<std::remove_cvref_t<A>>::rows, ShapeOf<std::remove_cvref_t<A>>::columns,
                      typename ShapeOf<std::remove_cvref_t<A>>::Scalar>;

/// Found<...> of what stands for a matrix; of all else, what was expected.
template <class Size, class A>
struct FoundOr;
template <int R, int C, class S, class A>
struct FoundOr<Expected<R, C, S>, A> {
  using type = Found<R, C, S>;
};
template <int R, int C, class S, class A>
  requires requires { typename FoundIn<A>; }
struct FoundOr<Expected<R, C, S>, A> {
  using type = FoundIn<A>;
};

/// Complete, or the compiler ends in the sentence of Claim where what stands for a matrix is not that of
/// Size. An alias, for a function would be a further line of gcc's message.
template <template <class, class> class Claim, class Size, class A>
using Claimed = Claim<Size, typename FoundOr<Size, A>::type>;

template <class X>
using SquareOf = Expected<dof<X>, dof<X>, ScalarOf<X>>;
template <class X>
using StepOf = Expected<dof<X>, 1, ScalarOf<X>>;

/// The covariance of the noise: of the model's Noise where there is one, else of X.
template <class Model, class X>
struct NoiseSizeOf {
  using type = SquareOf<X>;
};
template <class Model, class X>
  requires Manifold<typename Model::Noise>
struct NoiseSizeOf<Model, X> {
  using type = SquareOf<typename Model::Noise>;
};

/// What F says as a process. Arguments are made up from nothing: all of this is looked at only.
template <class F, Manifold X, class U>
consteval void explain_process() {
  using Asked = const F&;
  if constexpr (requires(Asked f, const X& x, const U& u, double dt) { f.propagate(x, u, dt); }) {
    using A =
        decltype(std::declval<Asked>().propagate(std::declval<const X&>(), std::declval<const U&>(), 0.0));
    if constexpr (is_vector<X>) static_cast<void>(sizeof(Claimed<PropagatedStateHas, StepOf<X>, A>));
  } else if constexpr (requires(F& f, const X& x, const U& u, double dt) { f.propagate(x, u, dt); }) {
    static_cast<void>(sizeof(PropagateIsConst<F>));
  }
  if constexpr (requires(Asked f, const X& x, const U& u, double dt) { f.noise(x, u, dt); }) {
    using A = decltype(std::declval<Asked>().noise(std::declval<const X&>(), std::declval<const U&>(), 0.0));
    static_cast<void>(sizeof(Claimed<NoiseOfProcessHas, typename NoiseSizeOf<F, X>::type, A>));
  } else if constexpr (requires(F& f, const X& x, const U& u, double dt) { f.noise(x, u, dt); }) {
    static_cast<void>(sizeof(NoiseIsConst<F>));
  }
  if constexpr (requires(Asked f, const X& x, const U& u, double dt) { f.jacobian(x, u, dt); }) {
    using A =
        decltype(std::declval<Asked>().jacobian(std::declval<const X&>(), std::declval<const U&>(), 0.0));
    static_cast<void>(sizeof(Claimed<JacobianOfProcessHas, SquareOf<X>, A>));
  } else if constexpr (requires(F& f, const X& x, const U& u, double dt) { f.jacobian(x, u, dt); }) {
    static_cast<void>(sizeof(JacobianIsConst<F>));
  }
  if constexpr (requires(Asked f, const X& x, const U& u) { f.rate(x, u); }) {
    using A = decltype(std::declval<Asked>().rate(std::declval<const X&>(), std::declval<const U&>()));
    static_cast<void>(sizeof(Claimed<RateHas, StepOf<X>, A>));
  }
  if constexpr (requires(Asked f, const X& x, const U& u) { f.rate_jacobian(x, u); }) {
    using A =
        decltype(std::declval<Asked>().rate_jacobian(std::declval<const X&>(), std::declval<const U&>()));
    static_cast<void>(sizeof(Claimed<RateJacobianHas, SquareOf<X>, A>));
  }
  if constexpr (requires(Asked f, const X& x, const U& u) { f.spectral_density(x, u); }) {
    using A =
        decltype(std::declval<Asked>().spectral_density(std::declval<const X&>(), std::declval<const U&>()));
    static_cast<void>(sizeof(Claimed<SpectralDensityHas, SquareOf<X>, A>));
  }
}

/// What H says as a sensor.
template <class H, Manifold X, Manifold Z>
consteval void explain_sensor() {
  using Asked = const H&;
  if constexpr (requires(Asked h, const X& x) { h.predict(x); }) {
    using A = decltype(std::declval<Asked>().predict(std::declval<const X&>()));
    if constexpr (is_vector<Z>) static_cast<void>(sizeof(Claimed<PredictedMeasurementHas, StepOf<Z>, A>));
  } else if constexpr (requires(H& h, const X& x) { h.predict(x); }) {
    static_cast<void>(sizeof(PredictIsConst<H>));
  }
  if constexpr (requires(Asked h, const X& x) { h.noise(x); }) {
    using A = decltype(std::declval<Asked>().noise(std::declval<const X&>()));
    static_cast<void>(sizeof(Claimed<NoiseOfSensorHas, typename NoiseSizeOf<H, Z>::type, A>));
  } else if constexpr (requires(H& h, const X& x) { h.noise(x); }) {
    static_cast<void>(sizeof(NoiseIsConst<H>));
  }
  if constexpr (requires(Asked h, const X& x) { h.jacobian(x); }) {
    using A = decltype(std::declval<Asked>().jacobian(std::declval<const X&>()));
    static_cast<void>(sizeof(Claimed<JacobianOfSensorHas, Expected<dof<Z>, dof<X>, ScalarOf<X>>, A>));
  } else if constexpr (requires(H& h, const X& x) { h.jacobian(x); }) {
    static_cast<void>(sizeof(JacobianIsConst<H>));
  }
}
template <class H, Manifold X, Manifold Part, Manifold Z>
consteval void explain_conditional_sensor() {
  using Asked = const H&;
  if constexpr (requires(Asked h, const X& x, const Part& part) { h.noise(x, part); }) {
    using A = decltype(std::declval<Asked>().noise(std::declval<const X&>(), std::declval<const Part&>()));
    static_cast<void>(sizeof(Claimed<NoiseOfSensorHas, SquareOf<Z>, A>));
  }
  if constexpr (requires(Asked h, const X& x, const Part& part) { h.part_jacobian(x, part); }) {
    using A =
        decltype(std::declval<Asked>().part_jacobian(std::declval<const X&>(), std::declval<const Part&>()));
    static_cast<void>(sizeof(Claimed<JacobianByPartHas, Expected<dof<Z>, dof<Part>, ScalarOf<Part>>, A>));
  }
}

/// What is said of a state that is none because of its steps.
template <class X>
consteval void explain_state() {
  if constexpr (requires {
                  typename manifold_traits<X>::Scalar;
                  typename manifold_traits<X>::Tangent;
                  manifold_traits<X>::dof;
                })
    static_cast<void>(sizeof(TangentIs<Vector<manifold_traits<X>::dof, typename manifold_traits<X>::Scalar>,
                                       typename manifold_traits<X>::Tangent>));
}

/// False, for a concept that is; or the sentence about the size that is wrong.
template <class Model>
inline constexpr bool explain_sizes = [] {
  if constexpr (requires { typename Model::State; }) explain_state<typename Model::State>();
  if constexpr (requires { typename Model::Measurement; }) explain_state<typename Model::Measurement>();
  if constexpr (requires { requires Manifold<typename Model::State>; }) {
    using X = typename Model::State;
    if constexpr (requires { typename Model::Control; }) explain_process<Model, X, typename Model::Control>();
    if constexpr (requires { requires Manifold<typename Model::Measurement>; }) {
      using Z = typename Model::Measurement;
      static_cast<void>(sizeof(NumberOfMeasurementIs<ScalarOf<X>, ScalarOf<Z>>));
      explain_sensor<Model, X, Z>();
      if constexpr (requires { requires Manifold<typename Model::Part>; })
        explain_conditional_sensor<Model, X, typename Model::Part, Z>();
    }
  }
  return false;
}();

/// False; or, of a model that is one in all else (IsModel), the sentence that it has no jacobian() or is not
/// linear.
template <class Model, bool IsModel>
inline constexpr bool explain_jacobian = [] {
  if constexpr (IsModel) static_cast<void>(sizeof(ModelHasJacobian<Model>));
  return false;
}();
template <class Model, bool IsModel>
inline constexpr bool explain_linear = [] {
  if constexpr (IsModel) static_cast<void>(sizeof(ModelIsLinear<Model>));
  return false;
}();

/// True where A can be given for the measurement or control T, else the sentence.
template <class T, class A>
consteval bool given_fits() {
  if constexpr (OfEigen<T> && OfEigen<A>) {
    using Size = Expected<ShapeOf<T>::rows, ShapeOf<T>::columns, typename ShapeOf<T>::Scalar>;
    static_cast<void>(sizeof(GivenVectorHas<Size, FoundIn<A>>));
    return true;
  } else {
    static_assert(std::convertible_to<const A&, T>,
                  "cairn: what was given does not convert to the model's Measurement or Control");
    return true;
  }
}

}}}  // namespace cairn::CAIRN_ABI::detail
