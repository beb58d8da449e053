// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/triangulation.hpp>

#include "support/elimination.hpp"
#include "support/random.hpp"
#include "support/rigs.hpp"

namespace triangulation_test {
namespace {

using cairn::Triangulation;
using cairn::TriangulationMethod;
using cairn::TriangulationStatus;
using cairn::Triangulator;
using cairn::Vector;

constexpr TriangulationMethod methods[] = {
    TriangulationMethod::midpoint, TriangulationMethod::weighted_midpoint, TriangulationMethod::gauss_newton};

}  // namespace

TEST_SUITE("triangulation") {
  TEST_CASE("triangulate: exact pixels of a distorted, turned rig give the point back") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const cairn::StereoRig& rig : {cairn_test::unrectified_rig(), cairn_test::rectified_rig()})
      for (const TriangulationMethod method : methods)
        for (int run = 0; run < 100; ++run) {
          const Vector<3> p = cairn_test::visible_point(rig, random, 1, 20);
          const Vector<4> x = *rig.project(p);
          const Triangulation t = cairn::triangulate(rig, x.head<2>(), x.tail<2>(), {.method = method});
          CHECK(t.good());
          CHECK((t.point - p).norm() < 1e-10 * p.squaredNorm());
          CHECK(std::abs(t.gap) < 1e-9);
        }
  }

  TEST_CASE("triangulate: on a rectified rig the depth is f b / d and sigma_z = z^2 sigma_d / (f b)") {
    const cairn::StereoRig rig = cairn_test::rectified_rig();
    const double f = 1055, b = 0.2, z = 5, d = f * b / z, sigma = 0.5;
    for (const TriangulationMethod method : methods) {
      const Triangulation t =
          cairn::triangulate(rig, {383.5 + d / 2, 287.5}, {383.5 - d / 2, 287.5},
                             {.method = method, .sigma_left = sigma, .sigma_right = sigma});
      CHECK(t.point(2) == doctest::Approx(z).epsilon(1e-12));
      CHECK(std::sqrt(t.covariance(2, 2)) ==
            doctest::Approx(z * z * sigma * std::sqrt(2) / (f * b)).epsilon(1e-3).scale(0));
    }
  }

  TEST_CASE("triangulate: covariance passes the Monte Carlo test for every method and depth") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::StereoRig rig = cairn_test::unrectified_rig();
    const double left = 0.15, right = 0.25;
    for (const TriangulationMethod method : methods)
      for (const double depth : {2.0, 8.0, 25.0}) {
        CAPTURE(depth);
        CAPTURE(static_cast<int>(method));
        const Triangulator triangulator(
            rig, {.method = method, .sigma_left = left, .sigma_right = right, .max_gap = 1e3});
        constexpr int runs = 2000;
        double nees = 0;
        cairn::RunningMoments gaps;
        for (int run = 0; run < runs; ++run) {
          const Vector<3> p = cairn_test::visible_point(rig, random, depth, 1.2 * depth);
          Vector<4> x = *rig.project(p);
          for (int i = 0; i < 4; ++i) x(i) += random.normal(0, i < 2 ? left : right);
          const Triangulation t = triangulator(x.head<2>(), x.tail<2>());
          REQUIRE(t.good());
          const Vector<3> error = t.point - p;
          nees += cairn_test::normalised_square(t.covariance, error) / runs;
          gaps.add(t.gap);
        }
        CHECK(cairn::chi_square_mean_band(3, runs, cairn_test::almost_sure).contains(nees));
        CHECK(gaps.standard_deviation() == doctest::Approx(1).epsilon(0.1));
      }
  }

  TEST_CASE("triangulate: one Gauss-Newton step is closer than midpoints where the cameras differ in depth") {
    cairn::StereoRig rig = cairn_test::rectified_rig();
    rig.T_left_right = cairn::SE3(cairn::SO3(), Vector<3>(0.3, 0, 1.5));  // the right camera stands ahead
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    std::vector<double> errors[3];  // medians: a few points near the epipole would rule a mean
    int nearer = 0;                 // by its weights, of the same pixels: the medians differ by a thousandth
    for (int run = 0; run < 3000; ++run) {
      const Vector<3> p = cairn_test::visible_point(rig, random, 2.5, 4);
      Vector<4> x = *rig.project(p);
      for (int i = 0; i < 4; ++i) x(i) += random.normal(0, 0.5);
      for (int m = 0; m < 3; ++m) {
        const Triangulation t =
            cairn::triangulate(rig, x.head<2>(), x.tail<2>(), {.method = methods[m], .max_gap = 100});
        if (t.good()) errors[m].push_back((t.point - p).norm());
      }
      nearer += errors[1].back() < errors[0].back() ? 1 : 0;
    }
    CHECK(nearer > 0.55 * 3000);  // 0.64; one standard deviation is 0.009
    CHECK(cairn::median(errors[2]) < 1.02 * cairn::median(errors[1]));
  }

  TEST_CASE(
      "triangulate: the covariance of midpoints is that of numeric derivatives, also for rays that miss") {
    const cairn::StereoRig rig = cairn_test::unrectified_rig();
    cairn::Random random(cairn_test::seed());
    for (const TriangulationMethod method :
         {TriangulationMethod::midpoint, TriangulationMethod::weighted_midpoint})
      for (int run = 0; run < 20; ++run) {
        Vector<4> x = *rig.project(cairn_test::visible_point(rig, random, 1, 3));
        x(3) += 40;  // pixels: the rays pass each other far off
        const cairn::TriangulationOptions options{
            .method = method, .sigma_left = 0.5, .sigma_right = 1.5, .max_gap = 1e9};
        const auto point = [&](const Vector<4>& at) {
          return cairn::triangulate(rig, at.head<2>(), at.tail<2>(), options).point;
        };
        cairn::Matrix<3> covariance = cairn::Matrix<3>::Zero();
        for (int k = 0; k < 4; ++k) {
          Vector<4> up = x, down = x;
          up(k) += 1e-3;
          down(k) -= 1e-3;
          const Vector<3> column = (k < 2 ? 0.5 : 1.5) * (point(up) - point(down)) / 2e-3;
          covariance += column * column.transpose();
        }
        const Triangulation t = cairn::triangulate(rig, x.head<2>(), x.tail<2>(), options);
        REQUIRE(t.good());
        CHECK((t.covariance - covariance).norm() < 1e-5 * covariance.norm());
      }
  }

  TEST_CASE("triangulate: a point in front of one camera and behind the other is none") {
    // The right camera looks back past the left one: what lies ahead of the left has a line, but no ray,
    // there.
    const cairn::PinholeCamera camera;
    const cairn::StereoRig rig{camera, camera, cairn::SE3(cairn::SO3::exp({0, 2.5, 0}), {1, 0, 0})};
    const Vector<3> p(0.5, 0.1, 4), q = rig.T_left_right.inverse() * p;
    REQUIRE(q(2) < 0);
    for (const TriangulationMethod method : methods)
      CHECK(
          cairn::triangulate(rig, {p(0) / p(2), p(1) / p(2)}, {q(0) / q(2), q(1) / q(2)}, {.method = method})
              .status == TriangulationStatus::behind);
  }

  TEST_CASE("triangulate: says why there is no point") {
    const cairn::StereoRig rig = cairn_test::rectified_rig();
    const auto status = [&](const Vector<2>& left, const Vector<2>& right) {
      const Triangulation t = cairn::triangulate(rig, left, right);
      CHECK(t.point.allFinite());
      CHECK(t.covariance.allFinite());
      return t.status;
    };
    CHECK(status({400, 200}, {400, 200}) == TriangulationStatus::parallel);
    CHECK(status({400, 200}, {399, 200}) == TriangulationStatus::parallel);
    CHECK(status({400, 200}, {460, 200}) == TriangulationStatus::behind);
    CHECK(status({400, 200}, {360, 230}) == TriangulationStatus::gap_too_large);
    CHECK(status({NAN, 200}, {360, 230}) == TriangulationStatus::no_ray);
    CHECK(status({400, 200}, {1e308, INFINITY}) == TriangulationStatus::no_ray);
    CHECK(status({400, 200}, {360, 200}) == TriangulationStatus::good);
    CHECK(cairn::triangulate(rig, {400, 200}, {360, 200}, {.max_depth = 2}).status ==
          TriangulationStatus::behind);
    CHECK(cairn::triangulate(rig, {400, 200}, {360, 200}, {.min_depth = 9}).status ==
          TriangulationStatus::behind);
  }

  TEST_CASE("triangulate: never gives anything but finite numbers, whatever the pixels") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const cairn::StereoRig& rig : {cairn_test::unrectified_rig(), cairn_test::rectified_rig()})
      for (int run = 0; run < 20000; ++run) {
        const double size = std::pow(10, random.uniform(0, 8));
        const Vector<2> l(random.normal() * size, random.normal() * size),
            r(random.normal() * size, random.normal() * size);
        const Triangulation t = cairn::triangulate(rig, l, r, {.method = methods[run % 3], .max_gap = 1e12});
        if (!(t.point.allFinite() && t.covariance.allFinite() && std::isfinite(t.gap))) FAIL("run ", run);
      }
  }
}

}  // namespace triangulation_test
