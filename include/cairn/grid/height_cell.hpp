// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What is known of the heights of the ground in a cell, and how likely more heights are: the cells of
/// Gamma-SLAM.
///
/// In a cell h ~ N(m, 1 / tau) with tau ~ Gamma(nu/2, S/2), by shape and rate. Two cells, for two ideas of m:
///   VarianceCell  m is forgotten between visits, and flat within each: only the roughness is mapped, and
///                 every visit spends one height on its own mean (T. Marks, A. Howard, M. Bajracharya,
///                 G. Cottrell, L. Matthies, "Gamma-SLAM: visual SLAM in unstructured environments using
///                 variance grid maps", Journal of Field Robotics 26, 2009, sec. 3)
///   HeightCell    m is kept, N(m0, 1 / (kappa0 tau)): normal-gamma (M. DeGroot, "Optimal Statistical
///                 Decisions", 1970, sec. 9.6); a proper density of all heights, in whatever visits they come
/// A cell holds sums only; the prior comes with each question, so that a cell nobody wrote is the prior.
/// Questions cost O(1), a few logarithms.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// What is believed of a cell before its first height.
struct HeightPrior {
  double nu = 2;        ///< degrees of freedom of the spread: heights' worth of belief, > 0
  double sigma = 0.05;  ///< S = nu sigma^2 [m], > 0
  double kappa = 1e-3;  ///< heights' worth of belief in the mean, > 0; HeightCell only
  double mean = 0;      ///< [m]; HeightCell only

  [[nodiscard]] double squares() const noexcept { return nu * sigma * sigma; }
  [[nodiscard]] bool valid() const noexcept {
    const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
    return positive(nu) && positive(sigma) && positive(squares()) && positive(kappa) && std::isfinite(mean);
  }
};

/// Heights by their sums: how many, their mean [m], and their squares about it [m^2]. A count may be a
/// fraction, for heights that count less than one each.
struct HeightSums {
  double count = 0;
  double mean = 0;
  double squares = 0;

  void add(double height) noexcept { add(HeightSums{1, height, 0}); }
  /// All of `other`. (T. Chan, G. Golub, R. LeVeque, "Algorithms for computing the sample variance", The
  /// American Statistician 37, 1983, eq. 2.1.)
  void add(const HeightSums& other) noexcept {
    if (!(other.count > 0)) return;
    const double sum = count + other.count, step = other.mean - mean;
    mean += step * (other.count / sum);
    squares += other.squares + step * step * (count * other.count / sum);
    count = sum;
  }
  friend bool operator==(const HeightSums&, const HeightSums&) = default;
};

/// The spread of heights: 1 / sigma^2 ~ Gamma(nu/2, squares/2).
struct HeightSpread {
  double nu = 0;
  double squares = 0;  ///< [m^2]

  /// Posterior mean of sigma [m]; infinite where nu <= 1.
  [[nodiscard]] double expected_sigma() const noexcept {
    if (!(nu > 1)) return std::numeric_limits<double>::infinity();
    return std::sqrt(0.5 * squares) * std::exp(log_gamma(0.5 * (nu - 1)) - log_gamma(0.5 * nu));
  }
  /// sigma [m] below which it lies with this probability, from 1e-15 to less than 1.
  [[nodiscard]] double sigma_quantile(double probability) const {
    CAIRN_EXPECTS(probability >= 1e-15 && probability < 1,
                  "sigma_quantile needs a probability between 1e-15 and 1");
    return std::sqrt(squares / chi_square_quantile(1 - probability, nu));
  }
};

/// A prior that is ready to be asked for many cells' evidence. Copies share a table of 32 KB.
class HeightModel {
public:
  /// Throws Error where the prior is out of its ranges.
  explicit HeightModel(const HeightPrior& prior = {}) : prior_(prior) {
    if (!prior.valid()) raise("HeightModel: expected nu, sigma and kappa above zero, and a finite mean");
    std::vector<double> table(4096);
    for (std::size_t n = 0; n < table.size(); ++n)
      table[n] = cairn::log_gamma(0.5 * (prior.nu + static_cast<double>(n)));
    table_ = std::make_shared<const std::vector<double>>(std::move(table));
  }

