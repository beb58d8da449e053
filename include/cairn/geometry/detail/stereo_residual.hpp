// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// How far a stereo observation of a landmark is from where a pose predicts it: the statistics that pose
/// estimation scores and minimises.
///
/// At a pose, y is the landmark as seen from the camera's centre, in world axes, r the four pixel residuals
/// divided by their sigmas, J = d r / d y, and C the landmark's covariance. The residual's covariance is
/// I + J C J^T, and by Woodbury's identity everything needed is 3x3:
///   A = J^T J,   b = J^T r,   G = (I + A C)^-1                                           (1)
///   chi^2       = r^T (I + J C J^T)^-1 r   = r^T r - b^T C G b                            (2)
///   gradient    = J^T (I + J C J^T)^-1 r   = G b                                          (3)
///   information = J^T (I + J C J^T)^-1 J   = G A                                          (4)
/// which also holds for C = 0, a landmark known exactly.
///
/// Distortion is not evaluated in loops: pixels are undistorted once, and residuals of normalised coordinates
/// are multiplied by the pixel's derivative at the observation, which is exact to first order in the
/// residual.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/geometry/detail/robust_pose.hpp>
#include <cairn/geometry/stereo_match.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/simd/processor.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// Four doubles: one AVX register, or two of SSE2, by reference only (simd/registers.hpp).
typedef Lanes<double, 4> MatchLane __attribute__((aligned(32)));  // gcc without AVX would take 16
inline constexpr std::size_t match_lanes = 4;
static_assert(sizeof(MatchLane) == 32 && alignof(MatchLane) == 32);

/// One camera's observations: normalised coordinates, and what whitens their residuals.
struct alignas(MatchLane) WhitenedPixels {
  MatchLane x, y;
  MatchLane xx, xy, yx, yy;  // rows of d pixel / d normalised, divided by sigma
};

/// Four StereoMatches made ready for many evaluations.
struct alignas(MatchLane) MatchLanes {
  MatchLane landmark[3];
  MatchLane covariance[6];  // 00 01 02 11 12 22
  MatchLane spread;         // trace of the covariance
  WhitenedPixels left, right;
  MatchLane usable;  // 1 or 0
};

/// MatchLane `from_lane` of `from` becomes lane `to_lane` of `to`.
inline void copy_lane(const MatchLanes& from, std::size_t from_lane, MatchLanes& to,
                      std::size_t to_lane) noexcept {
  using Doubles = std::array<double, sizeof(MatchLanes) / sizeof(double)>;
  const auto source = std::bit_cast<Doubles>(from);
  auto target = std::bit_cast<Doubles>(to);
  for (std::size_t i = 0; i < source.size(); i += match_lanes) target[i + to_lane] = source[i + from_lane];
  to = std::bit_cast<MatchLanes>(target);
}

/// Pose and rig as the loops need them, every number in all lanes.
struct alignas(MatchLane) StereoView {
  MatchLane left[9], right[9];  // rotations from world axes, row by row
  MatchLane camera[3], t_right_left[3];
  double nearest;  // a point so near that its disparity is 20 focal lengths was not seen by both cameras

  StereoView(const SE3& T_world_camera, const StereoRig& rig) : nearest(0.05 * rig.baseline()) {
    const Matrix<3> R_left_world = transposed(T_world_camera.rotation().matrix());
    const Matrix<3> R_right_world = transposed_product(rig.T_left_right.rotation().matrix(), R_left_world);
    const Vector<3> shift = rig.T_left_right.inverse().translation();
    for (int i = 0; i < 9; ++i) {
      fill(left[i], R_left_world(i / 3, i % 3));
      fill(right[i], R_right_world(i / 3, i % 3));
    }
    for (int i = 0; i < 3; ++i) {
      fill(camera[i], T_world_camera.translation()(i));
      fill(t_right_left[i], shift(i));
    }
  }

private:
  static void fill(MatchLane& lane, double value) noexcept {
    for (std::size_t i = 0; i < match_lanes; ++i) lane[i] = value;
  }
};

/// What four matches say at a view.
struct alignas(MatchLane) StereoStatistics {
  MatchLane y[3];            // landmarks from the camera's centre, world axes
  MatchLane chi_squared;     // infinite where a camera cannot see the landmark
  MatchLane gradient[3];     // (3)
  MatchLane information[6];  // (4): 00 01 02 11 12 22
};

/// Residuals of both cameras: r^T r, A and b of (1).
struct alignas(MatchLane) StereoResidual {
  MatchLane squares, A[6], b[3];
};

