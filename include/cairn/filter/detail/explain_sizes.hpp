// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the compiler says about a model whose matrices have a wrong size or number type.
///
/// A filter takes F where `LinearProcess<F> || detail::explain_sizes<F>`: the concept is the condition; only
/// where it is false is the model looked through here, and a matrix that cannot fit ends in a sentence with
/// the sizes Expected<rows, columns, number> and Found<...> (-1 for one known at run time) instead of a list
/// of failed overloads. Everything else that a model may lack is left to what the compiler says of concepts.
#pragma once

#include <concepts>
#include <type_traits>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

template <int Rows, int Columns, class Number>
struct Expected {};
template <int Rows, int Columns, class Number>
struct Found {};

template <class A>
using FoundIn = Found<ShapeOf<std::remove_cvref_t<A>>::rows, ShapeOf<std::remove_cvref_t<A>>::columns,
                      typename ShapeOf<std::remove_cvref_t<A>>::Scalar>;

template <class A, class B>
inline constexpr bool same_size = false;
template <int R, int C, class S, int FoundR, int FoundC>
inline constexpr bool same_size<Expected<R, C, S>, Found<FoundR, FoundC, S>> =
    may_equal(R, FoundR) && may_equal(C, FoundC);
/// A row does for a column.
template <class A, class B>
inline constexpr bool same_vector = same_size<A, B>;
template <int N, class S, int FoundR, int FoundC>
inline constexpr bool same_vector<Expected<N, 1, S>, Found<FoundR, FoundC, S>> =
    (may_equal(N, FoundR) && may_equal(1, FoundC)) || (may_equal(1, FoundR) && may_equal(N, FoundC));

