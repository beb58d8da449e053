// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "surface_patch.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/geometry/camera.hpp>
#include <cairn/manifold/se3.hpp>

#include "support/random.hpp"

namespace surface_patch_test {
namespace {

using cairn::SE3;
using cairn::SO3;
using stereo_slam::SurfacePatch;
using Point = cairn::Vector<3>;

constexpr int width = 320, height = 240;

cairn::PinholeCamera camera() {
  return cairn::PinholeCamera(
      {.fx = 400, .fy = 405, .cx = 160, .cy = 120, .k1 = -0.1, .width = width, .height = height});
}

/// A plane in the coordinates of the first camera: normal . x = distance.
struct Plane {
  Point normal = Point(0.1, -0.8, -0.6).normalized();
  double distance = -1;
  [[nodiscard]] Point meet(const Point& eye, const Point& ray) const {
    return eye + (distance - normal.dot(eye)) / normal.dot(ray) * ray;
  }
};

/// What is painted on it, smooth enough for the pixels of all the cameras here.
double paint(const Point& x) {
  return 120 + 40 * std::sin(90 * x(0) + 30 * x(2)) + 30 * std::cos(60 * x(0) - 70 * x(2)) +
         25 * std::sin(110 * x(2));
}

/// The grey levels that a ray through each pixel's centre meets; no filter, hence no shift by one.
cairn::Image picture(const SE3& T_first_camera, double gain, double offset) {
  const Plane plane;
  cairn::Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto ray = camera().unproject({x, y});
      REQUIRE(ray);
      const Point seen = plane.meet(T_first_camera.translation(), T_first_camera.rotation() * *ray);
      image(x, y) = static_cast<std::uint8_t>(std::clamp(std::lround(gain * paint(seen) + offset), 0L, 255L));
    }
  return image;
}

/// Depth of the plane in the first camera.
double depth(const cairn::Vector<2>& pixel) {
  return Plane().meet(Point::Zero(), *camera().unproject(pixel))(2);
}

cairn::Vector<2> slope(const cairn::Vector<2>& pixel) {
  const double here = depth(pixel);
  return {here / depth(pixel + cairn::Vector<2>(1, 0)) - 1, here / depth(pixel + cairn::Vector<2>(0, 1)) - 1};
}

const SE3& moved() {  // nearer by a fifth, turned about every axis
  static const SE3 pose(SO3::exp({0.03, -0.05, 0.08}), {0.03, -0.02, 0.25});
  return pose;
}

}  // namespace

