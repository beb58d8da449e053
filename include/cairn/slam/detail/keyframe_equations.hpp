// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Normal equations of a camera and of the keyframes that its landmarks rest on.
///
/// A match's residual, whitened with pixels and S, sees the displacement of landmark against camera,
///   d = sum_k F_k G xi_k - G xi_T,   G = [I, -skew(x)],                                   (1)
/// by the information N and gradient g of whitened_sighting.hpp, so that with C_k = F_k and C_T = -I
///   Q_ab = sum G^T C_a^T N C_b G,   q_a = sum G^T C_a^T g.                                (2)
/// With the prior P_ss = L L^T of the keyframes and xi_s = L y, what is solved is
///   [I + L^T Q_ss L, L^T Q_sT; ., Q_TT] (y, xi_T) = (L^T q_s, q_T):                       (3)
/// no inverse of P is needed, and a keyframe known exactly does no harm.
///
/// The rig's numbers c may be of the party: residuals then see d + B c and, directly, J_c c
/// (whitened_sighting.hpp). Order: keyframes, rig, camera.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/simd/processor.hpp>
#include <cairn/slam/detail/keyframe_landmark.hpp>
#include <cairn/slam/world_pose.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Solution of (3): keyframes in their order, the rig where it is of the party, the camera; steps in the
/// world.
struct KeyframeSolution {
  Vector<dynamic> step;
  Matrix<dynamic, dynamic> covariance;
};

class KeyframeEquations {
public:
  /// Forgets everything; for `keyframes` keyframes.
  void open(std::size_t keyframes, bool with_rig = false) {
    size_ = keyframes + 1;
    with_rig_ = with_rig;
    rig_.assign(with_rig ? size_ : 0, Matrix<rig_numbers, 6>::Zero());
    rig_information_.setZero();
    rig_gradient_.setZero();
    blocks_.assign(size_ * size_, Matrix<6>::Zero());
    gradient_.assign(size_, Vector<6>::Zero());
  }

