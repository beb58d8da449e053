// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Linear models given by their matrices, of fixed or run-time size.
///
///   LinearModel   x' = F x + b + B u + noise(Q)      one step, whatever dt is
///   LinearSensor  z  = H x + d + noise(R)
/// Matrices of run-time sizes that fit neither one another nor the state give an empty state or measurement,
/// which filters refuse (Status::size_mismatch).
#pragma once

#include <cairn/core/linalg.hpp>
#include <cairn/filter/affine.hpp>
#include <cairn/filter/model.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// x' = F x + offset + noise(Q), for N states.
template <int N, class S = double>
struct LinearModel {
  using State = Vector<N, S>;
  using Control = NoControl;
  static constexpr bool linear = true;

  Matrix<N, N, S> transition;
  Matrix<N, N, S> covariance;
  Vector<N, S> offset = Vector<N, S>::Zero(N == dynamic ? 0 : N);  ///< may stay empty for run-time sizes

  [[nodiscard]] auto propagate(const State& x, const Control&, double) const {
    return detail::affine(transition, x, offset);
  }
  [[nodiscard]] const Matrix<N, N, S>& jacobian(const State&, const Control&, double) const {
    return transition;
  }
  [[nodiscard]] const Matrix<N, N, S>& noise(const State&, const Control&, double) const {
    return covariance;
  }
};

/// x' = F x + B u + noise(Q), for N states and U controls.
template <int N, int U, class S = double>
struct ControlledLinearModel {
  using State = Vector<N, S>;
  using Control = Vector<U, S>;
  static constexpr bool linear = true;

  Matrix<N, N, S> transition;
  Matrix<N, U, S> input;
  Matrix<N, N, S> covariance;

  [[nodiscard]] auto propagate(const State& x, const Control& u, double) const {
    if constexpr (N != dynamic && U != dynamic) {
      return State(transition * x + input * u);
    } else {
      detail::VectorOrNone<N, S> next;
      const bool fits = transition.cols() == x.size() && input.cols() == u.size();
      if (fits && transition.rows() == input.rows()) next = product(transition, x) + product(input, u);
      return next;
    }
  }
  [[nodiscard]] const Matrix<N, N, S>& jacobian(const State&, const Control&, double) const {
    return transition;
  }
  [[nodiscard]] const Matrix<N, N, S>& noise(const State&, const Control&, double) const {
    return covariance;
  }
};

/// z = H x + offset + noise(R), M numbers of N states.
template <int M, int N, class S = double>
struct LinearSensor {
  using State = Vector<N, S>;
  using Measurement = Vector<M, S>;
  static constexpr bool linear = true;

  Matrix<M, N, S> design;
  Matrix<M, M, S> covariance;
  Vector<M, S> offset = Vector<M, S>::Zero(M == dynamic ? 0 : M);  ///< may stay empty for run-time sizes

  [[nodiscard]] auto predict(const State& x) const { return detail::affine(design, x, offset); }
  [[nodiscard]] const Matrix<M, N, S>& jacobian(const State&) const { return design; }
  [[nodiscard]] const Matrix<M, M, S>& noise(const State&) const { return covariance; }
};

}}  // namespace cairn::CAIRN_ABI
