// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The few statistics that gates and consistency checks need: chi-square, normal, running moments,
/// log-sum-exp.
///
/// Chi-square with d degrees of freedom is the law of a squared Mahalanobis distance of d dimensions; its
/// cumulative distribution is the regularised lower incomplete gamma function P(d/2, x/2), computed by series
/// and continued fraction (Abramowitz and Stegun 6.5.29 and 6.5.31).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// What Stirling's series (Abramowitz and Stegun 6.1.41) adds to (x - 1/2) log x - x + log sqrt(2 pi) to make
/// it log gamma(x), x >= 8.
[[nodiscard]] inline double stirling_rest(double x) noexcept {
  const double r = 1.0 / x, q = r * r;
  return r * (1.0 / 12 +
              q * (-1.0 / 360 + q * (1.0 / 1260 + q * (-1.0 / 1680 +
                                                       q * (1.0 / 1188 + q * (-691.0 / 360360 + q / 156))))));
}

/// log(1 + t) - t, also where the two are all but equal.
[[nodiscard]] inline double log1p_less(double t) noexcept {
  if (!(std::abs(t) < 0.1)) return std::log1p(t) - t;
  double sum = 0.0, power = -t * t;
  for (int n = 2; n < 18; ++n, power *= -t) sum += power / n;
  return sum;
}

/// gamma_p for an a so large that the sums for it are long: its uniform expansion, one term (N. Temme, "The
/// asymptotic expansion of the incomplete gamma functions", SIAM J. Math. Analysis 10, 1979, section 3).
[[nodiscard]] inline double gamma_p_of_large(double a, double x) noexcept {
  const double mu = (x - a) / a, exponent = log1p_less(mu);
  const double eta = std::copysign(std::sqrt(-2.0 * exponent), mu);
  const double first = std::abs(mu) < 1e-3 ? -1.0 / 3 + eta * (1.0 / 12 - eta * 2 / 135) : 1 / mu - 1 / eta;
  return std::clamp(0.5 * std::erfc(-eta * std::sqrt(0.5 * a)) -
                        first * std::exp(a * exponent) / std::sqrt(2 * std::numbers::pi * a),
                    0.0, 1.0);
}

}  // namespace detail

/// Logarithm of the gamma function of x > 0, to about 1e-14 of max(1, |result|): Stirling's series
/// (Abramowitz and Stegun 6.1.41) from 8 on, the recurrence below. Unlike std::lgamma it writes no global.
[[nodiscard]] inline double log_gamma(double x) noexcept {
  double below = 1.0;  // x (x + 1) ..., what the recurrence divides by
  for (; x < 8.0; x += 1.0) below *= x;
  constexpr double half_log_two_pi = 0.91893853320467274178;
  return (x - 0.5) * std::log(x) - x + half_log_two_pi + detail::stirling_rest(x) - std::log(below);
}

/// Regularised lower incomplete gamma P(a, x) for a > 0, x >= 0; relative error below 1e-12.
[[nodiscard]] inline double gamma_p(double a, double x) {
  CAIRN_EXPECTS(a > 0.0 && x >= 0.0, "gamma_p needs a > 0 and x >= 0");
  if (x == 0.0) return 0.0;
  if (std::isinf(x)) return 1.0;
  if (a > 1e7) return detail::gamma_p_of_large(a, x);
  // x^a e^-x / gamma(a), without the difference of large numbers that a large a makes of it.
  const double scale = a < 8.0 ? std::exp(a * std::log(x) - x - log_gamma(a))
                               : std::sqrt(0.5 * a / std::numbers::pi) *
                                     std::exp(a * detail::log1p_less((x - a) / a) - detail::stirling_rest(a));
  constexpr double epsilon = 1e-16;
  constexpr int most_terms = 100000;
  if (x < a + 1.0) {  // series 6.5.29
    double term = 1.0 / a;
    double sum = term;
    for (int n = 1; n < most_terms && std::abs(term) > std::abs(sum) * epsilon; ++n) {
      term *= x / (a + n);
      sum += term;
    }
    return std::min(1.0, sum * scale);
  }
  // continued fraction 6.5.31, by Lentz's method
  constexpr double tiny = 1e-300;
  double b = x + 1.0 - a;
  double c = 1.0 / tiny;
  double d = 1.0 / b;
  double fraction = d;
  for (int n = 1; n < most_terms; ++n) {
    const double an = -n * (n - a);
    b += 2.0;
    d = an * d + b;
    if (std::abs(d) < tiny) d = tiny;
    c = b + an / c;
    if (std::abs(c) < tiny) c = tiny;
    d = 1.0 / d;
    const double factor = d * c;
    fraction *= factor;
    if (std::abs(factor - 1.0) < epsilon) break;
  }
  return std::clamp(1.0 - scale * fraction, 0.0, 1.0);
}

