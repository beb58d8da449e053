// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Rao-Blackwellised particle filter: particles over the hard part of the state, each carrying Gaussians
/// over the parts that are easy once the hard part is known. With a pose as the hard part and landmarks whose
/// identities are known as the easy parts this is FastSLAM 1.0 (M. Montemerlo et al., AAAI 2002). What wants
/// more is a ConditionalMap of ConditionalFilter (conditional.hpp): paths, proposals that look at the
/// measurement, maps of any kind; LandmarkMap (slam/landmark_map.hpp) chooses identities in each particle.
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
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/shared_array.hpp>
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

/// A sampled state and what is believed of each part if that sample is the truth. Copies of a particle share
/// the parts that none of them has changed: a particle is copied in O(1), `parts.write(i)` in O(log n).
template <Manifold X, Manifold Part>
struct ConditionalParticle {
  X state;
  SharedArray<Gaussian<Part>> parts;
};

template <Manifold X, Manifold Part>
using ConditionalParticles = Particles<ConditionalParticle<X, Part>>;

/// Part number `part` was seen as z.
template <std::copyable Z>
struct PartSighting {
  std::size_t part = 0;
  Z z;
};

namespace detail {

/// Changes parts of particles, and changes them back unless that is forgotten.
template <Manifold X, Manifold Part>
class PartsAsTheyWere {
public:
  PartsAsTheyWere(ConditionalParticles<X, Part>& belief, std::size_t changes_each) : belief_(belief) {
    were_.reserve(belief.size() * changes_each);
  }
  ~PartsAsTheyWere() {  // last change first; what was written is the particle's own, so that nothing is
                        // copied
    for (; !were_.empty(); were_.pop_back())
      belief_.states[were_.back().particle].parts.write(were_.back().part) = std::move(were_.back().value);
  }
  PartsAsTheyWere(const PartsAsTheyWere&) = delete;
  PartsAsTheyWere& operator=(const PartsAsTheyWere&) = delete;

  void change(std::size_t particle, std::size_t part, Gaussian<Part> to) {
    Gaussian<Part>& own = belief_.states[particle].parts.write(part);
    were_.push_back({particle, part, std::exchange(own, std::move(to))});
  }
  void forget() noexcept { were_.clear(); }

private:
  struct Was {
    std::size_t particle, part;
    Gaussian<Part> value;
  };
  ConditionalParticles<X, Part>& belief_;
  std::vector<Was> were_;
};

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
  template <class F, Manifold Part, class U = detail::ControlOf<F>>
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

  /// What was seen at one moment, one sighting after the other: updates those parts in every particle, weighs
  /// the particles by the likelihood of all sightings together, and resamples at most once. A sighting that
  /// is gated in a particle changes nothing there and has the likelihood of the gate's edge; one that is
  /// refused otherwise leaves that particle none. Refused as a whole, and nothing changed, where there is no
  /// such part, a size does not fit, or no weight is left, for the reason of the last particle that has one.
  /// O(particles x sightings x log parts).
  template <class H>
    requires(ConditionalMeasurement<H> || detail::explain_sizes<H>)
  UpdateResult update(ConditionalParticles<typename H::State, typename H::Part>& belief, const H& sensor,
                      std::span<const PartSighting<typename H::Measurement>> seen, Random& random) const {
    if (belief.states.empty()) return Status::depleted;
    std::vector<double> log_likelihoods(belief.size(), 0.0);
    detail::PartsAsTheyWere before(belief, seen.size());
    Status refused = Status::depleted;
    for (std::size_t i = 0; i < belief.size(); ++i) {
      const auto& [state, own] = belief.states[i];
      for (const auto& [part, z] : seen) {
        if (part >= own.size()) return Status::size_mismatch;
        Gaussian<typename H::Part> updated = own[part];
        const auto in = parts.update(updated, detail::HeldSensor<H>{sensor, state}, z);
        if (in.status == Status::size_mismatch) return in.status;
        log_likelihoods[i] += log_likelihood(in);
        if (in.accepted())
          before.change(i, part, std::move(updated));
        else if (in.status != Status::gated)
          refused = in.status;
      }
    }
    if (!particles.valid()) return Status::bad_option;
    const Status status = belief.reweigh(log_likelihoods);
    if (status != Status::accepted) return status == Status::depleted ? refused : status;
    before.forget();
    particles.resample_if_needed(belief, random);
    return status;
  }

  /// The same where one part was seen.
  template <class H, class V = typename H::Measurement>
    requires(ConditionalMeasurement<H> || detail::explain_sizes<H>)
  UpdateResult update(ConditionalParticles<typename H::State, typename H::Part>& belief, std::size_t part,
                      const H& sensor, const V& z, Random& random) const {
    const detail::Given<typename H::Measurement, V> given(z);
    if (!belief.states.empty() && given.misfit()) return Status::size_mismatch;
    const PartSighting<typename H::Measurement> sighting{part, given.value()};
    return update(belief, sensor, std::span(&sighting, 1), random);
  }

private:
  template <int M, class S>
  [[nodiscard]] double log_likelihood(Innovation<M, S> in) const {
    if (in.status == Status::gated) in.nis = static_cast<S>(parts.gate);
    return in.accepted() || in.status == Status::gated ? static_cast<double>(in.log_likelihood())
                                                       : -std::numeric_limits<double>::infinity();
  }
};

}}  // namespace cairn::CAIRN_ABI