  [[nodiscard]] const HeightPrior& prior() const noexcept { return prior_; }

  /// log of what the spread contributes to the evidence of n more heights, of which `seen` are known already,
  /// and which raise the squares from `before` by `added`: Gamma((nu + seen + n)/2) / Gamma((nu + seen)/2)
  /// before^((nu + seen)/2) / (before + added)^((nu + seen + n)/2) / pi^(n/2).
  [[nodiscard]] double log_spread_evidence(double seen, double n, double before,
                                           double added) const noexcept {
    return log_gamma_of(seen + n) - log_gamma_of(seen) -
           0.5 * (prior_.nu + seen) * std::log1p(added / before) -
           0.5 * n * std::log(std::numbers::pi * (before + added));
  }

private:
  /// Of (nu + count) / 2: from the table where heights count as wholes.
  [[nodiscard]] double log_gamma_of(double count) const noexcept {
    if (!(count < static_cast<double>(table_->size()))) return log_gamma(0.5 * (prior_.nu + count));
    const auto whole = static_cast<std::size_t>(count);
    return static_cast<double>(whole) == count ? (*table_)[whole] : log_gamma(0.5 * (prior_.nu + count));
  }

  HeightPrior prior_;
  std::shared_ptr<const std::vector<double>> table_;
};

/// The spread of a cell whose mean nobody keeps.
struct VarianceCell {
  double nu = 0;       ///< heights seen, less one for each visit
  double squares = 0;  ///< about each visit's own mean [m^2]

  [[nodiscard]] bool known() const noexcept { return nu > 0; }
  [[nodiscard]] HeightSpread spread(const HeightPrior& prior) const noexcept {
    return {prior.nu + nu, prior.squares() + squares};
  }
  /// log density of the heights of one visit but for their mean, 0 where there are fewer than two.
  [[nodiscard]] double log_evidence(const HeightSums& visit, const HeightModel& model) const noexcept {
    if (!(visit.count > 1)) return 0;
    const double before = spread(model.prior()).squares;
    return model.log_spread_evidence(nu, visit.count - 1, before, visit.squares) -
           0.5 * std::log(visit.count);
  }
  /// Takes a visit in; with a share below 1 each height is worth so much of one.
  void insert(const HeightSums& visit, double share = 1) noexcept {
    if (!(visit.count > 1)) return;
    nu += share * (visit.count - 1);
    squares += share * visit.squares;
  }
  friend bool operator==(const VarianceCell&, const VarianceCell&) = default;
};

/// Mean and spread of a cell.
struct HeightCell {
  HeightSums seen;

  [[nodiscard]] bool known() const noexcept { return seen.count > 0; }
  [[nodiscard]] double kappa(const HeightPrior& prior) const noexcept { return prior.kappa + seen.count; }
  [[nodiscard]] double mean(const HeightPrior& prior) const noexcept {
    return prior.mean + (seen.mean - prior.mean) * (seen.count / kappa(prior));
  }
  [[nodiscard]] HeightSpread spread(const HeightPrior& prior) const noexcept {
    const double away = seen.mean - prior.mean;
    return {prior.nu + seen.count,
            prior.squares() + seen.squares + away * away * (prior.kappa * seen.count / kappa(prior))};
  }
  /// log density of the heights of one visit.
  [[nodiscard]] double log_evidence(const HeightSums& visit, const HeightModel& model) const noexcept {
    if (!(visit.count > 0)) return 0;
    const HeightPrior& prior = model.prior();
    const double before = kappa(prior), after = before + visit.count, away = visit.mean - mean(prior);
    const double added = visit.squares + away * away * (before * visit.count / after);
    return model.log_spread_evidence(seen.count, visit.count, spread(prior).squares, added) +
           0.5 * std::log(before / after);
  }
  /// Takes a visit in; with a share below 1 each height is worth so much of one.
  void insert(const HeightSums& visit, double share = 1) noexcept {
    seen.add({share * visit.count, visit.mean, share * visit.squares});
  }
  friend bool operator==(const HeightCell&, const HeightCell&) = default;
};

}}  // namespace cairn::CAIRN_ABI
