// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Stereo rigs and scenes that geometry tests share.
#pragma once

#include <algorithm>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/stereo_rig.hpp>

namespace cairn_test {

/// The rig of the stereo landmark system, as it was first published: 768 x 576 pixels, 40 degrees, 0.2 m
/// apart.
inline cairn::StereoRig rectified_rig(double baseline = 0.2) {
  const cairn::PinholeCamera camera(
      {.fx = 1055, .fy = 1055, .cx = 383.5, .cy = 287.5, .width = 768, .height = 576});
  return {camera, camera, cairn::SE3(cairn::SO3(), cairn::Vector<3>(baseline, 0, 0))};
}

/// A camera of KITTI before rectification.
inline constexpr cairn::PinholeParameters unrectified_camera{.fx = 984.2,
                                                             .fy = 980.8,
                                                             .cx = 690,
                                                             .cy = 233.2,
                                                             .k1 = -0.3728755,
                                                             .k2 = 0.2037299,
                                                             .p1 = 0.002219,
                                                             .p2 = 0.001383,
                                                             .k3 = -0.07233722,
                                                             .width = 1392,
                                                             .height = 512};

/// A rig like KITTI's before rectification: distorted, turned by a degree, shifted in all three axes.
inline cairn::StereoRig unrectified_rig() {
  const cairn::PinholeCamera left(unrectified_camera);
  const cairn::PinholeCamera right({.fx = 989.5,
                                    .fy = 987.8,
                                    .cx = 702,
                                    .cy = 245.5,
                                    .k1 = -0.3644661,
                                    .k2 = 0.1790019,
                                    .p1 = 0.0011489,
                                    .p2 = -0.000629,
                                    .k3 = -0.05314,
                                    .width = 1392,
                                    .height = 512});
  return {left, right,
          cairn::SE3(cairn::SO3::exp(cairn::Vector<3>(0.01, -0.02, 0.008)),
                     cairn::Vector<3>(0.537, 0.0048, -0.0124))};
}

/// A point that both cameras see, its depth uniform between the two given [m], left camera frame.
inline cairn::Vector<3> visible_point(const cairn::StereoRig& rig, cairn::Random& random, double nearest,
                                      double farthest) {
  for (;;) {
    const cairn::Vector<2> pixel(random.uniform(0, rig.left.width() - 1),
                                 random.uniform(0, rig.left.height() - 1));
    const auto ray = rig.left.unproject(pixel);
    if (!ray) continue;
    const cairn::Vector<3> p = *ray * random.uniform(nearest, farthest);
    const auto pixels = rig.project(p);
    if (pixels && rig.right.contains(pixels->tail<2>())) return p;
  }
}

inline cairn::SE3 random_pose(cairn::Random& random, double size = 1) {
  cairn::Vector<6> d;
  for (int i = 0; i < 6; ++i) d(i) = size * random.normal();
  return cairn::SE3::exp(d);
}

/// What random_matches() makes.
struct Scene {
  std::size_t matches = 150;
  double nearest = 1, farthest = 10;  ///< depths [m]
  double pixel_sigma = 0.5;
  double landmark_sigma = 0;  ///< isotropic error of the map's positions [m]
  double outliers = 0;        ///< share of matches whose landmark is another random point in view
};

/// Matches of a camera at T_world_camera.
inline std::vector<cairn::StereoMatch> random_matches(const cairn::StereoRig& rig,
                                                      const cairn::SE3& T_world_camera, const Scene& scene,
                                                      cairn::Random& random) {
  std::vector<cairn::StereoMatch> matches(scene.matches);
  for (cairn::StereoMatch& match : matches) {
    const cairn::Vector<3> p = visible_point(rig, random, scene.nearest, scene.farthest);
    cairn::Vector<4> pixels = *rig.project(p);
    match.landmark = T_world_camera * p;
    if (random.uniform() < scene.outliers)
      match.landmark = T_world_camera * visible_point(rig, random, scene.nearest, scene.farthest);
    for (int i = 0; i < 4; ++i) pixels(i) += random.normal(0, scene.pixel_sigma);
    for (int i = 0; i < 3; ++i) match.landmark(i) += random.normal(0, scene.landmark_sigma);
    match.covariance = cairn::Matrix<3>::Identity() * scene.landmark_sigma * scene.landmark_sigma;
    match.left = pixels.head<2>();
    match.right = pixels.tail<2>();
    match.sigma_left = match.sigma_right = std::max(scene.pixel_sigma, 1e-3);
  }
  return matches;
}

/// `rig` with its right camera turned by w [rad].
inline cairn::StereoRig turned(cairn::StereoRig rig, const cairn::Vector<3>& w) {
  rig.T_left_right = rig.T_left_right * cairn::SE3(cairn::SO3::exp(w), cairn::Vector<3>::Zero());
  return rig;
}

}  // namespace cairn_test
