// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <cairn/core/linalg.hpp>
#include <cairn/core/random.hpp>
#include <cairn/geometry/rig_correction.hpp>
#include <cairn/slam/detail/whitened_sighting.hpp>

#include "support/random.hpp"
#include "support/violation.hpp"

namespace {

using cairn::Matrix;
using cairn::RigState;
using cairn::SE3;
using cairn::StereoRig;
using cairn::Vector;

/// Two lenses that differ, cameras that look past each other.
StereoRig rig() {
  const cairn::PinholeCamera left({.fx = 460,
                                   .fy = 457,
                                   .cx = 366,
                                   .cy = 249,
                                   .k1 = -0.28,
                                   .k2 = 0.07,
                                   .p1 = 2e-4,
                                   .p2 = 2e-5,
                                   .width = 752,
                                   .height = 480});
  const cairn::PinholeCamera right(
      {.fx = 455, .fy = 456, .cx = 380, .cy = 255, .k1 = -0.27, .k2 = 0.06, .width = 752, .height = 480});
  return {left, right, SE3(cairn::SO3::exp(Vector<3>(0.01, -0.02, 0.005)), Vector<3>(0.11, 0.002, -0.001))};
}

}  // namespace

TEST_SUITE("rig_correction") {
  TEST_CASE("rig_correction: a rig gives back the five numbers that it was made of") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::RigCorrection correction(rig());
    for (const double size : {1e-6, 1e-3, 0.3})
      for (int run = 0; run < 20; ++run) {
        Vector<5> state;
        for (int i = 0; i < 5; ++i) state(i) = random.uniform(-size, size);
        StereoRig off = correction.rig(state);
        off.T_left_right = SE3(off.T_left_right.rotation(), 1.7 * off.T_left_right.translation());
        CHECK((correction.state(off) - state).cwiseAbs().maxCoeff() < 1e-14 + 1e-12 * size);
      }
    StereoRig behind = rig();
    behind.T_left_right = SE3(behind.T_left_right.rotation(), -behind.T_left_right.translation());
    CHECK_FALSE(cairn_test::violation_of([&] { (void)correction.state(behind); }).empty());
  }

  TEST_CASE("rig_correction: no correction is the nominal rig, and each number does what it is called") {
    const StereoRig nominal = rig();
    const cairn::RigCorrection correction(nominal);
    const StereoRig same = correction.rig(RigState(RigState::Zero()));
    CHECK((same.T_left_right.matrix() - nominal.T_left_right.matrix()).norm() < 1e-15);
    CHECK(same.left.fx() == nominal.left.fx());
    CHECK(same.right.cy() == nominal.right.cy());
    RigState state;
    state << 1e-3, -2e-3, 3e-3, 4e-3, -5e-3, 0.01, 0.02, 0.03, 0.004, -0.005, 0.006, 0.007;
    const StereoRig off = correction.rig(state);
    const StereoRig loose = correction.rig(cairn::RigCorrection::loose(state));
    CHECK((off.T_left_right.rotation().matrix() - loose.T_left_right.rotation().matrix()).norm() < 1e-15);
    CHECK(off.baseline() == doctest::Approx(std::exp(0.01) * nominal.baseline()).epsilon(1e-14));
    CHECK(off.left.fx() == doctest::Approx(std::exp(0.02) * nominal.left.fx()));
    CHECK(off.left.fy() == doctest::Approx(std::exp(0.02) * nominal.left.fy()));
    CHECK(off.right.fy() == doctest::Approx(std::exp(0.05) * nominal.right.fy()));
    CHECK(off.left.cx() == doctest::Approx(nominal.left.cx() + 0.004 * nominal.left.fx()));
    CHECK(off.right.cx() == doctest::Approx(nominal.right.cx() + 0.010 * nominal.right.fx()));
    CHECK(off.right.cy() == doctest::Approx(nominal.right.cy() + 0.002 * nominal.right.fy()));
    CHECK(off.right.parameters().k1 == nominal.right.parameters().k1);
  }

  TEST_CASE("rig_correction: what a sighting says of the rig is the derivative of its pixels") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig nominal = rig();
    const cairn::RigCorrection correction(nominal);
    for (int trial = 0; trial < 20; ++trial) {
      RigState state;
      for (int i = 0; i < cairn::rig_numbers; ++i) state(i) = 1e-3 * random.normal();
      const StereoRig at = correction.rig(state);
      const SE3 pose(cairn::SO3::exp(Vector<3>(0.3 * random.normal(), random.normal(), 0.3)),
                     Vector<3>(random.normal(), random.normal(), random.normal()));
      const Vector<3> p(random.uniform(-1, 1), random.uniform(-0.7, 0.7), random.uniform(2, 8));
      const Vector<3> x = pose * p;
      const Vector<4> seen = at.project(p).value();
      constexpr double sigma = 0.7, h = 1e-6;
      Matrix<4, cairn::rig_numbers> J_rig;
      for (int i = 0; i < cairn::rig_numbers; ++i) {
        RigState more = state, less = state;
        more(i) += h;
        less(i) -= h;
        J_rig.col(i) =
            (correction.rig(more).project(p).value() - correction.rig(less).project(p).value()) / (2 * h);
      }
      Matrix<4, 3> J_point;
      for (int i = 0; i < 3; ++i) {
        const Vector<3> step = h * Vector<3>::Unit(i);
        J_point.col(i) = (at.project(pose.inverse() * Vector<3>(x + step)).value() -
                          at.project(pose.inverse() * Vector<3>(x - step)).value()) /
                         (2 * h);
      }
      cairn::detail::RigView view(pose, at);
      view.derive(correction);
      const Vector<4> noise(random.normal(), random.normal(), random.normal(), random.normal());
      const Vector<4> pixels = seen + 0.1 * noise;
      const auto sighting =
          cairn::detail::WhitenedSighting::of(at, pixels.head<2>(), pixels.tail<2>(), sigma).value();
      cairn::detail::PointStatistics of_point;
      cairn::detail::RigStatistics of_rig;
      REQUIRE(sighting.add(view, x, of_point, of_rig));
      J_rig /= sigma;
      J_point /= sigma;
      const Vector<4> r = 0.1 * noise / sigma;
      // Pixels are straightened at the observation, a tenth of a pixel from the prediction.
      const double most = 2e-3;
      CHECK((of_point.A - J_point.transpose() * J_point).norm() < most * of_point.A.norm());
      CHECK((of_rig.E - J_point.transpose() * J_rig).norm() < most * of_rig.E.norm());
      CHECK((of_rig.D - J_rig.transpose() * J_rig).norm() < most * of_rig.D.norm());
      CHECK((of_rig.u - J_rig.transpose() * r).norm() < 5e-3 * (J_rig.norm() * r.norm()));
    }
  }

  TEST_CASE("rig_correction: numbers of which no rig comes are refused") {
    const cairn::RigCorrection correction(rig());
    const double infinity = std::numeric_limits<double>::infinity();
    for (int i = 0; i < cairn::rig_numbers; ++i)
      for (const double bad : {std::nan(""), infinity, -infinity}) {
        CAPTURE(i);
        RigState state = RigState::Zero();
        state(i) = bad;
        CHECK_THROWS_AS(static_cast<void>(correction.rig(state)), cairn::Error);
        if (i < 5)
          CHECK_THROWS_AS(static_cast<void>(correction.rig(cairn::RigCorrection::loose(state))),
                          cairn::Error);
      }
    RigState long_baseline = RigState::Zero();
    for (const double log_length : {800.0, -800.0}) {  // whose factor is infinite, or nothing
      long_baseline(5) = log_length;
      CHECK_THROWS_AS(static_cast<void>(correction.rig(long_baseline)), cairn::Error);
    }
  }
}
