// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Normal equations of a pose from stereo residuals, with robust weights.
///
/// A pose error d = (translation, rotation) is a right step, T exp(d). A landmark at p in the camera frame
/// then moves by d p / d d = [-I, skew(p)]. (1)
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
    Matrix<6> m;
    for (int i = 0, k = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j, ++k) {
        m(i, j) = m(j, i) = sum(translation_[k]);
        m(3 + i, 3 + j) = m(3 + j, 3 + i) = sum(rotation_[k]);
      }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) m(i, 3 + j) = m(3 + j, i) = sum(coupling_[i][j]);
    for (int i = 0; i < 6; i += 3)
      for (int j = 0; j < 6; j += 3) put(m, i, j, transposed_product(R, product(part_of<3, 3>(m, i, j), R)));
    return symmetrised(m);
  }

  [[nodiscard]] Vector<6> gradient(const Matrix<3>& R) const noexcept {
    Vector<6> g;
    for (int i = 0; i < 6; ++i) g(i) = sum(gradient_[i]);
    for (int i = 0; i < 6; i += 3) put(g, i, 0, transposed_product(R, part_of<3, 1>(g, i, 0)));
    return g;
  }

private:
  MatchLane translation_[6] = {}, rotation_[6] = {}, coupling_[3][3] = {}, gradient_[6] = {};
};

/// Cholesky factor of an information matrix; nothing where a direction is undetermined given the others.
[[nodiscard]] inline std::optional<Cholesky<6>> factor_information(const Matrix<6>& information) {
  constexpr double least_share = 1e-10;  // of a direction's information that the others do not explain
  const Cholesky<6> result(information);
  if (!(result.good() && result.least_share() > least_share)) return std::nullopt;
  return result;
}

}}}  // namespace cairn::CAIRN_ABI::detail