TEST_SUITE("surface_patch") {
  TEST_CASE("find_patch: finds pieces of a slanted plane from nearer by where the plane has them") {
    const std::uint64_t seed = cairn_test::seed(4);
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::Image first = picture(SE3(), 1, 0), second = picture(moved(), 0.8, 15);
    int count = 0;
    cairn::Vector<2> sum = cairn::Vector<2>::Zero(), squares = sum;
    for (int i = 0; i < 300; ++i) {
      const cairn::Vector<2> pixel(random.uniform(20, width - 20), random.uniform(60, height - 20));
      const auto patch = SurfacePatch::of(first, pixel, slope(pixel), 0);
      REQUIRE(patch);
      const Point seen = depth(pixel) * *camera().unproject(pixel);
      const auto truth = camera().project(moved().inverse() * seen);
      if (!truth || !camera().contains(*truth, 15)) continue;
      const cairn::Vector<2> start = *truth + cairn::Vector<2>(random.uniform(-1, 1), random.uniform(-1, 1));
      const auto found =
          stereo_slam::find_patch(*patch, camera(), moved().inverse(), 1 / depth(pixel), second, start);
      if (!found) continue;
      ++count;
      const cairn::Vector<2> off = found->pixel - *truth;
      CHECK(off.norm() < 0.2);
      CHECK(found->correlation > 0.97);
      sum += off;
      squares += off.cwiseProduct(off);
    }
    REQUIRE(count > 100);
    for (int k = 0; k < 2; ++k) {
      const double sigma = std::sqrt(squares(k) / count);
      CHECK(sigma < 0.04);
      CHECK(std::abs(sum(k) / count) < 0.01);  // no drift: a point is the same from everywhere
    }
  }

  TEST_CASE("find_patch: without the slope of the surface the patch is found beside itself") {
    const cairn::Image first = picture(SE3(), 1, 0), second = picture(moved(), 1, 0);
    double with = 0, without = 0;
    int count = 0;
    for (int x = 30; x < width - 30; x += 12) {
      const cairn::Vector<2> pixel(x, 150);
      const Point seen = depth(pixel) * *camera().unproject(pixel);
      const auto truth = camera().project(moved().inverse() * seen);
      if (!truth || !camera().contains(*truth, 15)) continue;
      const auto find = [&](const cairn::Vector<2>& at_slope) {
        return stereo_slam::find_patch(*SurfacePatch::of(first, pixel, at_slope, 0), camera(),
                                       moved().inverse(), 1 / depth(pixel), second, *truth);
      };
      const auto right = find(slope(pixel)), wrong = find({0, 0});
      if (!right || !wrong) continue;
      ++count;
      with += (right->pixel - *truth).norm();
      without += (wrong->pixel - *truth).norm();
    }
    REQUIRE(count > 8);
    CHECK(with < 0.5 * without);
  }

  TEST_CASE("find_patch: has no answer where the images have none") {
    const cairn::Image first = picture(SE3(), 1, 0);
    const cairn::Vector<2> pixel(160, 150);
    const double inverse_depth = 1 / depth(pixel);
    const SurfacePatch patch = *SurfacePatch::of(first, pixel, slope(pixel), 0);
    const auto find = [&](const SurfacePatch& what, const SE3& T, cairn::ImageView image,
                          const cairn::Vector<2>& start) {
      return stereo_slam::find_patch(what, camera(), T, inverse_depth, image, start);
    };
    REQUIRE(find(patch, SE3(), first, pixel));
    CHECK((find(patch, SE3(), first, pixel)->pixel - pixel).norm() < 0.01);
    CHECK_FALSE(find(patch, SE3(), cairn::Image(width, height, 90), pixel));             // nothing there
    CHECK_FALSE(find(patch, SE3(), cairn::Image(40, 30, 90), pixel));                    // outside
    CHECK_FALSE(find(patch, SE3(), first, {170, 150}));                                  // too far away
    CHECK_FALSE(find(patch, SE3(SO3(), Point(0, 0, -100)), first, pixel));               // behind the camera
    CHECK_FALSE(find(patch, SE3(SO3::exp({0, 3.1, 0}), Point(0, 0, 0)), first, pixel));  // looks away
    const SurfacePatch flat = *SurfacePatch::of(cairn::Image(width, height, 90), pixel, {0, 0}, 0);
    CHECK_FALSE(find(flat, SE3(), first, pixel));
    // Stripes show no place along themselves.
    cairn::Image stripes(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        stripes(x, y) = static_cast<std::uint8_t>(128 + 100 * std::sin(0.7 * x));
    CHECK_FALSE(find(*SurfacePatch::of(stripes, pixel, {0, 0}, 0), SE3(), stripes, pixel));
    // On its edge: a camera in the plane that looks at the place. Every pixel of the patch lies on one line.
    const Point eye = -Plane().normal;
    const Point to = depth(pixel) * *camera().unproject(pixel) - eye;
    const SE3 on_edge(SO3::exp({-std::atan2(to(1), to(2)), 0, 0}), eye);
    const auto there = camera().project(on_edge.inverse() * (eye + to));
    REQUIRE(there);
    REQUIRE(camera().contains(*there, 20));
    CHECK_FALSE(find(patch, on_edge.inverse(), first, *there));
  }

  TEST_CASE("find_patch: numbers that are none give no answer") {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = HUGE_VAL;
    const cairn::Image first = picture(SE3(), 1, 0);
    const cairn::Vector<2> pixel(160, 150);
    const SurfacePatch patch = *SurfacePatch::of(first, pixel, slope(pixel), 0);
    for (const double bad : {nan, infinity, -infinity, 1e300}) {
      CAPTURE(bad);
      CHECK_FALSE(SurfacePatch::of(first, {bad, 100}, {0, 0}, 0));
      CHECK_FALSE(SurfacePatch::of(first, {100, bad}, {0, 0}, 0));
      CHECK_FALSE(stereo_slam::find_patch(patch, camera(), SE3(), 1, first, {bad, 150}));
      const SE3 gone(SO3(), Point(bad, 0, 0));
      CHECK_FALSE(stereo_slam::find_patch(patch, camera(), gone, 1, first, pixel));
      CHECK_FALSE(stereo_slam::find_patch(patch, camera(), moved().inverse(), bad, first, pixel));
      SurfacePatch steep = patch;
      steep.slope(1) = bad;
      CHECK_FALSE(stereo_slam::find_patch(steep, camera(), moved().inverse(), 1, first, pixel));
      steep.pixel(0) = bad;
      CHECK_FALSE(stereo_slam::find_patch(steep, camera(), SE3(), 1, first, pixel));
    }
  }

  TEST_CASE("surface_patch: reaches up to the rim of its image, and no farther") {
    const cairn::Image image(width, height, 90);
    const auto fits = [&](double x, double y) {
      return SurfacePatch::of(image, {x, y}, {0, 0}, 0).has_value();
    };
    constexpr int before = SurfacePatch::half + 1, after = SurfacePatch::half + 2;
    CHECK(fits(before, before));
    CHECK(fits(width - after - 0.01, height - after - 0.01));
    CHECK_FALSE(fits(before - 0.01, 100));
    CHECK_FALSE(fits(100, before - 0.01));
    CHECK_FALSE(fits(width - after, 100));
    CHECK_FALSE(fits(100, height - after));
    CHECK_FALSE(SurfacePatch::of(cairn::Image(5, 5), {2, 2}, {0, 0}, 0));
    CHECK_FALSE(SurfacePatch::of({}, {0, 0}, {0, 0}, 0));
  }
}

}  // namespace surface_patch_test