// One for each thing a model says, so that the sentence names it. "Expected" and "Found" stand beside it in
// what the compiler prints.
template <class Expected, class Found>
struct NoiseOfProcessHas {
  static_assert(
      same_size<Expected, Found>,
      "cairn: noise(x, u, dt) of a process is the covariance of a step of its State (of its Noise, where it "
      "has one); Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct JacobianOfProcessHas {
  static_assert(same_size<Expected, Found>,
                "cairn: jacobian(x, u, dt) of a process maps steps of its State to steps of its State; "
                "Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct PropagatedStateHas {
  static_assert(same_vector<Expected, Found>,
                "cairn: propagate() of a process returns its State; Expected<rows, columns, number type> and "
                "Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct NoiseOfSensorHas {
  static_assert(
      same_size<Expected, Found>,
      "cairn: noise(x) of a sensor is the covariance of a step of its Measurement (of its Noise, where it "
      "has one); Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct JacobianOfSensorHas {
  static_assert(same_size<Expected, Found>,
                "cairn: jacobian(x) of a sensor maps steps of its State to steps of its Measurement; "
                "Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct PredictedMeasurementHas {
  static_assert(same_vector<Expected, Found>,
                "cairn: predict() of a sensor returns its Measurement; Expected<rows, columns, number type> "
                "and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct RateHas {
  static_assert(same_vector<Expected, Found>,
                "cairn: rate(x, u) of a process in continuous time is a step of its State a second; "
                "Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct RateJacobianHas {
  static_assert(
      same_size<Expected, Found>,
      "cairn: rate_jacobian(x, u) of a process in continuous time maps steps of its State to rates; "
      "Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct SpectralDensityHas {
  static_assert(
      same_size<Expected, Found>,
      "cairn: spectral_density(x, u) of a process in continuous time is a covariance of steps of its State a "
      "second; Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct JacobianByPartHas {
  static_assert(
      same_size<Expected, Found>,
      "cairn: part_jacobian(x, part) of a sensor maps steps of its Part to steps of its Measurement; "
      "Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class Expected, class Found>
struct GivenVectorHas {
  static_assert(same_vector<Expected, Found>,
                "cairn: the measurement or control that was given is no Measurement or Control of the model; "
                "Expected<rows, columns, number type> and Found<...> say what it has to be and what it is");
};
template <class OfState, class OfMeasurement>
struct NumberOfMeasurementIs {
  static_assert(std::same_as<OfState, OfMeasurement>,
                "cairn: a Measurement has the number type of the State it is taken of");
};
template <class Expected, class Found>
struct TangentIs {
  static_assert(
      std::same_as<Expected, Found>,
      "cairn: a step of a State is Vector<dof, Scalar>: manifold_traits<State>::Tangent has to be that");
};

/// Ends in the sentence of `Claim` where what stands for a matrix is not that of Size.
template <template <class, class> class Claim, class Size, class A>
consteval void claim() {
  if constexpr (requires { typename FoundIn<A>; }) static_cast<void>(sizeof(Claim<Size, FoundIn<A>>));
}

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
    if constexpr (is_vector<X>) claim<PropagatedStateHas, StepOf<X>, A>();
  }
  if constexpr (requires(Asked f, const X& x, const U& u, double dt) { f.noise(x, u, dt); }) {
    using A = decltype(std::declval<Asked>().noise(std::declval<const X&>(), std::declval<const U&>(), 0.0));
    claim<NoiseOfProcessHas, typename NoiseSizeOf<F, X>::type, A>();
  }
  if constexpr (requires(Asked f, const X& x, const U& u, double dt) { f.jacobian(x, u, dt); }) {
    using A =
        decltype(std::declval<Asked>().jacobian(std::declval<const X&>(), std::declval<const U&>(), 0.0));
    claim<JacobianOfProcessHas, SquareOf<X>, A>();
  }
  if constexpr (requires(Asked f, const X& x, const U& u) { f.rate(x, u); }) {
    using A = decltype(std::declval<Asked>().rate(std::declval<const X&>(), std::declval<const U&>()));
    claim<RateHas, StepOf<X>, A>();
  }
  if constexpr (requires(Asked f, const X& x, const U& u) { f.rate_jacobian(x, u); }) {
    using A =
        decltype(std::declval<Asked>().rate_jacobian(std::declval<const X&>(), std::declval<const U&>()));
    claim<RateJacobianHas, SquareOf<X>, A>();
  }
  if constexpr (requires(Asked f, const X& x, const U& u) { f.spectral_density(x, u); }) {
    using A =
        decltype(std::declval<Asked>().spectral_density(std::declval<const X&>(), std::declval<const U&>()));
    claim<SpectralDensityHas, SquareOf<X>, A>();
  }
}

/// What H says as a sensor.
template <class H, Manifold X, Manifold Z>
consteval void explain_sensor() {
  using Asked = const H&;
  if constexpr (requires(Asked h, const X& x) { h.predict(x); }) {
    using A = decltype(std::declval<Asked>().predict(std::declval<const X&>()));
    if constexpr (is_vector<Z>) claim<PredictedMeasurementHas, StepOf<Z>, A>();
  }
  if constexpr (requires(Asked h, const X& x) { h.noise(x); }) {
    using A = decltype(std::declval<Asked>().noise(std::declval<const X&>()));
    claim<NoiseOfSensorHas, typename NoiseSizeOf<H, Z>::type, A>();
  }
  if constexpr (requires(Asked h, const X& x) { h.jacobian(x); }) {
    using A = decltype(std::declval<Asked>().jacobian(std::declval<const X&>()));
    claim<JacobianOfSensorHas, Expected<dof<Z>, dof<X>, ScalarOf<X>>, A>();
  }
}
template <class H, Manifold X, Manifold Part, Manifold Z>
consteval void explain_conditional_sensor() {
  using Asked = const H&;
  if constexpr (requires(Asked h, const X& x, const Part& part) { h.noise(x, part); }) {
    using A = decltype(std::declval<Asked>().noise(std::declval<const X&>(), std::declval<const Part&>()));
    claim<NoiseOfSensorHas, SquareOf<Z>, A>();
  }
  if constexpr (requires(Asked h, const X& x, const Part& part) { h.part_jacobian(x, part); }) {
    using A =
        decltype(std::declval<Asked>().part_jacobian(std::declval<const X&>(), std::declval<const Part&>()));
    claim<JacobianByPartHas, Expected<dof<Z>, dof<Part>, ScalarOf<Part>>, A>();
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
