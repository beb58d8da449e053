// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Does a filter know how wrong it is? NEES with the truth, NIS without it, and the band they must stay in.
///
///   NEES = e^T P^-1 e,  e = local(estimate, truth)        NIS = r^T S^-1 r,  r the innovation
///
/// nees(belief, truth) of filter/gaussian.hpp gives the one, Innovation::nis the other; normalised_squared()
/// does for errors and covariances from elsewhere.
///
/// Both are chi-square distributed with d = dim(e) degrees of freedom when the covariance is right, so a mean
/// over N independent values lies between the quantiles of chi2(N d) / N (Y. Bar-Shalom, X. Li,
/// T. Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, section 5.4). Values of
/// one run at successive times are not independent: average over runs, or thin.
#pragma once

#include <cmath>
#include <cstddef>
#include <optional>

#include <cairn/core/check.hpp>
#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// e^T P^-1 e, or nothing when P (only its lower triangle is read) is not positive definite.
template <class E, class P>
[[nodiscard]] std::optional<double> normalised_squared(const Eigen::MatrixBase<E>& e,
                                                       const Eigen::MatrixBase<P>& covariance) {
  CAIRN_EXPECTS(e.cols() == 1 && covariance.rows() == e.rows() && covariance.cols() == e.rows(),
                "normalised_squared needs a vector and a square matrix of its size");
  const Cholesky<P::RowsAtCompileTime, typename P::Scalar> factor(covariance);
  if (!factor.good()) return std::nullopt;
  const double value = static_cast<double>(factor.whiten(e).squaredNorm());
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

enum class Consistency {
  pessimistic,  ///< errors are smaller than the covariance says
  consistent,
  optimistic,  ///< errors are larger than the covariance says: the dangerous side
};

/// Mean of NEES or NIS values with the band it must lie in.
class ConsistencyTest {
public:
  /// For values of `dof` degrees of freedom each.
  explicit ConsistencyTest(double dof) : dof_(dof) {
    CAIRN_EXPECTS(dof > 0.0, "a consistency test needs at least one degree of freedom");
  }

  void add(double value) {
    CAIRN_EXPECTS(value >= 0.0 && std::isfinite(value),
                  "a normalised squared error is finite and not negative");
    moments_.add(value);
  }

  [[nodiscard]] std::size_t count() const noexcept { return moments_.count(); }
  [[nodiscard]] double mean() const noexcept { return moments_.mean(); }

  /// Two-sided band of the mean, as if all values were independent. Needs at least one value.
  [[nodiscard]] ConsistencyBand band(double confidence = 0.95) const {
    return band_of(static_cast<double>(count()), confidence);
  }

  /// The band when the values are worth only `independent` independent ones, such as the number of runs.
  [[nodiscard]] ConsistencyBand band_of(double independent, double confidence = 0.95) const {
    CAIRN_EXPECTS(independent > 0.0, "a band needs at least one value");
    return chi_square_mean_band(dof_, independent, confidence);
  }

  /// Where the mean lies with respect to band(confidence).
  [[nodiscard]] Consistency verdict(double confidence = 0.95) const {
    const ConsistencyBand limits = band(confidence);
    if (mean() > limits.high) return Consistency::optimistic;
    return mean() < limits.low ? Consistency::pessimistic : Consistency::consistent;
  }

private:
  double dof_;
  RunningMoments moments_;
};

}}  // namespace cairn::CAIRN_ABI
