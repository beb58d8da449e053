// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Normal equations of a pose from stereo residuals, with robust weights.
///
/// A pose error d = (translation, rotation) is a right step, T exp(d). A landmark at p in the camera frame
/// then moves by d p / d d = [-I, skew(p)]. (1)
///
/// A landmark that is truth + n, n of covariance C, leaves J^T W J an expected E[dJ^T W dJ] too large, and
/// where all landmarks are on a line that alone says how the camera is turned about it. J = -H M with
/// M = [I, -skew(p)] and the pixel's derivative H, which itself changes with p, by (v n^T + n v^T) z for each
/// v that it is applied to (z: the camera's axis over the depth z^T p): (2)
///   dJ = H (z^T n M + n m^T + [0, skew(n)]),   m = M^T z                                  (3)
/// Noise along a ray moves no pixel and is no lever; with H held fixed it would be a long one. The axis of
/// the left camera stands for both. With q = C z, w = W q, u = p x w + r, r_i = e_ijk (C W)_kj, h = p x z and
/// X = skew(p)^T W skew(q - z^T q p / 2), the blocks of the expectation are (4)
///   translation  z^T q W + tr(C W) z z^T + w z^T + z w^T
///   coupling     W skew(q - z^T q p) + (tr(C W) z + w) h^T + z u^T
///   rotation     tr(C W) h h^T + u h^T + h u^T - X - X^T + the mixed cofactors of C and W
#pragma once

#include <cstddef>
#include <optional>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/detail/stereo_residual.hpp>
#include <cairn/geometry/robust_loss.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Whether so many agree that it is a consensus, by the options' min_inliers and min_share.
template <class Options>
[[nodiscard]] bool enough_inliers(std::size_t inliers, std::size_t count, const Options& options) noexcept {
  return inliers >= options.min_inliers &&
         static_cast<double>(inliers) >= options.min_share * static_cast<double>(count);
}

