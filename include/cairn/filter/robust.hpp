// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Measurements that are worse than their R says: outliers softened instead of refused, and R learnt from the
/// residuals.
///
/// Robust raises R by the smallest factor >= 1 that brings the NIS down to `limit` (G. Chang, "Robust Kalman
/// filtering based on Mahalanobis distance as outlier judging criterion", Journal of Geodesy 88, 2014).
/// adapted_noise() averages r r^T + H P H^T over the residuals r after the update, which is never indefinite
/// (A. Mohamed, K. Schwarz, "Adaptive Kalman filtering for INS/GPS", Journal of Geodesy 73, 1999).
#pragma once

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/filter/structure.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

namespace detail {

/// The sensor with its noise multiplied.
template <MeasurementModel H>
struct Inflated : H {
  double factor = 1.0;
  [[nodiscard]] CovarianceOf<typename H::Measurement> noise(const typename H::State& x) const {
    const CovarianceOf<typename H::Measurement> r = H::noise(x);
    return r * static_cast<ScalarOf<typename H::State>>(factor);
  }
};

}  // namespace detail

/// Any filter of Gaussian beliefs with softened outliers. Options only.
template <class Filter = Extended>
struct Robust {
  Filter filter{};
  double limit = 9.0;  ///< NIS above which R is raised; > 0, usually a chi-square quantile

  /// Like filter.update; where R was raised the innovation is that of the raised R.
  template <MeasurementModel H>
  auto update(Gaussian<typename H::State>& belief, const H& sensor, const typename H::Measurement& z) const {
    using S = ScalarOf<typename H::State>;
    constexpr int m = dof<typename H::Measurement>;
    const Gaussian<typename H::State> before = belief;
    auto innovation = filter.update(belief, sensor, z);
    if (!(limit > 0.0)) {
      belief = before;
      innovation.status = Status::bad_option;
    }
    const bool judged = innovation.accepted() || innovation.status == Status::gated;
    if (!judged || !(innovation.nis > static_cast<S>(limit))) return innovation;
    const Matrix<m, m, S> r = sensor.noise(before.mean);
    const auto nis = [&](double factor) {
      const Matrix<m, m, S> s = innovation.covariance + static_cast<S>(factor - 1.0) * r;
      return static_cast<double>(detail::squared_mahalanobis<m, S>(innovation.residual, s));
    };
    double low = 1.0;
    double high = 2.0;
    while (nis(high) > limit && high < 1e30) high *= 2.0;
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      (nis(middle) > limit ? low : high) = middle;
    }
    belief = before;
    return filter.update(belief, detail::Inflated<H>{sensor, high}, z);
  }
};

/// R after one more measurement: (1 - rate) R + rate (r r^T + H P H^T), r = z - h(x) with the updated belief.
/// 0 < rate < 1; about 1 / rate measurements count.
template <LinearisedMeasurement H>
[[nodiscard]] CovarianceOf<typename H::Measurement> adapted_noise(
    const CovarianceOf<typename H::Measurement>& r, const Gaussian<typename H::State>& updated,
    const H& sensor, const typename H::Measurement& z, double rate) {
  using S = ScalarOf<typename H::State>;
  using Z = typename H::Measurement;
  CAIRN_EXPECTS(rate > 0.0 && rate < 1.0, "adapted_noise needs a rate between 0 and 1");
  const Matrix<dof<Z>, dof<typename H::State>, S> h = detail::dense_of(sensor.jacobian(updated.mean));
  const Tangent<Z> left = local(Z(sensor.predict(updated.mean)), z);
  const CovarianceOf<Z> seen = left * left.transpose() + h * updated.covariance * h.transpose();
  return symmetrised(static_cast<S>(1.0 - rate) * r + static_cast<S>(rate) * seen);
}

}  // namespace cairn::inline CAIRN_ABI
