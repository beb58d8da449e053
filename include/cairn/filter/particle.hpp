// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The particle filter: weighted samples of the state, and the ways to draw them anew.
///
/// predict() moves each sample by the process and a draw of its noise; update() multiplies each weight by the
/// likelihood of the measurement; resample() duplicates the heavy and drops the light when the effective
/// number 1 / sum w^2 has fallen. Weights are logarithms, so a thousand unlikely measurements do not end in
/// zeros. (N. Gordon, D. Salmond, A. Smith, "Novel approach to nonlinear/non-Gaussian Bayesian state
/// estimation", IEE Proc. F 140, 1993; R. Douc, O. Cappe, E. Moulines, "Comparison of resampling schemes for
/// particle filtering", ISPA 2005.)
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/covariance.hpp>
#include <cairn/filter/detail/plain_model.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// How many copies of each particle survive: independent draws; one draw a stratum; one draw for all strata;
/// whole copies first and the rest at random.
enum class Resampling { multinomial, stratified, systematic, residual };

namespace detail {

/// `count` indices drawn in proportion to `weights` (sum 1) at the sorted positions that `position(k)` gives.
template <class Position>
void draw_sorted(std::span<const double> weights, std::size_t count, const Position& position,
                 std::vector<std::size_t>& out) {
  std::size_t i = 0;
  double sum = weights.empty() ? 0.0 : weights[0];
  for (std::size_t k = 0; k < count; ++k) {
    const double u = position(k);
    while (u >= sum && i + 1 < weights.size()) sum += weights[++i];
    while (weights[i] == 0.0 && i > 0) --i;  // rounding of the sum may end on a particle of no weight
    out.push_back(i);
  }
}

/// The weights divided by their sum.
inline std::vector<double> shares_of(std::span<const double> weights) {
  std::vector<double> shares(weights.begin(), weights.end());
  double sum = 0.0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    if (!(shares[i] >= 0.0) || !(shares[i] <= std::numeric_limits<double>::max())) {
      std::string text("particles: expected weights that are finite and not negative; found ");
      text.append(std::to_string(shares[i])).append(" at index ").append(std::to_string(i));
      raise(text);
    }
    sum += shares[i];
  }
  if (!(sum > 0.0) || !(sum <= std::numeric_limits<double>::max()))
    raise("particles: expected weights with a finite sum above zero");
  if (sum != 1.0)
    for (double& share : shares) share /= sum;
  return shares;
}

/// Sorted independent uniforms on [0, 1) by their normalised exponential spacings.
inline std::vector<double> sorted_uniforms(std::size_t count, Random& random) {
  std::vector<double> u(count);
  double sum = 0.0;
  for (double& value : u) value = sum -= std::log1p(-random.uniform());
  sum -= std::log1p(-random.uniform());
  for (double& value : u) value /= sum;
  return u;
}

}  // namespace detail

/// `count` indices drawn in proportion to `weights`, of any sum above zero, in rising order. Every scheme
/// draws index i count * weight_i times the sum's inverse on average; none where there are no weights. Throws
/// Error naming a weight that is negative or not finite, or where all are zero. O(count + size).
[[nodiscard]] inline std::vector<std::size_t> resampled_indices(std::span<const double> weights,
                                                                std::size_t count, Resampling scheme,
                                                                Random& random) {
  std::vector<std::size_t> out;
  if (weights.empty()) return out;
  const std::vector<double> shares = detail::shares_of(weights);
  weights = shares;
  out.reserve(count);
  const double n = static_cast<double>(count);
  if (scheme == Resampling::systematic) {
    const double start = random.uniform();
    detail::draw_sorted(
        weights, count, [&](std::size_t k) { return (static_cast<double>(k) + start) / n; }, out);
  } else if (scheme == Resampling::stratified) {
    detail::draw_sorted(
        weights, count, [&](std::size_t k) { return (static_cast<double>(k) + random.uniform()) / n; }, out);
  } else if (scheme == Resampling::multinomial) {
    const std::vector<double> u = detail::sorted_uniforms(count, random);
    detail::draw_sorted(weights, count, [&](std::size_t k) { return u[k]; }, out);
  } else {
    std::vector<double> rest(weights.size());
    double total = 0.0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double copies = std::floor(n * weights[i]);
      out.insert(out.end(), static_cast<std::size_t>(copies), i);
      total += rest[i] = n * weights[i] - copies;
    }
    if (out.size() < count && total > 0.0) {
      for (double& r : rest) r /= total;
      const std::vector<double> u = detail::sorted_uniforms(count - out.size(), random);
      detail::draw_sorted(rest, u.size(), [&](std::size_t k) { return u[k]; }, out);
    }
    out.resize(count, out.empty() ? 0 : out.back());
    std::sort(out.begin(), out.end());
  }
  return out;
}

