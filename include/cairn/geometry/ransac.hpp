// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The best model among wrong data: RANSAC with a truncated quadratic score, local optimisation, and
/// progressive sampling.
///
/// Hypotheses are fitted to random samples and scored by MSAC, sum min(r^2, T^2) (P. Torr, A. Zisserman,
/// "MLESAC", CVIU 78, 2000). Every new best is refined on its inliers before it is compared again (O. Chum,
/// J. Matas, J. Kittler, "Locally optimized RANSAC", DAGM 2003). Stops when, with the given confidence, a
/// sample of inliers only has been drawn:
///   k = log(1 - confidence) / log(1 - P),   P = prod_{i<m} (I_n - i) / (n - i)           (1)
/// for I_n inliers among n data, drawn without replacement. In progressive order (O. Chum, J. Matas,
/// "Matching with PROSAC", CVPR 2005) data come best first, samples from a growing prefix, and (1) holds for
/// the prefix that needs the fewest samples and whose inliers cannot be chance.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// How well a model fits.
struct RansacScore {
  double cost = std::numeric_limits<double>::infinity();  ///< sum of min(r^2, T^2)
  std::size_t inliers = 0;                                ///< data with r^2 < T^2
};

/// A problem that ransac() solves. `size()` data; `solve` fits a model to sample_size distinct indices, or
/// fails; `score` may stop and return any cost above `limit` once that is exceeded; `refine` improves a model
/// on the data near it, or fails; `inliers` sets a flag for each datum with r^2 < T^2.
template <class P>
concept RansacProblem = requires(const P& p, typename P::Model& model, std::span<const std::uint32_t> sample,
                                 double limit, std::span<std::uint8_t> mask) {
  requires std::copyable<typename P::Model>;
  { P::sample_size } -> std::convertible_to<std::size_t>;
  { p.size() } -> std::convertible_to<std::size_t>;
  { p.solve(sample, model) } -> std::convertible_to<bool>;
  { p.score(model, limit) } -> std::convertible_to<RansacScore>;
  { p.refine(model) } -> std::convertible_to<bool>;
  p.inliers(model, mask);
};

enum class SamplingOrder {
  uniform,     ///< every datum alike
  progressive  ///< data are sorted, best first: PROSAC
};

struct RansacOptions {
  double confidence = 0.9999;  ///< of having drawn a sample without outliers
  int min_iterations = 5;
  int max_iterations = 1000;
  int refinements = 3;  ///< local optimisation steps tried on every new best
  SamplingOrder order = SamplingOrder::uniform;
  std::uint64_t seed = 1;
};

/// Result; nothing in `model` where no sample gave one.
template <class Model>
struct RansacResult {
  std::optional<Model> model;
  RansacScore score;
  int iterations = 0;  ///< samples drawn
};

namespace detail {

/// (1): samples needed to draw `m` inliers at once, with `inliers` among `count`. `most` where hopeless.
[[nodiscard]] inline double samples_needed(std::size_t inliers, std::size_t count, std::size_t m,
                                           double confidence, double most) noexcept {
  if (inliers < m) return most;
  double all_good = 1;
  for (std::size_t i = 0; i < m; ++i)
    all_good *= static_cast<double>(inliers - i) / static_cast<double>(count - i);
  if (all_good >= 1) return 1;
  const double needed = std::log1p(-confidence) / std::log1p(-all_good);
  return std::isfinite(needed) ? std::min(needed, most) : most;
}

/// Draws samples: uniform, or from a prefix that grows as PROSAC says.
template <std::size_t M>
class Sampler {
public:
  Sampler(std::size_t count, const RansacOptions& options)
      : random_(options.seed), count_(count), prefix_(options.order == SamplingOrder::uniform ? count : M) {
    // Draws after which the prefix is everything and sampling uniform: as many as there may be.
    average_ = options.max_iterations;
    for (std::size_t i = 0; i < M; ++i)
      average_ *= static_cast<double>(M - i) / static_cast<double>(count - i);
  }