/// Adds one camera's part: `R` turns world axes into its frame, p is the landmark there.
[[gnu::always_inline]] inline void add_pixels(const WhitenedPixels& o, const MatchLane (&R)[9],
                                              const MatchLane (&p)[3], StereoResidual& s) noexcept {
  const MatchLane inverse = 1.0 / p[2], x = p[0] * inverse, y = p[1] * inverse;
  const MatchLane ex = o.x - x, ey = o.y - y;
  const MatchLane w[2][2] = {{o.xx, o.xy}, {o.yx, o.yy}};
  each<2>([&](int i) CAIRN_INLINED {
    const MatchLane r = w[i][0] * ex + w[i][1] * ey;
    const MatchLane j0 = w[i][0] * inverse, j1 = w[i][1] * inverse, j2 = -(j0 * x + j1 * y);
    const MatchLane a = j0 * R[0] + j1 * R[3] + j2 * R[6];
    const MatchLane b = j0 * R[1] + j1 * R[4] + j2 * R[7];
    const MatchLane c = j0 * R[2] + j1 * R[5] + j2 * R[8];
    s.squares += r * r;
    s.A[0] += a * a;
    s.A[1] += a * b;
    s.A[2] += a * c;
    s.A[3] += b * b;
    s.A[4] += b * c;
    s.A[5] += c * c;
    s.b[0] += r * a;
    s.b[1] += r * b;
    s.b[2] += r * c;
  });
}

/// (1) to (4) for a landmark with covariance C; turns the residual's A and b into information and gradient.
[[gnu::always_inline]] inline void weigh_landmark(const MatchLane (&C)[6], const StereoResidual& r,
                                                  StereoStatistics& s) noexcept {
  const MatchLane(&A)[6] = r.A;
  const MatchLane m00 = 1.0 + A[0] * C[0] + A[1] * C[1] + A[2] * C[2],
                  m01 = A[0] * C[1] + A[1] * C[3] + A[2] * C[4],
                  m02 = A[0] * C[2] + A[1] * C[4] + A[2] * C[5],
                  m10 = A[1] * C[0] + A[3] * C[1] + A[4] * C[2],
                  m11 = 1.0 + A[1] * C[1] + A[3] * C[3] + A[4] * C[4],
                  m12 = A[1] * C[2] + A[3] * C[4] + A[4] * C[5],
                  m20 = A[2] * C[0] + A[4] * C[1] + A[5] * C[2],
                  m21 = A[2] * C[1] + A[4] * C[3] + A[5] * C[4],
                  m22 = 1.0 + A[2] * C[2] + A[4] * C[4] + A[5] * C[5];
  const MatchLane c00 = m11 * m22 - m12 * m21, c01 = m12 * m20 - m10 * m22, c02 = m10 * m21 - m11 * m20;
  const MatchLane scale = 1.0 / (m00 * c00 + m01 * c01 + m02 * c02);
  const MatchLane G[3][3] = {{c00 * scale, (m02 * m21 - m01 * m22) * scale, (m01 * m12 - m02 * m11) * scale},
                             {c01 * scale, (m00 * m22 - m02 * m20) * scale, (m02 * m10 - m00 * m12) * scale},
                             {c02 * scale, (m01 * m20 - m00 * m21) * scale, (m00 * m11 - m01 * m10) * scale}};
  each<3>([&](int i)
              CAIRN_INLINED { s.gradient[i] = G[i][0] * r.b[0] + G[i][1] * r.b[1] + G[i][2] * r.b[2]; });
  s.information[0] = G[0][0] * A[0] + G[0][1] * A[1] + G[0][2] * A[2];
  s.information[1] = G[0][0] * A[1] + G[0][1] * A[3] + G[0][2] * A[4];
  s.information[2] = G[0][0] * A[2] + G[0][1] * A[4] + G[0][2] * A[5];
  s.information[3] = G[1][0] * A[1] + G[1][1] * A[3] + G[1][2] * A[4];
  s.information[4] = G[1][0] * A[2] + G[1][1] * A[4] + G[1][2] * A[5];
  s.information[5] = G[2][0] * A[2] + G[2][1] * A[4] + G[2][2] * A[5];
  const MatchLane(&g)[3] = s.gradient;
  s.chi_squared = r.squares - r.b[0] * (C[0] * g[0] + C[1] * g[1] + C[2] * g[2]) -
                  r.b[1] * (C[1] * g[0] + C[3] * g[1] + C[4] * g[2]) -
                  r.b[2] * (C[2] * g[0] + C[4] * g[1] + C[5] * g[2]);
}

using LaneMask = decltype(MatchLane{} < MatchLane{});