  /// (2) for one match: place[i] is the number here of the keyframe of sighting i.
  void add(const LandmarkGeometry& landmark, std::span<const std::uint32_t> place, const Matrix<3>& N,
           const Vector<3>& g, double weight) {
    const std::size_t count = landmark.count;
    const std::uint32_t camera = static_cast<std::uint32_t>(size_ - 1);
    const Vector<3>& x = landmark.x;
    const Matrix<3> wN = weight * N;
    const Vector<3> wg = weight * g;
    std::array<Matrix<3>, most_sightings> NC;
    for (std::size_t i = 0; i < count; ++i) NC[i] = product(wN, landmark.F[i]);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < count; ++j)
        if (place[i] <= place[j]) add_block(place[i], place[j], transposed_product(landmark.F[i], NC[j]), x);
      add_block(place[i], camera, -transposed(NC[i]), x);
      add_gradient(place[i], transposed_product(landmark.F[i], wg), x);
    }
    add_block(camera, camera, wN, x);
    add_gradient(camera, -wg, x);
  }

  /// What the match says of the rig, besides.
  void add_rig(const LandmarkGeometry& landmark, std::span<const std::uint32_t> place,
               const WeighedSighting& seen, const RigStatistics& rig, double weight) {
    // The rig's numbers stand side by side, in whole registers.
    with_avx2_lanes([&]() CAIRN_INLINED {
      double B[3][rig_numbers], E[3][rig_numbers], GE[3][rig_numbers], SE[3][rig_numbers], K[3][rig_numbers];
      for (int k = 0; k < 3; ++k)
        for (int c = 0; c < rig_numbers; ++c) {
          B[k][c] = landmark.B(k, c);
          E[k][c] = rig.E(k, c);
        }
      combine(seen.G, E, GE);
      combine(landmark.S, E, SE);
      combine(seen.N, B, K);
      for (int k = 0; k < 3; ++k)
        for (int c = 0; c < rig_numbers; ++c) K[k][c] += GE[k][c];  // J^T W (J B + J_c)
      for (std::size_t i = 0; i < landmark.count; ++i) {
        double moved[3][rig_numbers];
        combine(transposed(landmark.F[i]), K, moved);
        add_rig_block(place[i], weight, moved, landmark.x);
      }
      add_rig_block(static_cast<std::uint32_t>(size_ - 1), -weight, K, landmark.x);
      add_rig_information(B, K, GE, SE, rig.D, weight);
      const Vector<3>& g = seen.g;
      for (int c = 0; c < rig_numbers; ++c)
        rig_gradient_(c) += weight * ((B[0][c] * g(0) + B[1][c] * g(1) + B[2][c] * g(2)) + rig.u(c) -
                                      (SE[0][c] * g(0) + SE[1][c] * g(1) + SE[2][c] * g(2)));
    });
  }

  /// Multiplies all that was added.
  void scale(double factor) {
    for (Matrix<6>& block : blocks_) block *= factor;
    for (Vector<6>& part : gradient_) part *= factor;
    for (Matrix<rig_numbers, 6>& block : rig_) block *= factor;
    rig_information_ *= factor;
    rig_gradient_ *= factor;
  }

  /// The camera's part alone: what the matches would say if the keyframes were known.
  [[nodiscard]] const Matrix<6>& camera() const noexcept { return blocks_.back(); }

  /// False where the matches leave a direction of the camera undetermined, or P is no covariance. Directions
  /// are told apart about the place of the camera: from an origin far away all points are in one.
  [[nodiscard]] bool solve(const Matrix<dynamic, dynamic>& P, const Vector<3>& place,
                           KeyframeSolution& solution) const {
    const Matrix<6> to_place = SE3(SO3(), place).adjoint();
    const Cholesky<6> alone(symmetrised(Matrix<6>(to_place.transpose() * camera() * to_place)));
    if (!alone.good() || !(alone.least_share() > 1e-10)) return false;
    const Cholesky<dynamic> prior(P);
    if (!prior.good()) return false;
    const Eigen::Index n = P.rows(), all = n + 6;
    Matrix<dynamic, dynamic> root = Matrix<dynamic, dynamic>::Zero(all, all);
    root.topLeftCorner(n, n) = prior.lower();
    root.bottomRightCorner(6, 6).setIdentity();
    Matrix<dynamic, dynamic> M = root.transpose() * information() * root;
    M.topLeftCorner(n, n).diagonal().array() += 1.0;
    const Cholesky<dynamic> factor(symmetrised(M));
    if (!factor.good()) return false;
    const Vector<dynamic> reduced = root.transpose() * gradient();
    solution.step = root * factor.solve(reduced);
    const Matrix<dynamic, dynamic> half = factor.whiten(Matrix<dynamic, dynamic>(root.transpose()));
    solution.covariance = half.transpose() * half;
    return true;
  }

  /// Q and q of (2), the camera last.
  [[nodiscard]] Matrix<dynamic, dynamic> information() const {
    const Eigen::Index n = row_of(size_ - 1) + 6;
    Matrix<dynamic, dynamic> Q(n, n);
    for (std::size_t a = 0; a < size_; ++a)
      for (std::size_t b = a; b < size_; ++b) {
        Q.block<6, 6>(row_of(a), row_of(b)) = blocks_[a * size_ + b];
        Q.block<6, 6>(row_of(b), row_of(a)) = blocks_[a * size_ + b].transpose();
      }
    if (!with_rig_) return Q;
    const Eigen::Index rig = n - 6 - rig_numbers;
    for (std::size_t a = 0; a < size_; ++a) {
      Q.block<6, rig_numbers>(row_of(a), rig) = rig_[a].transpose();
      Q.block<rig_numbers, 6>(rig, row_of(a)) = rig_[a];
    }
    Q.block<rig_numbers, rig_numbers>(rig, rig) = rig_information_;
    return Q;
  }
  [[nodiscard]] Vector<dynamic> gradient() const {
    Vector<dynamic> q(row_of(size_ - 1) + 6);
    for (std::size_t a = 0; a < size_; ++a) q.segment<6>(row_of(a)) = gradient_[a];
    if (with_rig_) q.segment<rig_numbers>(q.size() - 6 - rig_numbers) = rig_gradient_;
    return q;
  }