  [[nodiscard]] std::array<std::uint32_t, M> operator()() {
    ++draws_;
    while (draws_ > prefix_end_ && prefix_ < count_) grow();
    std::array<std::uint32_t, M> sample{};
    std::size_t filled = 0;
    std::size_t from = prefix_;
    if (prefix_ < count_ && prefix_ > M) {  // the newest datum and the rest from those before it
      sample[filled++] = static_cast<std::uint32_t>(prefix_ - 1);
      from = prefix_ - 1;
    }
    while (filled < M) {
      const auto pick = static_cast<std::uint32_t>(random_.below(from));
      if (std::find(sample.begin(), sample.begin() + filled, pick) == sample.begin() + filled)
        sample[filled++] = pick;
    }
    return sample;
  }

private:
  // T_{n+1} = T_n (n + 1) / (n + 1 - m); the prefix lasts ceil(T_{n+1} - T_n) more draws.
  void grow() {
    const double n1 = static_cast<double>(prefix_ + 1);
    const double next = average_ * n1 / (n1 - static_cast<double>(M));
    prefix_end_ += static_cast<std::uint64_t>(std::max(1.0, std::ceil(next - average_)));
    average_ = next;
    ++prefix_;
  }

  Random random_;
  std::size_t count_, prefix_;
  double average_ = 0;
  std::uint64_t draws_ = 0, prefix_end_ = 1;
};

/// Samples needed in progressive order: the least of (1) over prefixes with more inliers than chance (each
/// wrong datum agreeing with a wrong model with probability 0.05, at two standard deviations or more).
[[nodiscard]] inline double progressive_samples_needed(std::span<const std::uint8_t> mask, std::size_t m,
                                                       double confidence, double most) noexcept {
  double least = most;
  std::size_t inliers = 0;
  for (std::size_t n = 1; n <= mask.size(); ++n) {
    inliers += mask[n - 1];
    const double others = static_cast<double>(n) - static_cast<double>(m);
    if (others < 10) continue;
    const double chance = static_cast<double>(m) + 0.05 * others + 2 * std::sqrt(0.0475 * others);
    if (static_cast<double>(inliers) > chance)
      least = std::min(least, samples_needed(inliers, n, m, confidence, most));
  }
  return least;
}

}  // namespace detail

/// The best model of `problem`. `guesses` are scored and refined like samples, before any is drawn. Fewer
/// data than a sample needs: only the guesses. The same arguments give the same bits. O(iterations * size).
template <RansacProblem P>
[[nodiscard]] RansacResult<typename P::Model> ransac(const P& problem, const RansacOptions& options = {},
                                                     std::span<const typename P::Model> guesses = {}) {
  using Model = typename P::Model;
  constexpr std::size_t m = P::sample_size;
  RansacResult<Model> best;
  const std::size_t count = problem.size();
  const double most = options.max_iterations;
  double needed = most;
  std::vector<std::uint8_t> mask(options.order == SamplingOrder::progressive ? count : 0);

  const auto consider = [&](const Model& hypothesis) {
    RansacScore score = problem.score(hypothesis, best.score.cost);
    if (!(score.cost < best.score.cost)) return;
    best.model = hypothesis;
    best.score = score;
    Model candidate = hypothesis;
    // A model that little more than its own sample agrees with has nothing to be refined on.
    const int refinements = score.inliers > 2 * m ? options.refinements : 0;
    for (int step = 0; step < refinements && problem.refine(candidate); ++step) {
      score = problem.score(candidate, best.score.cost);
      if (!(score.cost < best.score.cost)) break;
      const bool settled = score.cost > 0.99 * best.score.cost;
      best.model = candidate;
      best.score = score;
      if (settled) break;
    }
    needed = detail::samples_needed(best.score.inliers, count, m, options.confidence, most);
    if (!mask.empty()) {
      problem.inliers(*best.model, std::span<std::uint8_t>(mask));
      needed = std::min(needed, detail::progressive_samples_needed(mask, m, options.confidence, most));
    }
  };

  for (const Model& guess : guesses) consider(guess);
  if (count < m) return best;
  detail::Sampler<m> draw(count, options);
  Model model = guesses.empty() ? Model{} : guesses.front();
  while (best.iterations < options.max_iterations &&
         (best.iterations < needed || best.iterations < options.min_iterations)) {
    ++best.iterations;
    const std::array<std::uint32_t, m> sample = draw();
    if (problem.solve(std::span<const std::uint32_t>(sample), model)) consider(model);
  }
  return best;
}

}}  // namespace cairn::CAIRN_ABI
