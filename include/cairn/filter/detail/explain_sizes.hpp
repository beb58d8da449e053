// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What the compiler says about a model whose matrices have a wrong size or number type, whose functions are
/// not const, or which is no model for the filter that it is given to.
///
/// A filter takes F where `LinearProcess<F> || detail::explain_process<F>`, H where `MeasurementModel<H> ||
/// detail::explain_sensor<H>`: the concept is the condition; only where it is false is the model looked
/// through here, and a matrix that cannot fit ends in a sentence with the sizes Expected<rows, columns,
/// number> and Found<...> (-1 for one known at run time) instead of a list of failed overloads; so does a
/// function that is not const, or is not there. explain_linear and explain_jacobian stand behind it where a
/// filter asks for more; explain_sizes says nothing of what is not there. The sentences themselves:
/// agreement.hpp.
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

/// Stands for a type that may be void, so that sizeof can be asked.
template <class A>
struct Returned {};

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

/// Whether propagate(x, u, dt), predict(x) and noise() are all that a model of this kind has to have: one
/// whose noise is driven, that goes in continuous time or sees a part of the state has others.
template <class Model>
inline constexpr bool says_all_itself = !requires { typename Model::Noise; } &&
                                        !requires { typename Model::Part; } && !requires { &Model::rate; };

