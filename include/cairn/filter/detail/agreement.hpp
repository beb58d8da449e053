// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The sentences of the compiler about a model that is none: what explain_sizes.hpp finds ends in one of
/// these. Each filter includes this file before all others, since gcc begins a message with the way by which
/// it came to the file that it speaks of, a line for each header on the way.
#pragma once

#include <concepts>
#include <cstddef>

#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Two compile-time sizes that may be the same; -1 is one known at run time.
[[nodiscard]] constexpr bool agree(int a, int b) {
  return a == b || a == -1 || b == -1;
}

template <int Rows, int Columns, class Number>
struct Expected {};
template <int Rows, int Columns, class Number>
struct Found {};

template <class A, class B>
inline constexpr bool same_size = false;
template <int R, int C, class S, int FoundR, int FoundC>
inline constexpr bool same_size<Expected<R, C, S>, Found<FoundR, FoundC, S>> =
    agree(R, FoundR) && agree(C, FoundC);
/// A row does for a column.
template <class A, class B>
inline constexpr bool same_vector = same_size<A, B>;
template <int N, class S, int FoundR, int FoundC>
inline constexpr bool same_vector<Expected<N, 1, S>, Found<FoundR, FoundC, S>> =
    (agree(N, FoundR) && agree(1, FoundC)) || (agree(1, FoundR) && agree(N, FoundC));

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

// A member function that is not const. Model is printed.
template <class Model>
struct PropagateIsConst {
  static_assert(!sizeof(Model),
                "cairn: a filter holds models as const: write \"const\" behind propagate(...)");
};
template <class Model>
struct PredictIsConst {
  static_assert(!sizeof(Model), "cairn: a filter holds models as const: write \"const\" behind predict(...)");
};
template <class Model>
struct NoiseIsConst {
  static_assert(!sizeof(Model), "cairn: a filter holds models as const: write \"const\" behind noise(...)");
};
template <class Model>
struct JacobianIsConst {
  static_assert(!sizeof(Model),
                "cairn: a filter holds models as const: write \"const\" behind jacobian(...)");
};

// What a model lacks. Model is printed.
template <class Model>
struct ProcessHasState {
  static_assert(!sizeof(Model),
                "cairn: predict() takes a process, which says in public: using State = ...; using Control = "
                "...; propagate(x, u, dt) and noise(x, u, dt). This one has no State");
};
template <class Model>
struct ProcessHasControl {
  static_assert(!sizeof(Model),
                "cairn: a process says what steers it: using Control = cairn::NoControl; where nothing does, "
                "and propagate(x, u, dt) and noise(x, u, dt) take one all the same");
};
template <class Model>
struct SensorHasState {
  static_assert(
      !sizeof(Model),
      "cairn: update() takes a sensor, which says in public: using State = ...; using Measurement = "
      "...; predict(x) and noise(x). This one has no State, so it is none: belief, sensor, "
      "measurement is the order");
};
template <class Model>
struct SensorHasMeasurement {
  static_assert(
      !sizeof(Model),
      "cairn: update() takes a sensor, which says in public: using State = ...; using Measurement = "
      "...; predict(x) and noise(x). This one has no Measurement");
};
template <class State>
struct StateIsManifold {
  static_assert(!sizeof(State),
                "cairn: a State and a Measurement are a cairn::Vector<n> (of one number too), a rotation or "
                "pose of cairn/manifold, or a type that cairn::manifold_traits is specialised for");
};
template <class Model>
struct ProcessHasPropagate {
  static_assert(!sizeof(Model),
                "cairn: a process needs `State propagate(const State&, const Control&, double dt) const`: "
                "these arguments in this order, where there is no control too (using Control = "
                "cairn::NoControl)");
};
template <class Model>
struct ProcessHasNoise {
  static_assert(
      !sizeof(Model),
      "cairn: a process needs `noise(const State&, const Control&, double dt) const`, the covariance "
      "of what a step adds: these arguments in this order");
};
template <class Model>
struct SensorHasPredict {
  static_assert(
      !sizeof(Model),
      "cairn: a sensor needs `Measurement predict(const State&) const`, what it sees without noise");
};
template <class Model>
struct SensorHasNoise {
  static_assert(!sizeof(Model),
                "cairn: a sensor needs `noise(const State&) const`, the covariance of what it errs by");
};
template <class State, class Found>
struct PropagatedIsState {
  static_assert(!sizeof(Found), "cairn: propagate() of a process returns its State, or what converts to it");
};
template <class Measurement, class Found>
struct PredictedIsMeasurement {
  static_assert(!sizeof(Found),
                "cairn: predict() of a sensor returns its Measurement, or what converts to it");
};

// What is given to a filter beside a model.
template <class Asked, class Given>
struct GivenConverts {
  static_assert(std::convertible_to<const Given&, Asked>,
                "cairn: what was given does not convert to the model's Measurement or Control; an angle is a "
                "cairn::SO2 of radians, SO2(0.3)");
};
template <class Sensor>
struct SensorIsListed {
  static_assert(!sizeof(Sensor),
                "cairn: this Timeline knows no sensor of this type: name it behind the process, "
                "Timeline<Filter, Process, Sensor, ...>");
};
template <std::size_t Modes, std::size_t Processes>
struct OneProcessForEachMode {
  static_assert(Modes == Processes,
                "cairn: Interacting<R, Filter> takes a std::tuple of R processes, one for each mode; here R "
                "is the first number of OneProcessForEachMode<...> and the second is how many there are");
};

/// False, after the sentence: of what is asked for and is not there.
template <class Sensor>
inline constexpr bool explain_listed = (static_cast<void>(sizeof(SensorIsListed<Sensor>)), false);
template <std::size_t Modes, std::size_t Processes>
inline constexpr bool explain_modes =
    (static_cast<void>(sizeof(OneProcessForEachMode<Modes, Processes>)), false);

template <class Model>
struct ModelIsLinear {
  static_assert(
      !sizeof(Model),
      "cairn: Kalman takes linear models only: this one does not say \"static constexpr bool linear = "
      "true;\". Extended takes it with its jacobian(), Unscented without");
};
template <class Model>
struct ModelHasJacobian {
  static_assert(!sizeof(Model),
                "cairn: this filter needs the model's jacobian(): write one, or hand over numeric(model) or "
                "automatic(model) of filter/differentiate.hpp, or take Unscented");
};

}}}  // namespace cairn::CAIRN_ABI::detail
