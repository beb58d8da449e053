// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What beliefs have in common, and filters of Gaussian ones: for code that takes any of them.
///
/// ```cpp
/// template <class Filter, cairn::Belief B, class F, class H>
///   requires cairn::GaussianFilter<Filter, B>
/// bool step(const Filter& filter, B& belief, const F& process, double dt, const H& sensor,
///           const typename H::Measurement& z) {
///   return filter.predict(belief, process, dt) == cairn::Status::accepted &&
///          filter.update(belief, sensor, z).accepted();
/// }
/// ```
///
/// Laws, which tests check and types cannot: a step that is refused leaves the belief bit for bit; on linear
/// models all filters give the same Gaussian; from(g).gaussian() is g to rounding.
#pragma once

#include <concepts>
#include <optional>
#include <type_traits>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

template <class A, class B>
concept Perhaps = std::same_as<A, B> || std::same_as<A, std::optional<B>>;

/// A process and a sensor that every filter takes, to ask one whether it is a filter.
template <Manifold X>
struct StandingStill {
  using State = X;
  using Control = NoControl;
  static constexpr bool linear = true;
  [[nodiscard]] State propagate(const State& x, const Control&, double) const { return x; }
  [[nodiscard]] CovarianceOf<X> jacobian(const State&, const Control&, double) const { return {}; }
  [[nodiscard]] CovarianceOf<X> noise(const State&, const Control&, double) const { return {}; }
};
template <Manifold X>
struct SeenWhole {
  using State = X;
  using Measurement = X;
  static constexpr bool linear = true;
  [[nodiscard]] Measurement predict(const State& x) const { return x; }
  [[nodiscard]] CovarianceOf<X> jacobian(const State&) const { return {}; }
  [[nodiscard]] CovarianceOf<X> noise(const State&) const { return {}; }
};

template <class Filter, Manifold X>
struct BeliefOfFilter {
  using type = Gaussian<X>;
};
template <class Filter, Manifold X>
  requires requires { typename Filter::template BeliefOf<X>; }
struct BeliefOfFilter<Filter, X> {
  using type = typename Filter::template BeliefOf<X>;
};

}  // namespace detail

/// What is believed of a State: its mean, or the point about which it is written (information forms), the
/// same as a Gaussian, and from() one. An optional holds nothing where the form has no such Gaussian (nothing
/// known of a direction), or the Gaussian no such form (a singular covariance).
template <class B>
concept Belief =
    Manifold<typename B::State> && requires(const B& belief, const Gaussian<typename B::State>& gaussian) {
      { belief.gaussian() } -> detail::Perhaps<Gaussian<typename B::State>>;
      { B::from(gaussian) } -> detail::Perhaps<B>;
    } && (requires(const B& belief) {
      { belief.mean } -> std::convertible_to<const typename B::State&>;
    } || requires(const B& belief) {
      { belief.point } -> std::convertible_to<const typename B::State&>;
    });

/// A belief that always has a mean and a covariance: every one but the information forms.
template <class B>
concept ProperBelief = Belief<B> && requires(const B& belief, const Gaussian<typename B::State>& gaussian) {
  { belief.mean } -> std::convertible_to<const typename B::State&>;
  { belief.gaussian() } -> std::same_as<Gaussian<typename B::State>>;
  { B::from(gaussian) } -> std::same_as<B>;
};

/// A filter that moves such a belief and takes measurements into it.
template <class Filter, class B>
concept GaussianFilter = Belief<B> && requires(const Filter& filter, B& belief, const typename B::State& z,
                                               const detail::StandingStill<typename B::State>& process,
                                               const detail::SeenWhole<typename B::State>& sensor) {
  { filter.predict(belief, process, 1.0) } -> std::same_as<Status>;
  { filter.predict(belief, process, 1.0, NoControl{}) } -> std::same_as<Status>;
  { filter.update(belief, sensor, z).status } -> std::convertible_to<Status>;
  { filter.update(belief, sensor, z).accepted() } -> std::same_as<bool>;
};

/// The belief that a filter works on: what its member template BeliefOf says, Gaussian<X> where it has none.
template <class Filter, Manifold X>
using BeliefOf = typename detail::BeliefOfFilter<std::remove_cvref_t<Filter>, X>::type;

namespace detail {

/// Numbers of a step where all of the belief has one size, else 0.
template <ProperBelief B>
[[nodiscard]] int size_of_belief(const B& belief) {
  using X = typename B::State;
  if constexpr (dof<X> != dynamic)
    return dof<X>;
  else if constexpr (requires { belief.root; })
    return common_size(belief.mean, belief.root);
  else
    return common_size(belief.mean, belief.covariance);
}

/// The sentence for what needs a mean and a covariance at every moment.
template <class B>
consteval bool demand_proper_belief() {
  static_assert(
      ProperBelief<B>,
      "cairn: this needs a mean and a covariance at every moment, which a belief in information form "
      "need not have: take a filter of another form");
  return true;
}

/// The sentence for what runs any filter over one belief by one process.
template <class Filter, class B, class F>
consteval bool demand_one_belief() {
  static_assert(
      requires(const Filter& filter, B& belief, const F& process, const typename F::Control& control) {
        filter.predict(belief, process, 1.0, control);
      },
      "cairn: Timeline and Recorder run filters of one Gaussian belief and one process (the table of "
      "docs/filters.md); Interacting, ParticleFilter and JointExtended have beliefs of another kind");
  return true;
}

}  // namespace detail
}}  // namespace cairn::CAIRN_ABI
