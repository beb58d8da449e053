// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What a step of a filter says about itself: its status, and the innovation of a measurement.
///
/// A step that is not `accepted` has left the belief as it was, bit for bit.
#pragma once

#include <cmath>
#include <limits>

#include <Eigen/Core>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/explain.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// Verdict of one predict or update.
enum class [[nodiscard]] Status {
  accepted,               ///< the belief holds the result
  gated,                  ///< the measurement lies outside the gate
  not_finite,             ///< NaN or infinity in the belief, model, control or measurement
  not_positive_definite,  ///< the innovation's covariance or the result is not a covariance
  bad_time_step,          ///< dt is negative, or not finite
  bad_option,             ///< an option of the filter is outside its range
  size_mismatch,          ///< run-time sizes do not fit together
  depleted,               ///< no particle, or no weight, or no mode is left
  not_converged,          ///< an iteration stopped before its tolerance
  too_old,                ///< the measurement is of a moment before all that is remembered
  bad_weights,            ///< weights or probabilities are negative, or do not sum to 1
  contradiction,          ///< constraints disagree with each other, or with what is known exactly
  unknown_block,          ///< a block that is named is not in the state, or is named twice
};

/// The status as a sentence for a log.
[[nodiscard]] constexpr const char* explain(Status status) noexcept {
  switch (status) {
    case Status::accepted:
      return "accepted";
    case Status::gated:
      return "refused: the measurement lies outside the gate";
    case Status::not_finite:
      return "refused: NaN or infinity in the belief, the model or the measurement";
    case Status::not_positive_definite:
      return "refused: a covariance is not positive definite";
    case Status::bad_time_step:
      return "refused: the time step is negative or not finite";
    case Status::bad_option:
      return "refused: an option of the filter is out of range";
    case Status::size_mismatch:
      return "refused: sizes of belief, model and measurement differ";
    case Status::depleted:
      return "refused: no particle or mode has any weight left";
    case Status::not_converged:
      return "refused: the iteration did not converge";
    case Status::too_old:
      return "refused: the measurement is older than what is remembered";
    case Status::bad_weights:
      return "refused: probabilities are negative or do not sum to 1";
    case Status::contradiction:
      return "refused: constraints contradict each other or what is known exactly";
    case Status::unknown_block:
      return "refused: a block that is named is not in the state, or is named twice";
  }
  return "unknown status";
}

/// What a measurement of M numbers brought: residual z - h(x) (a tangent vector), its predicted covariance
/// S = H P H^T + R, and nis = residual^T S^-1 residual, which is chi-square of M degrees of freedom when the
/// filter is consistent. Where the status is not accepted, later fields may not have been computed (zero).
template <int M, class S = double>
struct [[nodiscard]] Innovation {
  Vector<M, S> residual{};
  Matrix<M, M, S> covariance{};
  S nis = S(0);
  Status status = Status::accepted;
  /// Of S, where S as it is written has lost it to rounding; NaN where it has not.
  S log_determinant = std::numeric_limits<S>::quiet_NaN();

  [[nodiscard]] bool accepted() const noexcept { return status == Status::accepted; }

  /// Natural logarithm of the Gaussian density of the residual: the measurement's contribution to the
  /// likelihood of the model. O(M^3), computed on demand.
  [[nodiscard]] S log_likelihood() const {
    const S two_pi = S(6.283185307179586476925286766559L);
    using std::log;
    const bool lost = log_determinant == log_determinant;
    return S(-0.5) * (nis + (lost ? log_determinant : Cholesky<M, S>(covariance).log_determinant()) +
                      S(static_cast<int>(residual.size())) * log(two_pi));
  }
};

/// What an update says of itself where it makes no innovation, as that of an information form, which would
/// need P, or of a mixture. Converts to its status.
struct [[nodiscard]] UpdateResult {
  Status status = Status::accepted;

  [[nodiscard]] constexpr bool accepted() const noexcept { return status == Status::accepted; }
  constexpr UpdateResult() noexcept = default;
  constexpr UpdateResult(Status found) noexcept : status(found) {}
  constexpr operator Status() const noexcept { return status; }
};

}}  // namespace cairn::CAIRN_ABI