/// Keeps the lanes of `seen` whose point is in front of a camera and no farther off its axis than any pinhole
/// image reaches: beside the camera, derivatives grow until the differences in (2) to (4) are all rounding.
[[gnu::always_inline]] inline void keep_in_sight(const MatchLane (&p)[3], double nearest,
                                                 LaneMask& seen) noexcept {
  constexpr double widest = 10;  // tangent of 84 degrees
  const MatchLane reach = widest * p[2];
  seen &= (p[2] > nearest) & (p[0] < reach) & (-p[0] < reach) & (p[1] < reach) & (-p[1] < reach);
}

/// Statistics of four matches at a view. Where all chi^2 are surely above `gate` they are left at bounds
/// above it, and gradient and information are not computed: most wrong matches need no more than that.
[[gnu::always_inline]] inline bool evaluate(const MatchLanes& m, const StereoView& view, double gate,
                                            StereoStatistics& s) noexcept {
  MatchLane p[3], q[3];
  each<3>([&](int i) CAIRN_INLINED { s.y[i] = m.landmark[i] - view.camera[i]; });
  const MatchLane *L = view.left, *R = view.right, *y = s.y;
  each<3>([&](int i) CAIRN_INLINED {
    p[i] = y[0] * L[3 * i] + y[1] * L[3 * i + 1] + y[2] * L[3 * i + 2];
    q[i] = y[0] * R[3 * i] + y[1] * R[3 * i + 1] + y[2] * R[3 * i + 2] + view.t_right_left[i];
  });
  LaneMask seen = m.usable > 0.0;
  keep_in_sight(p, view.nearest, seen);
  keep_in_sight(q, view.nearest, seen);
  const MatchLane one = {1, 1, 1, 1}, infinite = one / 0.0;
  p[2] = seen ? p[2] : one;
  q[2] = seen ? q[2] : one;
  StereoResidual r{};
  add_pixels(m.left, view.left, p, r);
  add_pixels(m.right, view.right, q, r);
  // The residual's covariance is at most (1 + trace A trace C) I.
  const MatchLane least = r.squares / (1.0 + (r.A[0] + r.A[3] + r.A[5]) * m.spread);
  s.chi_squared = seen ? least : infinite;
  const auto near = s.chi_squared < gate;
  if ((near[0] | near[1] | near[2] | near[3]) == 0) return false;
  weigh_landmark(m.covariance, r, s);
  s.chi_squared = s.chi_squared > least ? s.chi_squared : least;  // rounding, where C is enormous
  s.chi_squared = seen ? s.chi_squared : infinite;
  return true;
}

[[noreturn, gnu::cold, gnu::noinline]] inline void refuse_match(std::size_t index, const char* what) {
  raise("stereo match " + std::to_string(index) + ": expected " + what);
}

inline void check_match(const StereoMatch& m, std::size_t index) {
  if (!all_finite(m.landmark)) refuse_match(index, "a finite landmark position");
  if (!nearly_semi_definite(m.covariance))
    refuse_match(index, "a landmark covariance: finite, symmetric, positive semi-definite");
  if (!all_finite(m.left) || !all_finite(m.right)) refuse_match(index, "finite pixels");
  if (!(m.sigma_left > 0 && m.sigma_right > 0 && std::isfinite(m.sigma_left) && std::isfinite(m.sigma_right)))
    refuse_match(index, "positive finite pixel noise");
}

inline void whiten(const NormalisedWithJacobian& n, double sigma, std::size_t lane,
                   WhitenedPixels& o) noexcept {
  const Matrix<2> W = n.J_pixel / sigma;
  o.x[lane] = n.normalised(0);
  o.y[lane] = n.normalised(1);
  o.xx[lane] = W(0, 0);
  o.xy[lane] = W(0, 1);
  o.yx[lane] = W(1, 0);
  o.yy[lane] = W(1, 1);
}

/// Undistorts and whitens once. Throws Error naming the match where a number is not finite. `right_rows`
/// false: the right row is no measurement of its own.
inline void prepare(const StereoMatch& m, std::size_t index, const StereoRig& rig, bool right_rows,
                    MatchLanes& lanes) {
  check_match(m, index);
  const std::size_t lane = index % match_lanes;
  for (int i = 0; i < 3; ++i) lanes.landmark[i][lane] = m.landmark(i);
  for (int i = 0, k = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j, ++k)
      lanes.covariance[k][lane] = 0.5 * (m.covariance(i, j) + m.covariance(j, i));
  lanes.spread[lane] = m.covariance.trace();
  const auto l = rig.left.normalise_with_jacobian(m.left), r = rig.right.normalise_with_jacobian(m.right);
  if (!l || !r) return;
  lanes.usable[lane] = 1;
  whiten(*l, m.sigma_left, lane, lanes.left);
  whiten(*r, m.sigma_right, lane, lanes.right);
  if (!right_rows) lanes.right.yx[lane] = lanes.right.yy[lane] = 0;
}

}}}  // namespace cairn::CAIRN_ABI::detail