/// Probability that a chi-square variable of `dof` degrees of freedom is at most `x` (0 for x <= 0).
[[nodiscard]] inline double chi_square_cdf(double x, double dof) {
  return x <= 0.0 ? 0.0 : gamma_p(0.5 * dof, 0.5 * x);
}

/// The x with chi_square_cdf(x, dof) = probability, 0 <= probability < 1: the gate that keeps that share of
/// good data.
[[nodiscard]] inline double chi_square_quantile(double probability, double dof) {
  CAIRN_EXPECTS(probability >= 0.0 && probability < 1.0 && dof > 0.0,
                "chi_square_quantile needs 0 <= probability < 1 and dof > 0");
  if (probability == 0.0) return 0.0;
  double low = 0.0;
  double high = std::max(1.0, dof);
  while (chi_square_cdf(high, dof) < probability) high *= 2.0;
  for (int step = 0; step < 200 && high - low > 1e-15 * high; ++step) {
    const double middle = 0.5 * (low + high);
    (chi_square_cdf(middle, dof) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Two-sided band of a mean of `runs` independent chi-square variables of `dof` degrees of freedom: with the
/// given confidence the average NEES or NIS of a consistent filter lies inside (Bar-Shalom, Li, Kirubarajan
/// 2001, 5.4.2).
struct ConsistencyBand {
  double low;
  double high;
  [[nodiscard]] bool contains(double value) const noexcept { return value >= low && value <= high; }
};

[[nodiscard]] inline ConsistencyBand chi_square_mean_band(double dof, double runs, double confidence = 0.95) {
  const double tail = 0.5 * (1.0 - confidence);
  return {chi_square_quantile(tail, dof * runs) / runs, chi_square_quantile(1.0 - tail, dof * runs) / runs};
}

/// Probability that a standard normal variable is at most `z`.
[[nodiscard]] inline double normal_cdf(double z) noexcept {
  return 0.5 * std::erfc(-z / std::sqrt(2.0));
}

/// log(sum exp(v)) without overflow; -infinity for an empty span.
[[nodiscard]] inline double log_sum_exp(std::span<const double> values) noexcept {
  if (values.empty()) return -std::numeric_limits<double>::infinity();
  const double largest = *std::max_element(values.begin(), values.end());
  if (!std::isfinite(largest)) return largest;
  double sum = 0.0;
  for (const double value : values) sum += std::exp(value - largest);
  return largest + std::log(sum);
}

/// Count, mean, variance, smallest and largest of a stream of numbers in one pass (Welford 1962).
class RunningMoments {
public:
  void add(double value) noexcept {
    ++count_;
    const double delta = value - mean_;
    mean_ += delta / static_cast<double>(count_);
    squares_ += delta * (value - mean_);
    smallest_ = std::min(smallest_, value);
    largest_ = std::max(largest_, value);
  }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] double mean() const noexcept { return mean_; }
  /// Unbiased sample variance; 0 for fewer than two values.
  [[nodiscard]] double variance() const noexcept {
    return count_ < 2 ? 0.0 : squares_ / static_cast<double>(count_ - 1);
  }
  [[nodiscard]] double standard_deviation() const noexcept { return std::sqrt(variance()); }
  [[nodiscard]] double smallest() const noexcept { return smallest_; }
  [[nodiscard]] double largest() const noexcept { return largest_; }

private:
  std::size_t count_ = 0;
  double mean_ = 0.0;
  double squares_ = 0.0;
  double smallest_ = std::numeric_limits<double>::infinity();
  double largest_ = -std::numeric_limits<double>::infinity();
};

/// The `fraction` quantile (0..1) of the values by linear interpolation between order statistics; NaN when
/// empty. Takes its argument by value because it has to sort. O(n).
[[nodiscard]] inline double quantile(std::vector<double> values, double fraction) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  CAIRN_EXPECTS(fraction >= 0.0 && fraction <= 1.0, "quantile needs a fraction in [0, 1]");
  const double place = fraction * static_cast<double>(values.size() - 1);
  const auto rank = static_cast<std::ptrdiff_t>(place);
  const auto nth = values.begin() + rank;
  std::nth_element(values.begin(), nth, values.end());
  const double low = *nth;
  if (nth + 1 == values.end()) return low;
  const double high = *std::min_element(nth + 1, values.end()), share = place - static_cast<double>(rank);
  if (share == 0 || high == low || std::isinf(low)) return low;
  return std::isfinite(high - low) ? low + share * (high - low) : (1 - share) * low + share * high;
}

[[nodiscard]] inline double median(std::vector<double> values) {
  return quantile(std::move(values), 0.5);
}

}}  // namespace cairn::CAIRN_ABI
