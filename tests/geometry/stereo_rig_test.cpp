// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/derivatives.hpp>

#include "support/random.hpp"
#include "support/rigs.hpp"

using cairn::SE3;
using cairn::SO3;
using cairn::StereoRig;
using cairn::Vector;

TEST_SUITE("stereo_rig") {
  TEST_CASE("StereoRig: projects like two cameras, with the Jacobian of both") {
    const StereoRig rig = cairn_test::unrectified_rig();
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (int run = 0; run < 100; ++run) {
      const Vector<3> p = cairn_test::visible_point(rig, random, 1, 30);
      const auto pixels = rig.project(p);
      REQUIRE(pixels.has_value());
      CHECK((pixels->head<2>() - *rig.left.project(p)).norm() == 0.0);
      CHECK((pixels->tail<2>() - *rig.right.project(rig.T_left_right.inverse() * p)).norm() == 0.0);
      const auto derivative = rig.project_with_jacobian(p);
      REQUIRE(derivative.has_value());
      CHECK((derivative->pixels - *pixels).norm() < 1e-10);
      const auto numeric = cairn::numeric_jacobian([&](const Vector<3>& x) { return *rig.project(x); }, p);
      CHECK((derivative->J_point - numeric).norm() < 1e-6 * numeric.norm());
      CHECK(std::abs(*cairn::epipolar_distance(rig, pixels->head<2>(), pixels->tail<2>())) < 1e-10);
    }
    CHECK_FALSE(rig.project(Vector<3>(0, 0, -1)).has_value());
    CHECK_FALSE(rig.project_with_jacobian(Vector<3>(0, 0, 0)).has_value());
  }

  TEST_CASE("EpipolarConstraint: is the vertical disparity of a rectified rig") {
    const StereoRig rig = cairn_test::rectified_rig();
    CHECK(std::abs(*cairn::epipolar_distance(rig, {100, 203}, {80, 200})) ==
          doctest::Approx(3).epsilon(1e-12));
    CHECK(*cairn::epipolar_distance(rig, {100, 200}, {700, 200}) == doctest::Approx(0));
    CHECK_FALSE(cairn::epipolar_distance(rig, {NAN, 0}, {0, 0}).has_value());
  }

  TEST_CASE("EpipolarConstraint: pixel noise gives standardised residuals of variance one") {
    const StereoRig rig = cairn_test::unrectified_rig();
    const cairn::EpipolarConstraint constraint(rig);
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    cairn::RunningMoments standardised, distance;
    const double left_sigma = 0.3, right_sigma = 0.6;
    for (int run = 0; run < 4000; ++run) {
      Vector<4> x = *rig.project(cairn_test::visible_point(rig, random, 2, 40));
      for (int i = 0; i < 4; ++i) x(i) += random.normal(0, i < 2 ? left_sigma : right_sigma);
      const Vector<2> l = *rig.left.normalise(x.head<2>()), r = *rig.right.normalise(x.tail<2>());
      standardised.add(constraint.standardised(l, r, left_sigma, right_sigma));
      distance.add(constraint.distance(l, r));
    }
    CHECK(standardised.mean() == doctest::Approx(0).epsilon(0.05));
    // the gradient leaves lens distortion out, which moves this by some percent
    CHECK(standardised.standard_deviation() == doctest::Approx(1).epsilon(0.08));
    CHECK(distance.standard_deviation() ==
          doctest::Approx(std::hypot(left_sigma, right_sigma)).epsilon(0.1).scale(0));
  }

  TEST_CASE("StereoRig: tells rectified rigs from others") {
    CHECK(cairn_test::rectified_rig().rectified());
    CHECK_FALSE(cairn_test::unrectified_rig().rectified());
    StereoRig turned = cairn_test::rectified_rig();
    turned.T_left_right = SE3(SO3::exp(Vector<3>(1e-3, 0, 0)), turned.T_left_right.translation());
    CHECK_FALSE(turned.rectified());
    StereoRig swapped = cairn_test::rectified_rig();
    swapped.T_left_right = SE3(SO3(), -swapped.T_left_right.translation());
    CHECK_FALSE(swapped.rectified());
    StereoRig shifted = cairn_test::rectified_rig();
    auto parameters = shifted.right.parameters();
    parameters.cy += 1;
    shifted.right = cairn::PinholeCamera(parameters);
    CHECK_FALSE(shifted.rectified());
    parameters.cy -= 1;
    parameters.cx += 20;  // a horizontal shift of the principal point keeps rows
    shifted.right = cairn::PinholeCamera(parameters);
    CHECK(shifted.rectified());
  }
}
