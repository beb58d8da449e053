// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/manifold/jacobian.hpp>

#include "support/random.hpp"

namespace camera_test {
namespace {

using cairn::PinholeCamera;
using cairn::PinholeParameters;
using cairn::Vector;

/// An unrectified camera of KITTI, and the same with the opposite curvature.
const PinholeParameters barrel{.fx = 984.2,
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
const PinholeParameters cushion{
    .fx = 500, .fy = 520, .cx = 320, .cy = 240, .k1 = 0.2, .k2 = 0.05, .width = 640, .height = 480};

}  // namespace

TEST_SUITE("camera") {
  TEST_CASE("PinholeCamera: every pixel of the image finds its ray and comes back") {
    for (const PinholeParameters& parameters : {barrel, cushion}) {
      const PinholeCamera camera(parameters);
      double worst = 0;
      int missing = 0;
      for (int u = 0; u < camera.width(); u += 7)
        for (int v = 0; v < camera.height(); v += 7) {
          const auto ray = camera.unproject(Vector<2>(u, v));
          if (!ray) {
            ++missing;
            continue;
          }
          const auto pixel = camera.project(3.7 * *ray);
          REQUIRE(pixel.has_value());
          worst = std::max(worst, (*pixel - Vector<2>(u, v)).norm());
        }
      CHECK(missing == 0);
      CHECK(worst < 1e-11);
    }
  }

  TEST_CASE("PinholeCamera: agrees with the distortion written out for one point") {
    const PinholeCamera camera(barrel);
    const double x = 0.25, y = -0.1, r2 = x * x + y * y;
    const double radial = 1 + barrel.k1 * r2 + barrel.k2 * r2 * r2 + barrel.k3 * r2 * r2 * r2;
    const double xd = x * radial + 2 * barrel.p1 * x * y + barrel.p2 * (r2 + 2 * x * x);
    const double yd = y * radial + barrel.p1 * (r2 + 2 * y * y) + 2 * barrel.p2 * x * y;
    const auto pixel = camera.project(Vector<3>(x * 8, y * 8, 8));
    REQUIRE(pixel.has_value());
    CHECK((*pixel)(0) == doctest::Approx(barrel.fx * xd + barrel.cx).epsilon(1e-14));
    CHECK((*pixel)(1) == doctest::Approx(barrel.fy * yd + barrel.cy).epsilon(1e-14));
  }

  TEST_CASE("PinholeCamera: Jacobians agree with numeric differentiation") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const PinholeParameters& parameters : {barrel, cushion, PinholeParameters{.fx = 300, .fy = 310}}) {
      const PinholeCamera camera(parameters);
      for (int run = 0; run < 50; ++run) {
        const double z = random.uniform(0.5, 20);
        const Vector<3> p(random.uniform(-0.5, 0.5) * z, random.uniform(-0.3, 0.3) * z, z);
        const auto seen = camera.project_with_jacobian(p);
        REQUIRE(seen.has_value());
        CHECK(seen->pixel == *camera.project(p));
        const auto numeric =
            cairn::numeric_jacobian([&](const Vector<3>& x) { return *camera.project(x); }, p);
        CHECK((seen->J_point - numeric).norm() < 1e-6 * seen->J_point.norm());
        const auto back = camera.normalise_with_jacobian(seen->pixel);
        REQUIRE(back.has_value());
        const auto slope =
            cairn::numeric_jacobian([&](const Vector<2>& n) { return camera.distort(n); }, back->normalised);
        CHECK((back->J_pixel - slope).norm() < 1e-6 * slope.norm());
      }
    }
  }

  TEST_CASE("PinholeCamera: has no pixel for points behind it or beyond the fold of its distortion") {
    const PinholeCamera camera(PinholeParameters{.fx = 500, .fy = 500, .k1 = -0.4});
    CHECK_FALSE(camera.project(Vector<3>(0, 0, 0)).has_value());
    CHECK_FALSE(camera.project(Vector<3>(1, 1, -2)).has_value());
    CHECK_FALSE(camera.project(Vector<3>(0, 0, NAN)).has_value());
    // d(r (1 - 0.4 r^2))/dr = 0 at r^2 = 1 / 1.2
    const double fold = std::sqrt(1 / 1.2);
    CHECK(camera.project(Vector<3>(0.999 * fold, 0, 1)).has_value());
    CHECK_FALSE(camera.project(Vector<3>(1.001 * fold, 0, 1)).has_value());
    CHECK(camera.normalise(Vector<2>(500 * 0.99 * fold * 2 / 3, 0)).has_value());
    CHECK_FALSE(camera.normalise(Vector<2>(500 * 1.01 * fold * 2 / 3, 0)).has_value());
    CHECK_FALSE(camera.normalise(Vector<2>(NAN, 0)).has_value());
    CHECK_FALSE(camera.normalise(Vector<2>(1e300, 1e300)).has_value());
  }

  TEST_CASE("PinholeCamera: finds the first fold of a polynomial that recovers behind it") {
    // 1 - 0.9 s + 0.2 * 5 / 5 s^2 ... : slope 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3 with roots 1, 2 and 4 in s
    // (1 - s)(1 - s/2)(1 - s/4) = 1 - 7/4 s + 7/8 s^2 - 1/8 s^3
    const PinholeCamera camera(
        PinholeParameters{.fx = 1, .fy = 1, .k1 = -7.0 / 12, .k2 = 7.0 / 40, .k3 = -1.0 / 56});
    CHECK(camera.project(Vector<3>(std::sqrt(0.999), 0, 1)).has_value());
    CHECK_FALSE(camera.project(Vector<3>(std::sqrt(1.001), 0, 1)).has_value());
    CHECK_FALSE(camera.project(Vector<3>(std::sqrt(3.0), 0, 1)).has_value());
  }

  TEST_CASE("PinholeCamera: refuses parameters of no camera") {
    CHECK_THROWS_AS(PinholeCamera(PinholeParameters{.fx = 0}), cairn::Error);
    CHECK_THROWS_AS(PinholeCamera(PinholeParameters{.fx = 1, .fy = -1}), cairn::Error);
    CHECK_THROWS_AS(PinholeCamera(PinholeParameters{.cx = NAN}), cairn::Error);
    CHECK_THROWS_AS(PinholeCamera(PinholeParameters{.k2 = INFINITY}), cairn::Error);
    CHECK_THROWS_AS(PinholeCamera(PinholeParameters{.width = -1}), cairn::Error);
  }

  TEST_CASE("PinholeCamera: knows its image, with pixel centres at whole numbers") {
    const PinholeCamera camera(cushion);
    CHECK(camera.contains(Vector<2>(0, 0)));
    CHECK(camera.contains(Vector<2>(-0.4, -0.4)));
    CHECK_FALSE(camera.contains(Vector<2>(-0.6, 0)));
    CHECK(camera.contains(Vector<2>(639.4, 479.4)));
    CHECK_FALSE(camera.contains(Vector<2>(639.6, 0)));
    CHECK_FALSE(camera.contains(Vector<2>(0, 0), 10));
    CHECK_FALSE(camera.contains(Vector<2>(NAN, 0)));
    CHECK(PinholeCamera().contains(Vector<2>(1e6, -1e6)));
  }
}

}  // namespace camera_test
