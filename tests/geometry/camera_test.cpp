// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/manifold/derivatives.hpp>

#include "support/random.hpp"
#include "support/rigs.hpp"

namespace camera_test {
namespace {

using cairn::PinholeCamera;
using cairn::PinholeParameters;
using cairn::Vector;

/// A lens that draws inwards, and one with the opposite curvature.
constexpr PinholeParameters barrel = cairn_test::unrectified_camera;
const PinholeParameters cushion{
    .fx = 500, .fy = 520, .cx = 320, .cy = 240, .k1 = 0.2, .k2 = 0.05, .width = 640, .height = 480};

/// Lenses like those of EuRoC, most of which fold at the rim of the image or before it; every so manieth.
std::vector<PinholeParameters> folding_lenses(std::size_t every = 1) {
  std::vector<PinholeParameters> lenses;
  for (const double k1 : {-0.4, -0.35, -0.3, -0.25, -0.2})
    for (const double k2 : {-0.02, 0.0, 0.1})
      for (const double p1 : {-0.002, 0.0003})
        for (const double p2 : {-0.003, 0.0, 0.001})
          for (const double k3 : {0.0, -0.05})
            lenses.push_back({.fx = 458.654,
                              .fy = 457.296,
                              .cx = 367.215,
                              .cy = 248.375,
                              .k1 = k1,
                              .k2 = k2,
                              .p1 = p1,
                              .p2 = p2,
                              .k3 = k3,
                              .width = 752,
                              .height = 480});
  std::vector<PinholeParameters> some;
  for (std::size_t i = 0; i < lenses.size(); i += every) some.push_back(lenses[i]);
  return some;
}

/// (1) as it stands in Brown's paper, beside the camera's own code: pixels of a ray in long double.
struct Seen {
  long double u, v;
};
Seen seen(const PinholeParameters& lens, long double x, long double y) {
  const long double r2 = x * x + y * y;
  const long double radial = 1 + lens.k1 * r2 + lens.k2 * r2 * r2 + lens.k3 * r2 * r2 * r2;
  return {lens.fx * (x * radial + 2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x)) + lens.cx,
          lens.fy * (y * radial + lens.p1 * (r2 + 2 * y * y) + 2 * lens.p2 * x * y) + lens.cy};
}

/// How much the image of a small area around a ray is larger than the area, by differences; negative where
/// the image is turned over.
double magnification(const PinholeParameters& lens, double x, double y) {
  constexpr long double h = 1e-6L;
  const Seen right = seen(lens, x + h, y), left = seen(lens, x - h, y), below = seen(lens, x, y + h),
             above = seen(lens, x, y - h);
  return static_cast<double>(
      ((right.u - left.u) * (below.v - above.v) - (below.u - above.u) * (right.v - left.v)) / (4 * h * h));
}

/// Tangent of the smallest angle off the axis at which the image turns over, in steps of `step`.
double first_fold(const PinholeParameters& lens, double step) {
  constexpr int directions = 72;
  for (double r = step; r < 3; r += step)
    for (int i = 0; i < directions; ++i) {
      const double angle = 2 * std::numbers::pi * i / directions;
      if (!(magnification(lens, r * std::cos(angle), r * std::sin(angle)) > 0)) return r;
    }
  return 3;
}

/// The ray within `radius` whose pixel is nearest: all of a dense grid, then ever finer ones around the best.
struct Nearest {
  Vector<2> ray;
  double pixels;  ///< from the pixel
};
Nearest by_dense_search(const PinholeParameters& lens, double radius, const Vector<2>& pixel) {
  Nearest best{{0, 0}, std::numeric_limits<double>::infinity()};
  double step = radius / 40;
  const auto look_around = [&](const Vector<2>& centre, int steps) {
    for (int i = -steps; i <= steps; ++i)
      for (int j = -steps; j <= steps; ++j) {
        const Vector<2> ray(centre(0) + i * step, centre(1) + j * step);
        if (ray.norm() > radius) continue;
        const Seen image = seen(lens, ray(0), ray(1));
        const double off = static_cast<double>(std::hypot(image.u - pixel(0), image.v - pixel(1)));
        if (off < best.pixels) best = {ray, off};
      }
  };
  look_around({0, 0}, 40);
  while (step > 1e-12) {
    step /= 2;
    look_around(Vector<2>(best.ray), 5);
  }
  return best;
}

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
    CHECK_FALSE(PinholeCamera().project(Vector<3>(1, 1, 1e-310)).has_value());  // no pixel at infinity
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

  TEST_CASE("PinholeCamera: the ray of a pixel is the one that was projected there, over a grid of lenses") {
    int rays = 0, missing = 0;
    double worst = 0;
    for (const PinholeParameters& lens : folding_lenses()) {
      const PinholeCamera camera(lens);
      for (double x = -1.5; x <= 1.5; x += 0.013)
        for (double y = -1.2; y <= 1.2; y += 0.017) {
          const auto pixel = camera.project(Vector<3>(x, y, 1));
          if (!pixel) continue;
          ++rays;
          const auto ray = camera.normalise(*pixel);
          missing += !ray;
          if (ray) worst = std::max(worst, (*ray - Vector<2>(x, y)).norm());
        }
    }
    CHECK(rays > 1000000);
    CHECK(missing == 0);
    CHECK(worst < 1e-9);
  }