/// Normal equations of a pose step in world axes, a partial sum in each lane.
class alignas(MatchLane) PoseEquations {
public:
  /// (1) with y = R p for p and world axes for the step's.
  [[gnu::always_inline]] void add(const StereoStatistics& s, const MatchLane& weight) noexcept {
    MatchLane W[6], g[3];
    for (int i = 0; i < 6; ++i) W[i] = weight * s.information[i];
    for (int i = 0; i < 3; ++i) g[i] = weight * s.gradient[i];
    const MatchLane(&y)[3] = s.y;
    const MatchLane rows[3][3] = {{W[0], W[1], W[2]}, {W[1], W[3], W[4]}, {W[2], W[4], W[5]}};
    MatchLane lever[3][3];  // W skew(y)
    for (int i = 0; i < 3; ++i) {
      lever[i][0] = rows[i][1] * y[2] - rows[i][2] * y[1];
      lever[i][1] = rows[i][2] * y[0] - rows[i][0] * y[2];
      lever[i][2] = rows[i][0] * y[1] - rows[i][1] * y[0];
    }
    for (int i = 0; i < 6; ++i) translation_[i] += W[i];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) coupling_[i][j] -= lever[i][j];
    for (int i = 0, k = 0; i < 3; ++i)  // skew(y)^T lever
      for (int j = i; j < 3; ++j, ++k)
        rotation_[k] += y[(i + 2) % 3] * lever[(i + 1) % 3][j] - y[(i + 1) % 3] * lever[(i + 2) % 3][j];
    for (int i = 0; i < 3; ++i) {
      gradient_[i] -= g[i];
      gradient_[3 + i] -= y[(i + 1) % 3] * g[(i + 2) % 3] - y[(i + 2) % 3] * g[(i + 1) % 3];
    }
  }

  /// Information matrix for right steps of a pose with rotation `R_world_camera`.
  [[nodiscard]] Matrix<6> information(const Matrix<3>& R) const noexcept {
    return assembled(translation_, rotation_, coupling_, R);
  }

  [[nodiscard]] Vector<6> gradient(const Matrix<3>& R) const noexcept {
    Vector<6> g;
    for (int i = 0; i < 6; ++i) g(i) = sum(gradient_[i]);
    for (int i = 0; i < 6; i += 3) put(g, i, 0, transposed_product(R, part_of<3, 1>(g, i, 0)));
    return g;
  }

  /// Adds to noise() what the landmarks' covariances C, in world axes, do to J, by (4). `axis` is the
  /// camera's, in world axes.
  [[gnu::always_inline]] void add_noise(const StereoStatistics& s, const MatchLane (&C)[6],
                                        const MatchLane (&axis)[3], const MatchLane& weight) noexcept {
    constexpr int packed[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    const MatchLane(&y)[3] = s.y;
    const MatchLane inverse_depth = 1.0 / (axis[0] * y[0] + axis[1] * y[1] + axis[2] * y[2]);
    MatchLane W[3][3], K[3][3], z[3], q[3], w[3], m[3], u[3], half[3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) W[i][j] = weight * s.information[packed[i][j]];
      z[i] = inverse_depth * axis[i];
    }
    for (int i = 0; i < 3; ++i) {
      q[i] = C[packed[i][0]] * z[0] + C[packed[i][1]] * z[1] + C[packed[i][2]] * z[2];
      for (int j = 0; j < 3; ++j)
        K[i][j] = C[packed[i][0]] * W[0][j] + C[packed[i][1]] * W[1][j] + C[packed[i][2]] * W[2][j];
    }
    const MatchLane c = z[0] * q[0] + z[1] * q[1] + z[2] * q[2], trace = K[0][0] + K[1][1] + K[2][2];
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      w[i] = W[i][0] * q[0] + W[i][1] * q[1] + W[i][2] * q[2];
      m[i] = y[j] * z[k] - y[k] * z[j];
      half[i] = q[i] - 0.5 * c * y[i];
    }
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      u[i] = y[j] * w[k] - y[k] * w[j] + K[k][j] - K[j][k];
    }
    MatchLane lever[3][3];  // W skew(q - c y / 2)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        lever[i][j] = W[i][(j + 1) % 3] * half[(j + 2) % 3] - W[i][(j + 2) % 3] * half[(j + 1) % 3];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int k = (j + 1) % 3, l = (j + 2) % 3;
        noise_coupling_[i][j] += lever[i][j] - 0.5 * c * (W[i][k] * y[l] - W[i][l] * y[k]) +
                                 (trace * z[i] + w[i]) * m[j] + z[i] * u[j];
      }
    MatchLane pulled[3][3];  // skew(y)^T lever
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        pulled[i][j] = y[(i + 2) % 3] * lever[(i + 1) % 3][j] - y[(i + 1) % 3] * lever[(i + 2) % 3][j];
    for (int i = 0, n = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j, ++n) {
        const int a = (i + 1) % 3, b = (i + 2) % 3, e = (j + 1) % 3, f = (j + 2) % 3;
        const MatchLane cofactor = W[a][e] * C[packed[b][f]] + W[b][f] * C[packed[a][e]] -
                                   W[a][f] * C[packed[b][e]] - W[b][e] * C[packed[a][f]];
        noise_translation_[n] += c * W[i][j] + trace * z[i] * z[j] + w[i] * z[j] + z[i] * w[j];
        noise_rotation_[n] +=
            trace * m[i] * m[j] + u[i] * m[j] + m[i] * u[j] - pulled[i][j] - pulled[j][i] + cofactor;
      }
  }

  /// (4) for right steps of a pose with rotation `R_world_camera`.
  [[nodiscard]] Matrix<6> noise(const Matrix<3>& R) const noexcept {
    return assembled(noise_translation_, noise_rotation_, noise_coupling_, R);
  }

private:
  [[nodiscard]] static Matrix<6> assembled(const MatchLane (&translation)[6], const MatchLane (&rotation)[6],
                                           const MatchLane (&coupling)[3][3], const Matrix<3>& R) noexcept {
    Matrix<6> m;
    for (int i = 0, k = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j, ++k) {
        m(i, j) = m(j, i) = sum(translation[k]);
        m(3 + i, 3 + j) = m(3 + j, 3 + i) = sum(rotation[k]);
      }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) m(i, 3 + j) = m(3 + j, i) = sum(coupling[i][j]);
    for (int i = 0; i < 6; i += 3)
      for (int j = 0; j < 6; j += 3) put(m, i, j, transposed_product(R, product(part_of<3, 3>(m, i, j), R)));
    return symmetrised(m);
  }

  MatchLane translation_[6] = {}, rotation_[6] = {}, coupling_[3][3] = {}, gradient_[6] = {};
  MatchLane noise_translation_[6] = {}, noise_rotation_[6] = {}, noise_coupling_[3][3] = {};
};

/// Cholesky factor of an information matrix; nothing where a direction is undetermined given the others.
[[nodiscard]] inline std::optional<Cholesky<6>> factor_information(const Matrix<6>& information) {
  constexpr double least_share = 1e-10;  // of a direction's information that the others do not explain
  const Cholesky<6> result(information);
  if (!(result.good() && result.least_share() > least_share)) return std::nullopt;
  return result;
}

}}}  // namespace cairn::CAIRN_ABI::detail
