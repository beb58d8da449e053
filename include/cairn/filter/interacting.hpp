// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Interacting multiple models: several processes, one of which is true at a time, and a Markov chain between
/// them.
///
///   mix      x_j, P_j <- the modes' beliefs weighted by mu_ij = p_ij mu_i / c_j,   c_j = sum_i p_ij mu_i
///   predict  each mode by its own process;   update  each by the sensor, mu_j ~ c_j N(residual_j; 0, S_j)
/// (H. Blom, Y. Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian switching
/// coefficients", IEEE Trans. Automatic Control 33, 1988.) Works over any filter of Gaussian
/// beliefs but those in information form, which may have no moments to mix. Mixing goes through the
/// covariances, updates keep to the form.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <tuple>
#include <type_traits>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// R beliefs and how probable each is (sum 1).
template <Manifold X, std::size_t R, class Mode = Gaussian<X>>
struct ModeBelief {
  static_assert(detail::demand_proper_belief<Mode>());

  std::array<Mode, R> modes;
  std::array<double, R> probability;

  /// One Gaussian with the mixture's mean (two rounds of tangent averaging) and covariance.
  [[nodiscard]] Gaussian<X> combined() const {
    CAIRN_EXPECTS(fits(), "the modes of a belief have one size");
    return mixture(gaussians(), probability);
  }
  [[nodiscard]] decltype(auto) gaussians() const {
    if constexpr (std::same_as<Mode, Gaussian<X>>)
      return (modes);
    else
      return [&]<std::size_t... J>(std::index_sequence<J...>) {
        return std::array<Gaussian<X>, R>{modes[J].gaussian()...};
      }(std::make_index_sequence<R>{});
  }

  /// The modes have one size, and their covariances fit it. Always so where that size is fixed.
  [[nodiscard]] bool fits() const {
    const int n = detail::size_of_belief(modes[0]);
    bool good = n > 0;
    for (const Mode& mode : modes) good = good && detail::size_of_belief(mode) == n;
    return good;
  }

  /// The probabilities are numbers from 0 to 1 that sum to 1, within 1e-6. Otherwise: not_finite, depleted
  /// where none is above zero, bad_weights.
  [[nodiscard]] Status weighed() const noexcept { return judge(probability); }
  [[nodiscard]] static Status judge(const std::array<double, R>& weights) noexcept {
    double sum = 0.0;
    bool negative = false;
    for (const double w : weights) {
      negative = negative || w < 0.0;
      sum += w;
    }
    if (!std::isfinite(sum)) return Status::not_finite;
    if (negative) return Status::bad_weights;
    if (!(sum > 0.0)) return Status::depleted;
    return std::abs(sum - 1.0) <= 1e-6 ? Status::accepted : Status::bad_weights;
  }

  /// The moments of a mixture with the given weights, at least zero and of sum 1.
  [[nodiscard]] static Gaussian<X> mixture(const std::array<Gaussian<X>, R>& parts,
                                           const std::array<double, R>& weights) {
    using S = ScalarOf<X>;
    CAIRN_EXPECTS(judge(weights) == Status::accepted, "a mixture needs weights from 0 to 1 that sum to 1");
    std::size_t heaviest = 0;
    for (std::size_t i = 1; i < R; ++i)
      if (weights[i] > weights[heaviest]) heaviest = i;
    X mean = parts[heaviest].mean;
    for (int round = 0; round < 2; ++round) {
      Tangent<X> shift = Tangent<X>::Zero(dof_of(mean));
      for (std::size_t i = 0; i < R; ++i)  // what has no weight may be anything
        if (weights[i] > 0.0) shift += static_cast<S>(weights[i]) * local(mean, parts[i].mean);
      mean = retract(mean, shift);
    }
    CovarianceOf<X> covariance = CovarianceOf<X>::Zero(dof_of(mean), dof_of(mean));
    for (std::size_t i = 0; i < R; ++i) {
      if (!(weights[i] > 0.0)) continue;
      const Tangent<X> d = local(mean, parts[i].mean);
      covariance += static_cast<S>(weights[i]) * (parts[i].covariance + d * d.transpose());
    }
    return {mean, covariance};
  }
};

/// The filter over R modes. `switching[i][j]` is the probability that mode i is followed by mode j.
template <std::size_t R, class Filter>
struct Interacting {
  Filter filter{};
  std::array<std::array<double, R>, R> switching{};