/// Number of particles that keeps the Kullback-Leibler distance of the sampled from the true distribution
/// below `epsilon` with confidence given by the normal quantile `z`, when they fall into `bins` bins (D. Fox,
/// "Adapting the sample size in particle filters through KLD-sampling", IJRR 22, 2003, eq. 7). 1 for fewer
/// than two bins; the largest number there is for what no number counts.
[[nodiscard]] inline std::size_t kld_particle_count(std::size_t bins, double epsilon = 0.05,
                                                    double z = 2.326347874) {
  if (bins < 2) return 1;
  const double k = static_cast<double>(bins - 1);
  const double a = 2.0 / (9.0 * k);
  const double root = std::max(0.0, 1.0 - a + std::sqrt(a) * z);
  const double count = std::ceil(k / (2.0 * epsilon) * root * root * root);
  if (!(count < 0x1p63)) return std::numeric_limits<std::size_t>::max();
  return static_cast<std::size_t>(std::max(1.0, count));
}

/// States with weights; weight i is exp(log_weights[i]) and they sum to 1 after every accepted step.
template <class X>
struct Particles {
  std::vector<X> states;
  std::vector<double> log_weights;

  /// Equal weights.
  [[nodiscard]] static Particles equal(std::vector<X> states) {
    const double log_weight = states.empty() ? 0.0 : -std::log(static_cast<double>(states.size()));
    std::vector<double> weights(states.size(), log_weight);
    return {std::move(states), std::move(weights)};
  }

  [[nodiscard]] std::size_t size() const noexcept { return states.size(); }
  [[nodiscard]] std::vector<double> weights() const {
    std::vector<double> w(log_weights.size());
    for (std::size_t i = 0; i < w.size(); ++i) w[i] = std::exp(log_weights[i]);
    return w;
  }
  /// 1 / sum w^2: between 1 and size() where the weights sum to 1.
  [[nodiscard]] double effective_size() const {
    double sum = 0.0;
    for (const double w : weights()) sum += w * w;
    return sum > 0.0 ? 1.0 / sum : 0.0;
  }

  /// Adds to the logarithms of the weights and makes them sum to 1. Refused, and nothing changed, where no
  /// weight is left or one is NaN.
  Status reweigh(std::span<const double> log_likelihoods) {
    if (log_likelihoods.size() != size() || log_weights.size() != size()) return Status::size_mismatch;
    std::vector<double> next(size());
    for (std::size_t i = 0; i < size(); ++i) {
      next[i] = log_weights[i] + log_likelihoods[i];
      if (std::isnan(next[i])) return Status::not_finite;
    }
    const double total = log_sum_exp(next);
    if (!std::isfinite(total)) return Status::depleted;
    for (double& w : next) w -= total;
    log_weights = std::move(next);
    return Status::accepted;
  }

  /// Draws `count` particles in proportion to the weights; all are equal afterwards. Throws Error, and
  /// nothing is changed, where a weight is not a number or all are zero.
  void resample(std::size_t count, Resampling scheme, Random& random) {
    CAIRN_EXPECTS(log_weights.size() == size(), "particles need one weight each");
    std::vector<X> next;
    next.reserve(count);
    for (const std::size_t i : resampled_indices(weights(), count, scheme, random)) next.push_back(states[i]);
    *this = equal(std::move(next));
  }
};

