// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#ifdef GAMMA_SLAM_HAS_RECORDINGS
#include "ground_stereo.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/geometry/stereo_rig.hpp>

#include "recorded_drive.hpp"
#include "run.hpp"
#include "support/data.hpp"

namespace ground_stereo_test {
namespace {

using namespace cairn;
using namespace gamma_slam;

constexpr double height = 1.5, tilt = 0.12, roll = 0.03;  // [m], [rad]
constexpr double box_near = 5, box_far = 8, box_right = -1.5, box_left = 1.5, box_height = 0.3;

/// Grey levels of the ground and of the box on it, as a function of a place.
double grey_at(double x, double y, double z) {
  const auto wave = [](double a, double b, double k) {
    return std::sin(k * a + 1.7 * std::sin(0.8 * k * b));
  };
  return 128 + 30 * wave(x, y, 9) + 25 * wave(y, x, 14) + 20 * wave(x + y, x - y, 6) +
         20 * wave(z, x + y, 20);
}

/// What a camera at a pose in the world (x ahead, y to the left, z up) sees.
Image seen(const PinholeCamera& camera, const SE3& T_world_camera) {
  Image image(camera.width(), camera.height(), 0);
  for (int v = 0; v < camera.height(); ++v)
    for (int u = 0; u < camera.width(); ++u) {
      const Vector<3> ray = T_world_camera.rotation().rotate(*camera.unproject({double(u), double(v)}));
      const Vector<3> from = T_world_camera.translation();
      double nearest = 60;
      const auto meet = [&](double t, bool inside) {
        nearest = t > 0 && inside ? std::min(nearest, t) : nearest;
      };
      if (ray(2) < 0) meet(-from(2) / ray(2), true);
      const double top = (box_height - from(2)) / ray(2), front = (box_near - from(0)) / ray(0);
      const Vector<3> on_top = from + top * ray, on_front = from + front * ray;
      meet(top, on_top(0) > box_near && on_top(0) < box_far && on_top(1) > box_right && on_top(1) < box_left);
      meet(front,
           on_front(2) < box_height && on_front(2) > 0 && on_front(1) > box_right && on_front(1) < box_left);
      const Vector<3> p = from + nearest * ray;
      image(u, v) = static_cast<std::uint8_t>(std::clamp(grey_at(p(0), p(1), p(2)), 0.0, 255.0));
    }
  return image;
}

}  // namespace

TEST_SUITE("gamma_slam/ground_stereo") {
  TEST_CASE(
      "ground_stereo: a plane and a box on it have the heights that they were drawn with, for a rig that "
      "is not rectified") {
    const PinholeCamera camera(
        {.fx = 420, .fy = 420, .cx = 318, .cy = 182, .k1 = -0.1, .width = 640, .height = 360});
    const StereoRig rig{camera, camera,
                        SE3(SO3::exp(Vector<3>(0.01, -0.015, 0.008)), Vector<3>(0.4, 0.005, -0.004))};
    Matrix<3> axes;
    axes << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    const SE3 T_world_left(SO3::from_matrix(axes) * SO3::exp(Vector<3>(-tilt, 0, roll)),
                           Vector<3>(0, 0, height));
    const auto view =
        GroundStereo(rig)(seen(rig.left, T_world_left), seen(rig.right, T_world_left * rig.T_left_right), 1);
    REQUIRE(view);
    CHECK(view->camera_height == doctest::Approx(height).epsilon(0.02).scale(0));
    const Vector<3> up = T_world_left.rotation().inverse().rotate(Vector<3>(0, 0, 1));
    CHECK(view->R_level_camera.rotate(up)(2) > std::cos(0.01));
    std::size_t ground = 0, right_ground = 0, box = 0, right_box = 0;
    for (const GroundPoint& p : view->points) {
      const bool above = p.x > box_near + 0.3 && p.x < box_far - 0.3 && std::abs(p.y) < box_left - 0.3;
      const bool beside = p.x < box_near - 0.5 || std::abs(p.y) > box_left + 0.7;
      if (above) {
        ++box;
        right_box += std::abs(p.height - box_height) < 0.05;
      } else if (beside) {
        ++ground;
        right_ground += std::abs(p.height) < 0.05;
      }
    }
    CHECK(ground > 1000);
    CHECK(box > 50);
    CHECK(static_cast<double>(right_ground) > 0.95 * static_cast<double>(ground));
    CHECK(static_cast<double>(right_box) > 0.9 * static_cast<double>(box));
  }

  TEST_CASE("ground_stereo: sky has no ground, and cameras one behind the other no rows") {
    const PinholeCamera camera({.fx = 420, .fy = 420, .cx = 320, .cy = 180, .width = 640, .height = 360});
    const StereoRig rig{camera, camera, SE3(SO3(), Vector<3>(0.4, 0, 0))};
    const Image grey(640, 360, 128);
    CHECK_FALSE(GroundStereo(rig)(grey, grey, 1));
    const StereoRig behind{camera, camera, SE3(SO3(), Vector<3>(0, 0, 0.4))};
    CHECK_THROWS_AS(GroundStereo{behind}, Error);
  }

  TEST_CASE(
      "recorded_drive: a real street there and back ends nearer its start than odometry does, the same for "
      "any number of threads") {
    const auto folder = cairn_test::real_data("kitti_raw_0926");
    if (!folder) return;
    const auto with = [&](unsigned threads) {
      const RecordedDriveOptions options{
          .folder = *folder, .frames = 16, .seed = 2, .threads = threads, .noise = {0.1, 0.05, 1}};
      const Drive drive = recorded_drive(*opened_recording(options), options);
      return run(drive, {.particles = 40, .threads = threads});
    };
    const Results one = with(1), two = with(2);
    CHECK(one.scans == 31);
    CHECK_FALSE(one.true_map);
    CHECK(one.filter_end_error() < 0.25);
    CHECK(one.filter_end_error() < 0.5 * one.odometry_end_error());
    CHECK(one.filter_map.image == two.filter_map.image);
    REQUIRE(one.path.size() == two.path.size());
    for (std::size_t i = 0; i < one.path.size(); ++i) CHECK(local(one.path[i], two.path[i]).isZero(0));
  }
}

}  // namespace ground_stereo_test
#endif
