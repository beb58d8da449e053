// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The Kalman filter: exact for linear models with Gaussian noise.
///
///   predict   x <- F x + b,   P <- F P F^T + Q
///   update    x <- x + K (z - H x),   P <- P - K S K^T,   K = P H^T S^-1,   S = H P H^T + R
/// (R. E. Kalman, "A New Approach to Linear Filtering and Prediction Problems", 1960.)
///
/// The filter is a struct of options and holds no state: one Kalman may serve any number of beliefs, from any
/// number of threads. Fixed sizes never allocate.
#pragma once

#include <concepts>
#include <limits>

#include <cairn/filter/detail/agreement.hpp>
#include <cairn/filter/detail/update.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/filter/status.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Kalman filter for linear models.
struct Kalman {
  Form form = Form::standard;
  double gate = std::numeric_limits<double>::infinity();  ///< refuse a measurement whose NIS is above; > 0
  double fading = 1.0;             ///< fading memory: F P F^T is multiplied by this each step; >= 1
  double stabilising_noise = 0.0;  ///< variance added to every state at each predict; >= 0

  /// Moves the belief by one step of dt. Refused: dt < 0, anything not finite. Whether the belief's
  /// covariance and the noise are covariances is not looked at here, for speed (update() refuses what is
  /// indefinite): ask Gaussian::checked() where they come from outside.
  template <class F, class U = detail::ControlOf<F>>
    requires(LinearProcess<F> || detail::explain_process<F> || detail::explain_linear<F, ProcessModel<F>>)
  Status predict(Gaussian<typename F::State>& belief, const F& process, double dt,
                 const U& control = detail::no_control<U>()) const {
    return detail::predict_linearised(belief, process, control, dt, fading, stabilising_noise);
  }

  /// Takes in the measurement z, or refuses it and leaves the belief as it was.
  template <class H, class V = typename H::Measurement>
    requires(LinearMeasurement<H> || detail::explain_sensor<H> ||
             detail::explain_linear<H, MeasurementModel<H>>)
  Innovation<dof<typename H::Measurement>, ScalarOf<typename H::State>> update(
      Gaussian<typename H::State>& belief, const H& sensor, const V& z) const {
    const detail::PlainSensor plain(sensor, detail::common_size(belief.mean, belief.covariance), z);
    return detail::update_linearised(belief, plain, gate, form);
  }
};

}}  // namespace cairn::CAIRN_ABI
