// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a filter asks of a model: plain structs with a few member functions.
///
/// ```cpp
/// struct Unicycle {
///   using State = cairn::SE2;  using Control = cairn::Vector<2>;
///   State propagate(const State& x, const Control& u, double dt) const;  // x at the next step, no noise
///   cairn::Matrix<3> noise(const State& x, const Control& u, double dt) const;  // per step, at the new x
///   cairn::Matrix<3> jacobian(const State& x, const Control& u, double dt) const;  // optional
/// };
/// struct Compass {
///   using State = cairn::SE2;  using Measurement = cairn::SO2;
///   Measurement predict(const State& x) const;           // without noise
///   cairn::Matrix<1> noise(const State& x) const;        // covariance of local(predict(x), z)
///   cairn::Matrix<1, 3> jacobian(const State& x) const;  // optional
/// };
/// ```
///
/// Laws, which tests check and types cannot: noise is symmetric and at least zero (a sensor's above zero),
/// propagate(x, u, 0) = x, jacobians agree with numeric differentiation in the tangent spaces. A model whose
/// propagate or predict is its (constant in x) jacobian times x plus something known says so with
/// `static constexpr bool linear = true;`. Nothing is differentiated silently: numeric(model) and
/// automatic(model) of differentiate.hpp are asked for by name.
///
/// Matrices and vectors may be returned as anything that stands for one (matrix_of.hpp): Structured, with
/// zeros that the filters skip, row-major, a Map, an expression. An expression of Eigen's refers to the
/// matrices it is made of: of members and arguments it may be returned as auto, of a temporary (H * x +
/// Vector<2>(1, 1)) it reads what is gone: write the type. Another number of rows or columns, or another
/// number type, does not compile; sizes known at run time are compared (Status::size_mismatch).
///
/// Models whose noise is not simply added say themselves how it enters, for the filters that follow it
/// through the model (augmented_unscented.hpp, ensemble.hpp), which take the others as well:
///
/// ```cpp
/// struct Driven {  // noise w enters through the motion
///   using State = cairn::SE2;  using Control = cairn::Vector<2>;  using Noise = cairn::Vector<2>;
///   State propagate(const State& x, const Control& u, const Noise& w, double dt) const;
///   cairn::Matrix<2> noise(const State& x, const Control& u, double dt) const;  // covariance of w
/// };
/// struct Echo {  // noise v enters through the sensor
///   using State = cairn::SE2;  using Measurement = cairn::Vector<1>;  using Noise = cairn::Vector<1>;
///   Measurement predict(const State& x, const Noise& v) const;
///   cairn::Matrix<1> noise(const State& x) const;  // covariance of v
/// };
/// ```
#pragma once

#include <concepts>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/detail/explain_sizes.hpp>
#include <cairn/filter/matrix_of.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// The control of a process that has none.
struct NoControl {};

namespace detail {

/// The type of a process's control; none where it does not say, so that a sentence can.
template <class F>
struct ControlOfProcess {
  using type = NoControl;
};
template <class F>
  requires requires { typename F::Control; }
struct ControlOfProcess<F> {
  using type = typename F::Control;
};
template <class F>
using ControlOf = typename ControlOfProcess<F>::type;

/// The control where none is given: there is none, and a process that has one must be told it.
template <class U>
[[nodiscard]] constexpr U no_control() {
  static_assert(
      std::same_as<U, NoControl>,
      "cairn: this process has a Control, which is not zero by default: give it as the last argument");
  return U{};
}

}  // namespace detail

/// Square matrix of the tangent space of X.
template <Manifold X>
using CovarianceOf = Matrix<dof<X>, dof<X>, ScalarOf<X>>;

/// Matrix that maps steps of From to steps of To.
template <Manifold To, Manifold From>
using JacobianOf = Matrix<dof<To>, dof<From>, ScalarOf<From>>;

namespace detail {

template <class A, class X>
concept CovarianceLike = MatrixOf<A, dof<X>, dof<X>, ScalarOf<X>>;
template <class A, class To, class From>
concept JacobianLike = MatrixOf<A, dof<To>, dof<From>, ScalarOf<From>>;

}  // namespace detail

/// How a state moves: propagate and noise.
template <class F>
concept ProcessModel = Manifold<typename F::State> && requires(const F& f, const typename F::State& x,
                                                               const typename F::Control& u, double dt) {
  { f.propagate(x, u, dt) } -> StateOf<typename F::State>;
  { f.noise(x, u, dt) } -> detail::CovarianceLike<typename F::State>;
};

