// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The noise of a frame against a map: white noise of the sensor, and the map's own error, which neighbouring
/// samples share.
///
///   C = s^2 I + m^2 K_across (x) K_along,    K_ij = exp(-alpha^2 L^2 (i - j)^2)                  (1)
/// Taking a correlated error for white makes a filter overconfident by the square root of the samples that
/// share it. K is a Kronecker product on the frame's lattice, so with K_along = U D U^T, K_across = V E V^T
///   C^-1 = (I - (V (x) U) G (V (x) U)^T) / s^2,   G = m^2 D E / (s^2 + m^2 D E)                  (2)
/// and as the eigenvalues of a Gaussian correlation fall fast, few columns of U and V are needed. The map's
/// error at a place is the same in every frame that sees it: frames must not overlap much for (1) to be all.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>

#include <Eigen/Eigenvalues>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/version.hpp>

namespace cairn::inline CAIRN_ABI {

/// The weights C^-1 of a frame's samples.
class PatchNoise {
public:
  /// White noise of this variance, > 0.
  explicit PatchNoise(double variance) : variance_(variance), bound_(variance) {
    CAIRN_EXPECTS(variance > 0.0 && std::isfinite(variance),
                  "the noise of a sample needs a variance above 0");
  }

  /// White noise of `variance` and a map error of `map_variance` whose correlation over a distance d is
  /// exp(-alpha^2 d^2); scales are the distances between samples along and across track. O(N^3 + M^3) once.
  /// A template so that only those who call it compile the eigenvectors.
  template <std::same_as<double> Real = double>
  PatchNoise(Real variance, const PatchShape& shape, double map_variance, double alpha, double scale_along,
             double scale_across)
      : PatchNoise(variance) {
    CAIRN_EXPECTS(map_variance >= 0.0 && alpha > 0.0 && scale_along > 0.0 && scale_across > 0.0,
                  "a map error needs a variance of at least 0, a positive alpha and positive scales");
    if (map_variance == 0.0) return;
    const Eigen::SelfAdjointEigenSolver<Matrix<dynamic>> along(
        correlation(shape.along(), alpha * scale_along));
    const Eigen::SelfAdjointEigenSolver<Matrix<dynamic>> across(
        correlation(shape.across(), alpha * scale_across));
    const double largest_along = along.eigenvalues().maxCoeff();
    const double largest_across = across.eigenvalues().maxCoeff();
    const auto keep = [&](const Vector<dynamic>& values, double other) {
      return (map_variance * other * values.array() > negligible * variance).count();
    };
    const auto kept_along = keep(along.eigenvalues(), largest_across);
    const auto kept_across = keep(across.eigenvalues(), largest_along);
    along_ = along.eigenvectors().rightCols(kept_along);
    across_ = across.eigenvectors().rightCols(kept_across);
    gain_ = map_variance * along.eigenvalues().tail(kept_along) *
            across.eigenvalues().tail(kept_across).transpose();
    gain_ = (gain_.array() / (variance + gain_.array())).eval();  // G of (2)
    bound_ = variance + map_variance * largest_along * largest_across;
  }

  [[nodiscard]] double variance() const noexcept { return variance_; }
  [[nodiscard]] bool white() const noexcept { return gain_.size() == 0; }

  /// columns^T C^-1 columns for columns of one number a sample (the frame's order). Where samples are missing
  /// (rows of zeros, complete = false), a correlated C is replaced by its largest eigenvalue, which can only
  /// lower the information. O(samples * columns * (columns + modes)).
  template <int K>
  [[nodiscard]] Matrix<K> weigh(const Matrix<dynamic, K>& columns, bool complete = true) const {
    Matrix<K> result = Matrix<K>::Zero();
    result.template selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
    if (!white() && complete) subtract_modes<K>(columns, result);
    result *= 1.0 / (complete ? variance_ : bound_);
    result.template triangularView<Eigen::StrictlyUpper>() = result.transpose();
    return result;
  }

private:
  static constexpr double negligible = 1e-5;  // modes with less of the white variance are left out

  static Matrix<dynamic> correlation(int count, double alpha) {
    return Matrix<dynamic>::NullaryExpr(count, count, [alpha](Eigen::Index i, Eigen::Index j) {
      const double d = alpha * static_cast<double>(i - j);
      return std::exp(-d * d);
    });
  }

  template <int K>
  void subtract_modes(const Matrix<dynamic, K>& columns, Matrix<K>& result) const {
    Matrix<dynamic, K> modes(gain_.size(), K);
    for (int k = 0; k < K; ++k) {
      const Eigen::Map<const Matrix<dynamic>> lattice(columns.col(k).data(), along_.rows(), across_.rows());
      Eigen::Map<Matrix<dynamic>>(modes.col(k).data(), gain_.rows(), gain_.cols()).noalias() =
          (along_.transpose() * lattice) * across_;
    }
    const Eigen::Map<const Vector<dynamic>> g(gain_.data(), gain_.size());
    const Matrix<dynamic, K> weighted = g.cwiseSqrt().asDiagonal() * modes;
    result.template selfadjointView<Eigen::Lower>().rankUpdate(weighted.transpose(), -1.0);
  }

  double variance_;
  double bound_;            // largest eigenvalue of C
  Matrix<dynamic> along_;   // U, columns that matter
  Matrix<dynamic> across_;  // V
  Matrix<dynamic> gain_;    // G, along x across
};

}  // namespace cairn::inline CAIRN_ABI