/// What F says as a process; whether it lacks anything, only where it is Asked for one. Arguments are made up
/// from nothing: all of this is looked at only.
template <class F, Manifold X, class U, bool Asked_for = false>
consteval void look_at_process() {
  using Asked = const F&;
  if constexpr (requires(Asked f, const X& x, const U& u, double dt) { f.propagate(x, u, dt); }) {
    using A =
        decltype(std::declval<Asked>().propagate(std::declval<const X&>(), std::declval<const U&>(), 0.0));
    if constexpr (is_vector<X> && OfEigen<std::remove_cvref_t<A>>)
      static_cast<void>(sizeof(Claimed<PropagatedStateHas, StepOf<X>, A>));
    else if constexpr (Asked_for && !std::convertible_to<A, X>)
      static_cast<void>(sizeof(PropagatedIsState<X, Returned<A>>));
  } else if constexpr (requires(F& f, const X& x, const U& u, double dt) { f.propagate(x, u, dt); }) {
    static_cast<void>(sizeof(PropagateIsConst<F>));
  } else if constexpr (Asked_for && says_all_itself<F>) {
    static_cast<void>(sizeof(ProcessHasPropagate<F>));
  }
  if constexpr (requires(Asked f, const X& x, const U& u, double dt) { f.noise(x, u, dt); }) {
    using A = decltype(std::declval<Asked>().noise(std::declval<const X&>(), std::declval<const U&>(), 0.0));
    static_cast<void>(sizeof(Claimed<NoiseOfProcessHas, typename NoiseSizeOf<F, X>::type, A>));
  } else if constexpr (requires(F& f, const X& x, const U& u, double dt) { f.noise(x, u, dt); }) {
    static_cast<void>(sizeof(NoiseIsConst<F>));
  } else if constexpr (Asked_for && says_all_itself<F>) {
    static_cast<void>(sizeof(ProcessHasNoise<F>));
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

/// What H says as a sensor, likewise.
template <class H, Manifold X, Manifold Z, bool Asked_for = false>
consteval void look_at_sensor() {
  using Asked = const H&;
  if constexpr (requires(Asked h, const X& x) { h.predict(x); }) {
    using A = decltype(std::declval<Asked>().predict(std::declval<const X&>()));
    if constexpr (is_vector<Z> && OfEigen<std::remove_cvref_t<A>>)
      static_cast<void>(sizeof(Claimed<PredictedMeasurementHas, StepOf<Z>, A>));
    else if constexpr (Asked_for && !std::convertible_to<A, Z>)
      static_cast<void>(sizeof(PredictedIsMeasurement<Z, Returned<A>>));
  } else if constexpr (requires(H& h, const X& x) { h.predict(x); }) {
    static_cast<void>(sizeof(PredictIsConst<H>));
  } else if constexpr (Asked_for && says_all_itself<H>) {
    static_cast<void>(sizeof(SensorHasPredict<H>));
  }
  if constexpr (requires(Asked h, const X& x) { h.noise(x); }) {
    using A = decltype(std::declval<Asked>().noise(std::declval<const X&>()));
    static_cast<void>(sizeof(Claimed<NoiseOfSensorHas, typename NoiseSizeOf<H, Z>::type, A>));
  } else if constexpr (requires(H& h, const X& x) { h.noise(x); }) {
    static_cast<void>(sizeof(NoiseIsConst<H>));
  } else if constexpr (Asked_for && says_all_itself<H>) {
    static_cast<void>(sizeof(SensorHasNoise<H>));
  }
  if constexpr (requires(Asked h, const X& x) { h.jacobian(x); }) {
    using A = decltype(std::declval<Asked>().jacobian(std::declval<const X&>()));
    static_cast<void>(sizeof(Claimed<JacobianOfSensorHas, Expected<dof<Z>, dof<X>, ScalarOf<X>>, A>));
  } else if constexpr (requires(H& h, const X& x) { h.jacobian(x); }) {
    static_cast<void>(sizeof(JacobianIsConst<H>));
  }
}
template <class H, Manifold X, Manifold Part, Manifold Z>
consteval void look_at_conditional_sensor() {
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
template <class X, bool Asked_for = false>
consteval void look_at_state() {
  if constexpr (requires {
                  typename manifold_traits<X>::Scalar;
                  typename manifold_traits<X>::Tangent;
                  manifold_traits<X>::dof;
                })
    static_cast<void>(sizeof(TangentIs<Vector<manifold_traits<X>::dof, typename manifold_traits<X>::Scalar>,
                                       typename manifold_traits<X>::Tangent>));
  else if constexpr (Asked_for)
    static_cast<void>(sizeof(StateIsManifold<X>));
}

/// False, after the sentence: of what is asked for as a state and is none.
template <class X>
inline constexpr bool explain_state = [] {
  look_at_state<X, true>();
  return false;
}();

/// What Eigen has yet to compute, as Vector<4>::Zero().
template <class A>
concept EigenExpression =
    requires { typename A::PlainObject; } && !std::is_same_v<A, typename A::PlainObject>;

/// A state, or the sentence: for what takes one, not for asking. Of an expression it is only asked, where the
/// arguments of a template are deduced.
template <class X>
concept StateAsked = Manifold<X> || (!EigenExpression<X> && explain_state<X>);

/// Which part of a model is asked for.
enum class Role { any, process, sensor };

/// False, for a concept that is; or the sentence about the size that is wrong, or, of a model that is asked
/// for in a role, about what it lacks.
template <class Model, Role role>
inline constexpr bool explain_as = [] {
  constexpr bool process = role == Role::process, sensor = role == Role::sensor;
  if constexpr (process && !requires { typename Model::State; })
    static_cast<void>(sizeof(ProcessHasState<Model>));
  else if constexpr (process && !requires { typename Model::Control; })
    static_cast<void>(sizeof(ProcessHasControl<Model>));
  else if constexpr (sensor && !requires { typename Model::State; })
    static_cast<void>(sizeof(SensorHasState<Model>));
  else if constexpr (sensor && !requires { typename Model::Measurement; })
    static_cast<void>(sizeof(SensorHasMeasurement<Model>));
  if constexpr (requires { typename Model::State; })
    look_at_state<typename Model::State, process || sensor>();
  if constexpr (requires { typename Model::Measurement; })
    look_at_state<typename Model::Measurement, sensor>();
  if constexpr (requires { requires Manifold<typename Model::State>; }) {
    using X = typename Model::State;
    if constexpr (requires { typename Model::Control; })
      look_at_process<Model, X, typename Model::Control, process>();
    if constexpr (requires { requires Manifold<typename Model::Measurement>; }) {
      using Z = typename Model::Measurement;
      static_cast<void>(sizeof(NumberOfMeasurementIs<ScalarOf<X>, ScalarOf<Z>>));
      look_at_sensor<Model, X, Z, sensor>();
      if constexpr (requires { requires Manifold<typename Model::Part>; })
        look_at_conditional_sensor<Model, X, typename Model::Part, Z>();
    }
  }
  return false;
}();

template <class Model>
inline constexpr bool explain_sizes = explain_as<Model, Role::any>;
template <class F>
inline constexpr bool explain_process = explain_as<F, Role::process>;
template <class H>
inline constexpr bool explain_sensor = explain_as<H, Role::sensor>;

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
    static_cast<void>(sizeof(GivenConverts<T, A>));
    return true;
  }
}

}}}  // namespace cairn::CAIRN_ABI::detail
