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

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/detail/robust_pose.hpp>
#include <cairn/geometry/detail/stereo_residual.hpp>
#include <cairn/simd/processor.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// The symmetric matrix of which these are 00 01 02 11 12 22.
struct Packed {
  const MatchLane (&entries)[6];
  [[gnu::always_inline]] const MatchLane& operator()(int i, int j) const noexcept {
    constexpr int place[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    return entries[place[i][j]];
  }
};

/// Calls body(i, j) for each entry of a 3x3 matrix, written out.
template <class Body>
[[gnu::always_inline]] inline void each_entry(const Body& body) noexcept {
  each<9>([&](int k) CAIRN_INLINED { body(k / 3, k % 3); });
}

/// a x b.
[[gnu::always_inline]] inline void cross(const MatchLane (&a)[3], const MatchLane (&b)[3],
                                         MatchLane (&result)[3]) noexcept {
  each<3>([&](int i) CAIRN_INLINED {
    const int k = (i + 1) % 3, l = (i + 2) % 3;
    result[i] = a[k] * b[l] - a[l] * b[k];
  });
}

/// W skew(v): the rows of W, each times v.
[[gnu::always_inline]] inline void times_skew(const Packed& W, const MatchLane (&v)[3],
                                              MatchLane (&result)[3][3]) noexcept {
  each_entry([&](int i, int j) CAIRN_INLINED {
    const int k = (j + 1) % 3, l = (j + 2) % 3;
    result[i][j] = W(i, k) * v[l] - W(i, l) * v[k];
  });
}

/// skew(v)^T M: the columns of M, each times v.
[[gnu::always_inline]] inline void skew_times(const MatchLane (&v)[3], const MatchLane (&M)[3][3],
                                              MatchLane (&result)[3][3]) noexcept {
  each_entry([&](int i, int j) CAIRN_INLINED {
    const int k = (i + 1) % 3, l = (i + 2) % 3;
    result[i][j] = v[l] * M[k][j] - v[k] * M[l][j];
  });
}

/// Normal equations of a pose step in world axes, a partial sum in each lane.
class alignas(MatchLane) PoseEquations {
public:
  /// (1) with y = R p for p and world axes for the step's.
  [[gnu::always_inline]] void add(const StereoStatistics& s, const MatchLane& weight) noexcept {
    MatchLane weighted[6], force[3], moment[3], lever[3][3], rotation[3][3];
    each<6>([&](int i) CAIRN_INLINED { weighted[i] = weight * s.information[i]; });
    each<3>([&](int i) CAIRN_INLINED { force[i] = weight * s.gradient[i]; });
    times_skew(Packed{weighted}, s.y, lever);
    skew_times(s.y, lever, rotation);
    cross(s.y, force, moment);
    each<3>([&](int i) CAIRN_INLINED {
      gradient_[i] -= force[i];
      gradient_[3 + i] -= moment[i];
    });
    each_entry([&](int i, int j) CAIRN_INLINED { sums_.coupling[i][j] -= lever[i][j]; });
    each<6>([&](int k) CAIRN_INLINED {
      sums_.translation[k] += weighted[k];
      sums_.rotation[k] += rotation[row_of[k]][column_of[k]];
    });
  }