/// How close KLD sampling comes to the distribution, and its bounds.
struct KldSampling {
  double epsilon = 0.05;    ///< Kullback-Leibler distance; > 0
  double z = 2.326347874;   ///< normal quantile of the confidence, here 99 %
  std::size_t least = 100;  ///< > 0; of very few one bin may hold all, and then no more are asked for
  std::size_t most = 100000;
};

/// Draws particles in proportion to their weights, one by one, until there are as many as
/// kld_particle_count() asks for the bins they have fallen into: few where the belief is narrow. `bin(state)`
/// gives a value with operator<, such as an array of rounded coordinates. Refused: no particle or weight, a
/// bad option.
template <class X, class Bin>
Status resample_by_kld(Particles<X>& belief, const KldSampling& options, const Bin& bin, Random& random) {
  if (belief.states.empty()) return Status::depleted;
  if (belief.log_weights.size() != belief.size()) return Status::size_mismatch;
  if (!(options.epsilon > 0.0) || !std::isfinite(options.z) || options.least < 1 ||
      options.least > options.most)
    return Status::bad_option;
  std::vector<double> sums = belief.weights();
  for (const double weight : sums)
    if (!(weight <= std::numeric_limits<double>::max())) return Status::not_finite;
  for (std::size_t i = 1; i < sums.size(); ++i) sums[i] += sums[i - 1];
  if (!(sums.back() <= std::numeric_limits<double>::max())) return Status::not_finite;
  if (!(sums.back() > 0.0)) return Status::depleted;
  std::set<std::decay_t<decltype(bin(belief.states.front()))>> bins;
  std::vector<X> next;
  std::size_t wanted = options.least;
  while (next.size() < wanted && next.size() < options.most) {
    const auto found = std::upper_bound(sums.begin(), sums.end() - 1, random.uniform() * sums.back());
    next.push_back(belief.states[static_cast<std::size_t>(found - sums.begin())]);
    if (!bins.insert(bin(next.back())).second) continue;
    wanted = std::max(options.least, kld_particle_count(bins.size(), options.epsilon, options.z));
  }
  belief = Particles<X>::equal(std::move(next));
  return Status::accepted;
}

/// `count` equally weighted draws from a Gaussian.
template <Manifold X>
[[nodiscard]] Particles<X> draw_particles(const Gaussian<X>& belief, std::size_t count, Random& random) {
  std::vector<X> states;
  states.reserve(count);
  for (std::size_t i = 0; i < count; ++i) states.push_back(sample(belief, random));
  return Particles<X>::equal(std::move(states));
}

/// Weighted mean (tangent averaging from the heaviest particle, two rounds) and covariance of at least one
/// particle, for weights of any sum above zero. Throws Error naming a weight that is not finite, or where all
/// are zero.
template <Manifold X>
[[nodiscard]] Gaussian<X> moments(const Particles<X>& particles) {
  using S = ScalarOf<X>;
  CAIRN_EXPECTS(!particles.states.empty(), "moments needs at least one particle");
  CAIRN_EXPECTS(particles.log_weights.size() == particles.size() && detail::common_size(particles.states) > 0,
                "moments needs particles of one size with one weight each");
  const std::vector<double> w = detail::shares_of(particles.weights());
  X mean = particles.states[static_cast<std::size_t>(std::max_element(w.begin(), w.end()) - w.begin())];
  for (int round = 0; round < 2; ++round) {
    Tangent<X> shift = Tangent<X>::Zero(dof_of(mean));
    for (std::size_t i = 0; i < w.size(); ++i)
      shift += static_cast<S>(w[i]) * local(mean, particles.states[i]);
    mean = retract(mean, shift);
  }
  CovarianceOf<X> covariance = CovarianceOf<X>::Zero(dof_of(mean), dof_of(mean));
  for (std::size_t i = 0; i < w.size(); ++i) {
    const Tangent<X> d = local(mean, particles.states[i]);
    covariance += static_cast<S>(w[i]) * (d * d.transpose());
  }
  return {mean, covariance};
}