  TEST_CASE("PinholeCamera: a pixel has the ray that a dense search finds before the fold, or none") {
    int found = 0, none = 0;
    for (const PinholeParameters& lens : folding_lenses(7)) {
      const PinholeCamera camera(lens);
      const double fold = first_fold(lens, 0.002);
      CAPTURE(lens.k1);
      CAPTURE(lens.k2);
      CAPTURE(lens.k3);
      CAPTURE(lens.p1);
      CAPTURE(lens.p2);
      for (int u = -40; u < 840; u += 83)
        for (int v = -40; v < 560; v += 79) {
          CAPTURE(u);
          CAPTURE(v);
          const Nearest nearest = by_dense_search(lens, 1.01 * fold, Vector<2>(u, v));
          const auto ray = camera.normalise(Vector<2>(u, v));
          if (nearest.pixels < 1e-6 && nearest.ray.norm() < 0.98 * fold) {
            ++found;
            REQUIRE(ray.has_value());
            CHECK((*ray - nearest.ray).norm() < 1e-7);
          } else if (nearest.pixels > 0.1 && fold < 3) {
            ++none;
            CHECK_FALSE(ray.has_value());
          }
          if (ray) {
            const auto back = camera.project(Vector<3>((*ray)(0), (*ray)(1), 1));
            REQUIRE(back.has_value());
            CHECK((*back - Vector<2>(u, v)).norm() < 1e-9);
          }
        }
    }
    CHECK(found > 700);
    CHECK(none > 70);
  }

  TEST_CASE("PinholeCamera: no ray from the first fold on has a pixel, every ray well before it has one") {
    for (const PinholeParameters& lens : folding_lenses(5)) {
      const PinholeCamera camera(lens);
      const double fold = first_fold(lens, 0.0005);
      CAPTURE(lens.k1);
      CAPTURE(lens.k2);
      CAPTURE(lens.k3);
      CAPTURE(lens.p1);
      CAPTURE(lens.p2);
      for (int i = 0; i < 90; ++i) {
        const Vector<2> direction(std::cos(i * std::numbers::pi / 45), std::sin(i * std::numbers::pi / 45));
        bool folded = false;
        for (double r = 0.01; r < 3; r += 0.01) {
          const Vector<2> n = r * direction;
          folded = folded || !(magnification(lens, n(0), n(1)) > 0);
          const bool taken = camera.project(Vector<3>(n(0), n(1), 1)).has_value();
          if (folded) CHECK_FALSE(taken);
          if (r < 0.99 * fold) CHECK(taken);
          CHECK(taken == camera.project_with_jacobian(Vector<3>(n(0), n(1), 1)).has_value());
        }
      }
    }
  }

  TEST_CASE("PinholeCamera: lenses of any numbers are defined somewhere, and rays there find back") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    int rays = 0;
    for (int run = 0; run < 4000; ++run) {
      const auto any = [&](double largest) {
        return random.below(4) == 0 ? 0.0 : random.normal() * std::pow(10.0, random.uniform(-4, largest));
      };
      const PinholeParameters lens{.fx = 400,
                                   .fy = 300,
                                   .cx = 320,
                                   .cy = 240,
                                   .k1 = any(1),
                                   .k2 = any(2),
                                   .p1 = any(0),
                                   .p2 = any(0),
                                   .k3 = any(3)};
      CAPTURE(lens.k1);
      CAPTURE(lens.k2);
      CAPTURE(lens.k3);
      CAPTURE(lens.p1);
      CAPTURE(lens.p2);
      const PinholeCamera camera(lens);
      CHECK(camera.normalise(Vector<2>(320, 240)).has_value());
      for (int i = 0; i < 20; ++i) {
        const double r = std::pow(10.0, random.uniform(-3, 1)), angle = random.uniform(0, 6.283);
        const Vector<2> n(r * std::cos(angle), r * std::sin(angle));
        const auto pixel = camera.project(Vector<3>(n(0), n(1), 1));
        if (!pixel) continue;
        ++rays;
        const auto back = camera.normalise(*pixel);
        REQUIRE(back.has_value());
        CHECK((*back - n).norm() < 1e-9 * (1 + r));
      }
    }
    CHECK(rays > 20000);
    for (const double huge : {1e100, 1e200, 1e300})
      for (const double sign : {-1.0, 1.0}) {
        const PinholeCamera camera(PinholeParameters{
            .k1 = sign * huge, .k2 = huge, .p1 = -sign * huge, .p2 = huge, .k3 = sign * huge});
        CHECK(camera.normalise(Vector<2>(0, 0)).has_value());
        CHECK_FALSE(camera.project(Vector<3>(1, 1, 1)).has_value());
        static_cast<void>(camera.normalise(Vector<2>(1e300, -1e300)));
        static_cast<void>(camera.normalise(Vector<2>(0.3, 0.1)));
      }
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
