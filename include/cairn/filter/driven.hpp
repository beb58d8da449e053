// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Models whose noise is not simply added: they say themselves how it enters.
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
///
/// For the filters that follow the noise through the model: augmented.hpp, ensemble.hpp. Models of model.hpp,
/// whose noise is added at the end, are taken there as well.
#pragma once

#include <concepts>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

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

}  // namespace cairn::inline CAIRN_ABI