/// Particle filter. Options only.
struct ParticleFilter {
  Resampling scheme = Resampling::systematic;
  double resample_below =
      0.5;  ///< resample when the effective number falls below this share; 0 never, 1 always

  /// Moves every particle and draws its noise.
  template <class F, class U = detail::ControlOf<F>>
    requires(ProcessModel<F> || detail::explain_process<F>)
  Status predict(Particles<typename F::State>& belief, const F& process, double dt, Random& random,
                 const U& control = detail::no_control<U>()) const {
    using X = typename F::State;
    if (!(dt >= 0.0) || !(dt <= std::numeric_limits<double>::max())) return Status::bad_time_step;
    if (belief.states.empty()) return Status::depleted;
    const detail::PlainProcess plain(process, detail::common_size(belief.states), control);
    if (plain.misfit()) return Status::size_mismatch;
    std::vector<X> next;
    next.reserve(belief.size());
    for (const X& x : belief.states) {
      const CovarianceOf<X> q = detail::dense_of(plain.noise(x, dt));
      const X moved = plain.propagate(x, dt);
      if (plain.misfit()) return Status::size_mismatch;
      if (!detail::is_valid_covariance<dof<X>, ScalarOf<X>>(q))
        return all_finite(q) ? Status::not_positive_definite : Status::not_finite;
      next.push_back(sample(Gaussian<X>{moved, q}, random));
      if (!detail::finite_state(next.back())) return Status::not_finite;
    }
    belief.states = std::move(next);
    return Status::accepted;
  }

  /// Weighs every particle by the Gaussian likelihood of z, and resamples where the weights have degenerated.
  template <class H, class V = typename H::Measurement>
    requires(MeasurementModel<H> || detail::explain_sensor<H>)
  UpdateResult update(Particles<typename H::State>& belief, const H& sensor, const V& z,
                      Random& random) const {
    using S = ScalarOf<typename H::State>;
    constexpr int m = dof<typename H::Measurement>;
    if (belief.states.empty()) return Status::depleted;
    const detail::PlainSensor plain(sensor, detail::common_size(belief.states), z);
    if (plain.misfit()) return Status::size_mismatch;
    std::vector<double> log_likelihoods(belief.size());
    for (std::size_t i = 0; i < belief.size(); ++i) {
      Innovation<m, S> in;
      in.residual = plain.residual(belief.states[i]);
      in.covariance = detail::dense_of(plain.noise(belief.states[i]));
      if (plain.misfit()) return Status::size_mismatch;
      in.nis = detail::squared_mahalanobis<m, S>(in.residual, in.covariance);
      log_likelihoods[i] = static_cast<double>(in.log_likelihood());
    }
    return update_with(belief, log_likelihoods, random);
  }

  /// The same with likelihoods of the user's own, one logarithm a particle. Where copying a state throws, the
  /// particles are as before.
  template <class X>
  UpdateResult update_with(Particles<X>& belief, std::span<const double> log_likelihoods,
                           Random& random) const {
    if (belief.states.empty()) return Status::depleted;
    if (!valid()) return Status::bad_option;
    struct Weights {  // put back where something is thrown
      std::vector<double>& of;
      std::vector<double> before;
      bool keep = false;
      ~Weights() {
        if (!keep) of.swap(before);
      }
    } weights{belief.log_weights, belief.log_weights};
    const Status status = belief.reweigh(log_likelihoods);
    if (status == Status::accepted) resample_if_needed(belief, random);
    weights.keep = true;
    return status;
  }

  /// Draws the particles anew where their weights have degenerated: for who weighs them in several steps, by
  /// Particles::reweigh, and draws once.
  template <class X>
  void resample_if_needed(Particles<X>& belief, Random& random) const {
    if (belief.effective_size() < resample_below * static_cast<double>(belief.size()))
      belief.resample(belief.size(), scheme, random);
  }
  /// Its options are within their ranges.
  [[nodiscard]] bool valid() const noexcept { return resample_below >= 0.0 && resample_below <= 1.0; }
};

}}  // namespace cairn::CAIRN_ABI
