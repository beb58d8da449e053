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

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/symmetric_eigen.hpp>
#include <cairn/field/patch.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// sums[u][t] = the product of columns left[t] and right[u] over rows first ... end - 1: nine sums that share
/// their loads.
inline void sums_of_products(const double* const (&left)[3], const double* const (&right)[3],
                             Eigen::Index first, Eigen::Index end, double (&sums)[3][3]) {
  using Lane = RegisterFor<double, 4>;
  constexpr int width = lane_count<double, 4>;
  Lane lanes[3][3] = {};
  Eigen::Index r = first;
  for (; r + width <= end; r += width)
    each<3>([&](int u) __attribute__((always_inline)) {
      const Lane y = load<Lane>(right[u] + r);
      each<3>([&](int t) { lanes[u][t] += load<Lane>(left[t] + r) * y; });
    });
  for (int u = 0; u < 3; ++u)
    for (int t = 0; t < 3; ++t) {
      double sum = 0;
      for (int k = 0; k < width; ++k) sum += lanes[u][t][k];
      for (Eigen::Index k = r; k < end; ++k) sum += left[t][k] * right[u][k];
      sums[u][t] = sum;
    }
}

/// to += A^T A for few columns; the lower triangle and little beside it. Half of the time of Eigen's
/// rankUpdate, which is made for many columns.
template <int K>
void add_squares(const Matrix<dynamic, K>& a, Matrix<K>& to) {
  constexpr Eigen::Index piece = 256;  // rows of which all columns stay in the first cache
  const auto column = [&](int k) { return a.data() + std::min(k, K - 1) * a.rows(); };  // past the last, that
  for (Eigen::Index first = 0; first < a.rows(); first += piece)
    for (int j = 0; j < K; j += 3)
      for (int i = j; i < K; i += 3) {
        double sums[3][3];
        sums_of_products({column(i), column(i + 1), column(i + 2)}, {column(j), column(j + 1), column(j + 2)},
                         first, std::min(first + piece, a.rows()), sums);
        for (int u = 0; u < 3 && j + u < K; ++u)
          for (int t = 0; t < 3 && i + t < K; ++t) to(i + t, j + u) += sums[u][t];
      }
}

}  // namespace detail

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
  PatchNoise(double variance, const PatchShape& shape, double map_variance, double alpha, double scale_along,
             double scale_across)
      : PatchNoise(variance) {
    CAIRN_EXPECTS(map_variance >= 0.0 && alpha > 0.0 && scale_along > 0.0 && scale_across > 0.0,
                  "a map error needs a variance of at least 0, a positive alpha and positive scales");
    if (map_variance == 0.0) return;
    const Modes along(shape.along(), alpha * scale_along);
    const Modes across(shape.across(), alpha * scale_across);
    const int n = along.above(negligible * variance / (map_variance * across.value(0)));
    const int m = across.above(negligible * variance / (map_variance * along.value(0)));
    along_.resize(n, shape.along());
    across_.resize(shape.across(), m);
    root_gain_.resize(n, m);
    for (int j = 0; j < m; ++j) {
      for (int k = 0; k < shape.across(); ++k) across_(k, j) = across.vector(j)[k];
      for (int i = 0; i < n; ++i) {
        const double both = map_variance * along.value(i) * across.value(j);
        root_gain_(i, j) = std::sqrt(both / (variance + both));
      }
    }
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < shape.along(); ++k) along_(i, k) = along.vector(i)[k];
    bound_ = variance + map_variance * along.value(0) * across.value(0);
  }

  [[nodiscard]] double variance() const noexcept { return variance_; }
  [[nodiscard]] bool white() const noexcept { return root_gain_.size() == 0; }

  /// columns^T C^-1 columns for columns of one number a sample (the frame's order). Where samples are missing
  /// (rows of zeros, complete = false), a correlated C is replaced by its largest eigenvalue, which can only
  /// lower the information. O(samples * columns * (columns + modes)).
  template <int K>
  [[nodiscard]] Matrix<K> weigh(const Matrix<dynamic, K>& columns, bool complete = true) const {
    Matrix<K> result = Matrix<K>::Zero();
    detail::add_squares(columns, result);
    CAIRN_EXPECTS(white() || columns.rows() == along_.cols() * across_.rows(),
                  "PatchNoise: a correlated noise weighs frames of the shape it was made for");
    if (!white() && complete) subtract_modes(columns, result);
    const double weight = 1.0 / (complete ? variance_ : bound_);
    for (int j = 0; j < K; ++j)
      for (int i = j; i < K; ++i) result(j, i) = result(i, j) *= weight;
    return result;
  }

private:
  static constexpr double negligible = 1e-5;  // modes with less of the white variance are left out

  /// Eigenvalues and eigenvectors of the K of (1) of a row of samples, largest first.
  class Modes {
  public:
    Modes(int count, double alpha) : values_(size_of(count)), vectors_(size_of(count) * size_of(count)) {
      std::vector<double> correlation;
      correlation.reserve(vectors_.size());
      for (int j = 0; j < count; ++j)
        for (int i = 0; i < count; ++i) {
          const double d = alpha * static_cast<double>(i - j);
          correlation.push_back(std::exp(-d * d));
        }
      CAIRN_EXPECTS(symmetric_eigen(std::span(correlation), std::span(values_), std::span(vectors_)),
                    "a map error needs finite alpha and scales");
    }
    [[nodiscard]] double value(int k) const { return values_[size_of(k)]; }
    [[nodiscard]] const double* vector(int k) const { return vectors_.data() + size_of(k) * values_.size(); }
    /// How many eigenvalues are above a bound.
    [[nodiscard]] int above(double bound) const {
      const auto past =
          std::find_if(values_.begin(), values_.end(), [bound](double v) { return !(v > bound); });
      return static_cast<int>(past - values_.begin());
    }

  private:
    static std::size_t size_of(int count) { return static_cast<std::size_t>(count); }
    std::vector<double> values_, vectors_;
  };

  template <int K>
  void subtract_modes(const Matrix<dynamic, K>& columns, Matrix<K>& result) const {
    Matrix<dynamic> lattice(along_.cols(), across_.rows());
    Matrix<dynamic, K> modes(root_gain_.size(), K);
    for (int k = 0; k < K; ++k) {
      std::copy_n(columns.data() + k * columns.rows(), lattice.size(), lattice.data());
      const Matrix<dynamic> mode = product(product(along_, lattice), across_);
      for (Eigen::Index i = 0; i < mode.size(); ++i) modes(i, k) = mode.data()[i] * root_gain_.data()[i];
    }
    Matrix<K> squares = Matrix<K>::Zero();
    detail::add_squares(modes, squares);
    for (int j = 0; j < K; ++j)
      for (int i = j; i < K; ++i) result(i, j) -= squares(i, j);
  }

  double variance_;
  double bound_;               // largest eigenvalue of C
  Matrix<dynamic> along_;      // U^T, rows that matter
  Matrix<dynamic> across_;     // V, columns that matter
  Matrix<dynamic> root_gain_;  // root of G, along x across
};

}}  // namespace cairn::CAIRN_ABI