/// A process that gives its derivative: step of the new state by step of the old.
template <class F>
concept LinearisedProcess = ProcessModel<F> && requires(const F& f, const typename F::State& x,
                                                        const typename F::Control& u, double dt) {
  { f.jacobian(x, u, dt) } -> detail::JacobianLike<typename F::State, typename F::State>;
};

/// A process that is linear in its state.
template <class F>
concept LinearProcess = LinearisedProcess<F> && F::linear;

/// What a sensor reports of a state: predict and noise.
template <class H>
concept MeasurementModel = Manifold<typename H::State> && Manifold<typename H::Measurement> &&
                           std::same_as<ScalarOf<typename H::State>, ScalarOf<typename H::Measurement>> &&
                           requires(const H& h, const typename H::State& x) {
                             { h.predict(x) } -> StateOf<typename H::Measurement>;
                             { h.noise(x) } -> detail::CovarianceLike<typename H::Measurement>;
                           };

/// A sensor that gives its derivative: step of the measurement by step of the state.
template <class H>
concept LinearisedMeasurement = MeasurementModel<H> && requires(const H& h, const typename H::State& x) {
  { h.jacobian(x) } -> detail::JacobianLike<typename H::Measurement, typename H::State>;
};

/// A sensor that is linear in the state.
template <class H>
concept LinearMeasurement = LinearisedMeasurement<H> && H::linear;

/// A process and a sensor that speak of the same state.
template <class F, class H>
concept StateModel =
    ProcessModel<F> && MeasurementModel<H> && std::same_as<typename F::State, typename H::State>;

/// A process that says how its noise enters: propagate(x, u, w, dt), w ~ N(0, noise(x, u, dt)), a vector.
template <class F>
concept DrivenProcess = Manifold<typename F::State> && Manifold<typename F::Noise> &&
                        requires(const F& f, const typename F::State& x, const typename F::Control& u,
                                 const typename F::Noise& w, double dt) {
                          { f.propagate(x, u, w, dt) } -> StateOf<typename F::State>;
                          { f.noise(x, u, dt) } -> detail::CovarianceLike<typename F::Noise>;
                        };

/// A sensor that says how its noise enters: predict(x, v), v ~ N(0, noise(x)), a vector.
template <class H>
concept DrivenMeasurement =
    Manifold<typename H::State> && Manifold<typename H::Measurement> && Manifold<typename H::Noise> &&
    requires(const H& h, const typename H::State& x, const typename H::Noise& v) {
      { h.predict(x, v) } -> StateOf<typename H::Measurement>;
      { h.noise(x) } -> detail::CovarianceLike<typename H::Noise>;
    };

namespace detail {

template <class F>
struct NoiseOfProcess {
  using type = Tangent<typename F::State>;
};
template <DrivenProcess F>
struct NoiseOfProcess<F> {
  using type = typename F::Noise;
};
template <class H>
struct NoiseOfSensor {
  using type = Tangent<typename H::Measurement>;
};
template <DrivenMeasurement H>
struct NoiseOfSensor<H> {
  using type = typename H::Noise;
};

}  // namespace detail

/// Additive or driven.
template <class F>
concept AnyProcess = ProcessModel<F> || DrivenProcess<F>;
template <class H>
concept AnyMeasurement = MeasurementModel<H> || DrivenMeasurement<H>;

namespace detail {

/// A + B, where both are known at compile time.
template <int A, int B>
inline constexpr int size_sum = A == dynamic || B == dynamic ? dynamic : A + B;

/// Numbers of a step where mean and matrix fit one another, else 0.
template <Manifold X>
[[gnu::always_inline]] [[nodiscard]] inline int common_size(const X& mean, const CovarianceOf<X>& matrix) {
  if constexpr (dof<X> != dynamic) {
    return dof<X>;
  } else {
    const int n = dof_of(mean);
    return has_size(matrix, n, n) ? n : 0;
  }
}
template <Manifold X>
[[gnu::always_inline]] [[nodiscard]] inline int common_size(const X& mean, const CovarianceOf<X>& matrix,
                                                            const Tangent<X>& vector) {
  const int n = common_size(mean, matrix);
  return vector.size() == n ? n : 0;
}

/// Numbers of a step where all of one or more states have as many, else 0.
template <class States>
[[nodiscard]] int common_size(const States& states) {
  using X = typename States::value_type;
  if constexpr (dof<X> != dynamic) {
    return dof<X>;
  } else {
    const int n = states.empty() ? 0 : dof_of(states[0]);
    for (const X& x : states)
      if (dof_of(x) != n) return 0;
    return n;
  }
}

}  // namespace detail
}}  // namespace cairn::CAIRN_ABI
