// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Rao-Blackwellised particle filter: particles over the hard part of the state, each carrying Gaussians
/// over the parts that are easy once the hard part is known. With a pose as the hard part and landmarks as
/// the easy parts this is FastSLAM (M. Montemerlo et al., AAAI 2002).
///
/// ```cpp
/// struct Sighting {
///   using State = cairn::SE2;  using Part = cairn::Vector<2>;
///   using Measurement = cairn::Product<cairn::Vector<1>, cairn::SO2>;  // range, bearing
///   Measurement predict(const State& x, const Part& part) const;
///   cairn::Matrix<2> part_jacobian(const State& x, const Part& part) const;  // by the part
///   cairn::Matrix<2> noise(const State& x, const Part& part) const;
/// };
/// ```
#pragma once

#include <concepts>
#include <cstddef>
#include <limits>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/particle.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What the sensor reports of one part, given the sampled state.
template <class H>
concept ConditionalMeasurement =
    Manifold<typename H::State> && Manifold<typename H::Part> && Manifold<typename H::Measurement> &&
    requires(const H& h, const typename H::State& x, const typename H::Part& part) {
      { h.predict(x, part) } -> StateOf<typename H::Measurement>;
      { h.part_jacobian(x, part) } -> detail::JacobianLike<typename H::Measurement, typename H::Part>;
      { h.noise(x, part) } -> detail::CovarianceLike<typename H::Measurement>;
    };

/// A sampled state and what is believed of each part if that sample is the truth.
template <Manifold X, Manifold Part>
struct ConditionalParticle {
  X state;
  std::vector<Gaussian<Part>> parts;
};

template <Manifold X, Manifold Part>
using ConditionalParticles = Particles<ConditionalParticle<X, Part>>;

namespace detail {

/// The sensor as an ordinary one over the part, the sampled state held.
template <ConditionalMeasurement H>
struct HeldSensor {
  using State = typename H::Part;
  using Measurement = typename H::Measurement;
  const H& sensor;
  const typename H::State& held;
  [[nodiscard]] decltype(auto) predict(const State& part) const { return sensor.predict(held, part); }
  [[nodiscard]] decltype(auto) jacobian(const State& part) const { return sensor.part_jacobian(held, part); }
  [[nodiscard]] decltype(auto) noise(const State& part) const { return sensor.noise(held, part); }
};

}  // namespace detail

/// The filter. Options only.
struct RaoBlackwell {
  Extended parts{};            ///< how the Gaussians are updated
  ParticleFilter particles{};  ///< when and how to resample

  /// Moves every sampled state and draws its noise; the parts stay.
  template <class F, Manifold Part, class U = typename F::Control>
    requires(ProcessModel<F> || detail::explain_process<F>)
  Status predict(ConditionalParticles<typename F::State, Part>& belief, const F& process, double dt,
                 Random& random, const U& control = detail::no_control<U>()) const {
    Particles<typename F::State> states;
    states.states.reserve(belief.size());
    for (const auto& particle : belief.states) states.states.push_back(particle.state);
    states.log_weights = belief.log_weights;
    const Status status = particles.predict(states, process, dt, random, control);
    if (status != Status::accepted) return status;
    for (std::size_t i = 0; i < belief.size(); ++i) belief.states[i].state = states.states[i];
    return status;
  }

  /// Part number `index` was seen as z: updates that part in every particle and weighs the particles by the
  /// likelihood of z. A particle in which the update is refused gets the likelihood of the gate's edge where
  /// it was gated, and none otherwise. Refused as a whole where an index is missing or no weight is left.
  template <class H, class V = typename H::Measurement>
    requires(ConditionalMeasurement<H> || detail::explain_sizes<H>)
  UpdateResult update(ConditionalParticles<typename H::State, typename H::Part>& belief, std::size_t index,
                      const H& sensor, const V& z, Random& random) const {
    if (belief.states.empty()) return Status::depleted;
    const detail::Given<typename H::Measurement, V> given(z);
    if (given.misfit()) return Status::size_mismatch;
    std::vector<double> log_likelihoods(belief.size());
    std::vector<Gaussian<typename H::Part>> next;
    next.reserve(belief.size());
    for (std::size_t i = 0; i < belief.size(); ++i) {
      const auto& particle = belief.states[i];
      if (index >= particle.parts.size()) return Status::size_mismatch;
      next.push_back(particle.parts[index]);
      auto in = parts.update(next.back(), detail::HeldSensor<H>{sensor, particle.state}, given.value());
      if (in.status == Status::size_mismatch) return in.status;
      if (in.status == Status::gated) in.nis = static_cast<decltype(in.nis)>(parts.gate);
      const bool usable = in.accepted() || in.status == Status::gated;
      log_likelihoods[i] =
          usable ? static_cast<double>(in.log_likelihood()) : -std::numeric_limits<double>::infinity();
    }
    const std::vector<ConditionalParticle<typename H::State, typename H::Part>> before = belief.states;
    for (std::size_t i = 0; i < belief.size(); ++i) belief.states[i].parts[index] = next[i];
    const Status status = particles.update_with(belief, log_likelihoods, random);
    if (status != Status::accepted) belief.states = before;
    return status;
  }
};

}}  // namespace cairn::CAIRN_ABI