  /// Adds to noise() what the landmarks' covariances, in world axes, do to J, by (4). `axis` is the camera's,
  /// in world axes.
  [[gnu::always_inline]] void add_noise(const StereoStatistics& s, const MatchLane (&covariance)[6],
                                        const MatchLane (&axis)[3], const MatchLane& weight) noexcept {
    const MatchLane(&y)[3] = s.y;
    MatchLane weighted[6], CW[3][3], z[3], q[3], w[3], h[3], u[3], half[3];
    each<6>([&](int i) CAIRN_INLINED { weighted[i] = weight * s.information[i]; });
    const Packed W{weighted}, C{covariance};
    const MatchLane inverse_depth = 1.0 / (axis[0] * y[0] + axis[1] * y[1] + axis[2] * y[2]);
    each<3>([&](int i) CAIRN_INLINED { z[i] = inverse_depth * axis[i]; });
    each<3>([&](int i) CAIRN_INLINED { q[i] = C(i, 0) * z[0] + C(i, 1) * z[1] + C(i, 2) * z[2]; });
    each_entry([&](int i, int j)
                   CAIRN_INLINED { CW[i][j] = C(i, 0) * W(0, j) + C(i, 1) * W(1, j) + C(i, 2) * W(2, j); });
    const MatchLane c = z[0] * q[0] + z[1] * q[1] + z[2] * q[2], trace = CW[0][0] + CW[1][1] + CW[2][2];
    each<3>([&](int i) CAIRN_INLINED {
      w[i] = W(i, 0) * q[0] + W(i, 1) * q[1] + W(i, 2) * q[2];
      half[i] = q[i] - 0.5 * c * y[i];
    });
    cross(y, z, h);
    cross(y, w, u);
    each<3>([&](int i)
                CAIRN_INLINED { u[i] += CW[(i + 2) % 3][(i + 1) % 3] - CW[(i + 1) % 3][(i + 2) % 3]; });
    MatchLane W_half[3][3], W_y[3][3], X[3][3];
    times_skew(W, half, W_half);
    times_skew(W, y, W_y);
    skew_times(y, W_half, X);
    each_entry([&](int i, int j) CAIRN_INLINED {
      noise_.coupling[i][j] +=
          W_half[i][j] - 0.5 * c * W_y[i][j] + (trace * z[i] + w[i]) * h[j] + z[i] * u[j];
    });
    each<6>([&](int k) CAIRN_INLINED {
      const int i = row_of[k], j = column_of[k];
      noise_.translation[k] += c * weighted[k] + trace * z[i] * z[j] + w[i] * z[j] + z[i] * w[j];
      noise_.rotation[k] += trace * h[i] * h[j] + u[i] * h[j] + h[i] * u[j] - X[i][j] - X[j][i];
      add_mixed_cofactor(W, C, i, j, noise_.rotation[k]);
    });
  }

  /// Information matrix for right steps of a pose with rotation `R_world_camera`.
  [[nodiscard]] Matrix<6> information(const Matrix<3>& R) const noexcept { return sums_.assembled(R); }

  /// (4), the same way.
  [[nodiscard]] Matrix<6> noise(const Matrix<3>& R) const noexcept { return noise_.assembled(R); }

  [[nodiscard]] Vector<6> gradient(const Matrix<3>& R) const noexcept {
    Vector<6> g;
    for (int i = 0; i < 6; ++i) g(i) = sum(gradient_[i]);
    for (int i = 0; i < 6; i += 3) put(g, i, 0, transposed_product(R, part_of<3, 1>(g, i, 0)));
    return g;
  }

private:
  static constexpr int row_of[6] = {0, 0, 0, 1, 1, 2}, column_of[6] = {0, 1, 2, 1, 2, 2};  // as Packed

  struct alignas(MatchLane) Blocks {
    MatchLane translation[6] = {}, rotation[6] = {}, coupling[3][3] = {};

    [[nodiscard]] Matrix<6> assembled(const Matrix<3>& R) const noexcept {
      const Packed upper{translation}, lower{rotation};
      Matrix<6> m;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          m(i, j) = sum(upper(i, j));
          m(3 + i, 3 + j) = sum(lower(i, j));
          m(i, 3 + j) = m(3 + j, i) = sum(coupling[i][j]);
        }
      for (int i = 0; i < 6; i += 3)
        for (int j = 0; j < 6; j += 3)
          put(m, i, j, transposed_product(R, product(part_of<3, 3>(m, i, j), R)));
      return symmetrised(m);
    }
  };

  Blocks sums_, noise_;
  MatchLane gradient_[6] = {};
};

}}}  // namespace cairn::CAIRN_ABI::detail