private:
  /// Keyframes one after the other, the camera behind the rig.
  [[nodiscard]] Eigen::Index row_of(std::size_t block) const noexcept {
    return 6 * static_cast<Eigen::Index>(block) + (with_rig_ && block + 1 == size_ ? rig_numbers : 0);
  }

  /// The rows of M times those of `rows`.
  [[gnu::always_inline]] static void combine(const Matrix<3>& M, const double (&rows)[3][rig_numbers],
                                             double (&result)[3][rig_numbers]) noexcept {
    for (int i = 0; i < 3; ++i)
      for (int c = 0; c < rig_numbers; ++c)
        result[i][c] = M(i, 0) * rows[0][c] + M(i, 1) * rows[1][c] + M(i, 2) * rows[2][c];
  }

  /// weight G^T K of (1), for the rig's columns.
  [[gnu::always_inline]] void add_rig_block(std::uint32_t a, double weight, const double (&K)[3][rig_numbers],
                                            const Vector<3>& x) noexcept {
    double weighted[3][rig_numbers];
    for (int i = 0; i < 3; ++i)
      for (int c = 0; c < rig_numbers; ++c) weighted[i][c] = weight * K[i][c];
    double* const to = rig_[a].data();
    for (int i = 0; i < 3; ++i) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
      for (int c = 0; c < rig_numbers; ++c) {
        to[i * rig_numbers + c] += weighted[i][c];
        to[(3 + i) * rig_numbers + c] += x(i1) * weighted[i2][c] - x(i2) * weighted[i1][c];
      }
    }
  }

  /// weight (B^T K + GE^T B + D - SE^T GE), symmetric but for rounding, which is taken out.
  [[gnu::always_inline]] void add_rig_information(const double (&B)[3][rig_numbers],
                                                  const double (&K)[3][rig_numbers],
                                                  const double (&GE)[3][rig_numbers],
                                                  const double (&SE)[3][rig_numbers],
                                                  const Matrix<rig_numbers>& D, double weight) noexcept {
    double sum[rig_numbers][rig_numbers];
    for (int c = 0; c < rig_numbers; ++c) {
      const double* const d = D.data() + c * rig_numbers;
      for (int r = 0; r < rig_numbers; ++r) {
        const double direct = d[r] - (SE[0][r] * GE[0][c] + SE[1][r] * GE[1][c] + SE[2][r] * GE[2][c]);
        sum[c][r] = (B[0][r] * K[0][c] + B[1][r] * K[1][c] + B[2][r] * K[2][c]) +
                    (GE[0][r] * B[0][c] + GE[1][r] * B[1][c] + GE[2][r] * B[2][c]) + direct;
      }
    }
    for (int c = 0; c < rig_numbers; ++c)
      for (int r = 0; r < rig_numbers; ++r)
        rig_information_(r, c) += weight * (0.5 * (sum[c][r] + sum[r][c]));
  }

  /// G^T K G of (1) = [K, -K X; X K, -X K X], X = skew(x).
  void add_block(std::uint32_t a, std::uint32_t b, const Matrix<3>& K, const Vector<3>& x) {
    double KX[3][3];  // its rows are those of K crossed with x
    for (int i = 0; i < 3; ++i) {
      KX[i][0] = K(i, 1) * x(2) - K(i, 2) * x(1);
      KX[i][1] = K(i, 2) * x(0) - K(i, 0) * x(2);
      KX[i][2] = K(i, 0) * x(1) - K(i, 1) * x(0);
    }
    Matrix<6>& to = blocks_[a * size_ + b];
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        to(i, j) += K(i, j);
        to(i, 3 + j) -= KX[i][j];
        to(3 + i, j) += x(i1) * K(i2, j) - x(i2) * K(i1, j);
        to(3 + i, 3 + j) -= x(i1) * KX[i2][j] - x(i2) * KX[i1][j];
      }
  }
  void add_gradient(std::uint32_t a, const Vector<3>& u, const Vector<3>& x) {
    for (int i = 0; i < 3; ++i) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
      gradient_[a](i) += u(i);
      gradient_[a](3 + i) += x(i1) * u(i2) - x(i2) * u(i1);
    }
  }

  std::size_t size_ = 1;
  std::vector<Matrix<6>> blocks_;  // of rows a and columns b >= a, row by row
  std::vector<Vector<6>> gradient_;
  bool with_rig_ = false;
  std::vector<Matrix<rig_numbers, 6>> rig_;  // of the rig's rows and columns a
  Matrix<rig_numbers> rig_information_ = Matrix<rig_numbers>::Zero();
  RigState rig_gradient_ = RigState::Zero();
};

/// Covariance of d of (1) by the solution's: how far landmark and camera may still be from where they are
/// predicted.
[[nodiscard]] inline Matrix<3> displacement_covariance(const LandmarkGeometry& landmark,
                                                       std::span<const std::uint32_t> place,
                                                       const Matrix<dynamic, dynamic>& covariance) {
  const std::size_t n = landmark.count + 1;
  const Vector<3>& x = landmark.x;
  const Eigen::Index camera = covariance.rows() - 6;
  const auto row_of = [&](std::size_t a) {
    return a < landmark.count ? 6 * static_cast<Eigen::Index>(place[a]) : camera;
  };
  Matrix<3> sum = Matrix<3>::Zero();
  for (std::size_t b = 0; b < n; ++b) {
    Matrix<3> part = Matrix<3>::Zero();  // sum over a of C_a G P_ab G^T
    for (std::size_t a = 0; a < n; ++a) {
      Matrix<3> of_pair;
      double half[3][6];
      for (int c = 0; c < 6; ++c) {
        const Vector<3> v = moved_with_world(x, &covariance(row_of(a), row_of(b) + c));
        for (int i = 0; i < 3; ++i) half[i][c] = v(i);
      }
      for (int i = 0; i < 3; ++i) {
        const Vector<3> v = moved_with_world(x, half[i]);
        for (int c = 0; c < 3; ++c) of_pair(i, c) = v(c);
      }
      if (a < landmark.count)
        part += product(landmark.F[a], of_pair);
      else
        part -= of_pair;
    }
    if (b < landmark.count)
      sum += product_transposed(part, landmark.F[b]);
    else
      sum -= part;
  }
  return symmetrised(sum);
}

}}}  // namespace cairn::CAIRN_ABI::detail