  /// Mixes, then moves every mode by its own process of `processes`. All or none are kept, but a mode that
  /// cannot be (of probability zero) stays where it is if its process refuses. Refused: rows of
  /// `switching` that do not sum to 1 (bad_option), probabilities that are none (see ModeBelief::weighed).
  template <Manifold X, class Mode, class... F,
            class U = typename std::tuple_element_t<0, std::tuple<F...>>::Control>
    requires(sizeof...(F) == R || detail::explain_modes<R, sizeof...(F)>)
  Status predict(ModeBelief<X, R, Mode>& belief, const std::tuple<F...>& processes, double dt,
                 const U& control = detail::no_control<U>()) const {
    if (!stochastic()) return Status::bad_option;
    if (!belief.fits()) return Status::size_mismatch;
    if (const Status status = belief.weighed(); status != Status::accepted) return status;
    const std::array<Gaussian<X>, R>& modes = belief.gaussians();
    ModeBelief<X, R, Mode> next = belief;
    for (std::size_t j = 0; j < R; ++j) {
      std::array<double, R> weights{};
      double total = 0.0;
      for (std::size_t i = 0; i < R; ++i) total += weights[i] = switching[i][j] * belief.probability[i];
      next.probability[j] = total;
      if (!(total > 0.0)) continue;  // a mode that cannot be: its belief no longer matters
      for (double& w : weights) w /= total;
      const Gaussian<X> mixed = ModeBelief<X, R>::mixture(modes, weights);
      if constexpr (!std::same_as<Mode, Gaussian<X>>)  // whose from() may throw, and a filter does not
        if (!detail::is_valid_covariance<dof<X>, ScalarOf<X>>(mixed.covariance))
          return all_finite(mixed.covariance) ? Status::not_positive_definite : Status::not_finite;
      next.modes[j] = Mode::from(mixed);
    }
    Status status = Status::accepted;
    [&]<std::size_t... J>(std::index_sequence<J...>) {
      const auto move = [&]<std::size_t Of>(std::integral_constant<std::size_t, Of>) {
        const Status moved = filter.predict(next.modes[Of], std::get<Of>(processes), dt, control);
        if (status == Status::accepted && next.probability[Of] > 0.0) status = moved;
      };
      (move(std::integral_constant<std::size_t, J>{}), ...);
    }(std::make_index_sequence<R>{});
    double sum = 0.0;
    for (const double p : next.probability) sum += p;
    for (double& p : next.probability) p /= sum;  // rounding does not gather over a million predictions
    if (status == Status::accepted) belief = next;
    return status;
  }

  /// Every mode takes in z; a mode that refuses keeps its belief and loses its weight. Refused by all: the
  /// first mode's reason, and the belief as it was.
  template <class Mode, class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  UpdateResult update(ModeBelief<typename H::State, R, Mode>& belief, const H& sensor, const V& z) const {
    if (!belief.fits()) return Status::size_mismatch;
    if (const Status status = belief.weighed(); status != Status::accepted) return status;
    ModeBelief<typename H::State, R, Mode> next = belief;
    std::array<double, R> weight{};
    Status first_refusal = Status::accepted;
    for (std::size_t j = 0; j < R; ++j) {
      const auto innovation = filter.update(next.modes[j], sensor, z);
      if (!innovation.accepted() && first_refusal == Status::accepted) first_refusal = innovation.status;
      weight[j] = innovation.accepted() && belief.probability[j] > 0.0
                      ? std::log(belief.probability[j]) + static_cast<double>(innovation.log_likelihood())
                      : -std::numeric_limits<double>::infinity();
    }
    const double total = log_sum_exp(weight);
    if (!std::isfinite(total)) return first_refusal != Status::accepted ? first_refusal : Status::depleted;
    for (std::size_t j = 0; j < R; ++j) next.probability[j] = std::exp(weight[j] - total);
    belief = next;
    return Status::accepted;
  }

private:
  [[nodiscard]] bool stochastic() const noexcept {
    for (const auto& row : switching) {
      double sum = 0.0;
      for (const double p : row) {
        if (!(p >= 0.0)) return false;
        sum += p;
      }
      if (!(std::abs(sum - 1.0) < 1e-9)) return false;
    }
    return true;
  }
};

}}  // namespace cairn::CAIRN_ABI
