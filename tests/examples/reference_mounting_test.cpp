// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "reference_mounting.hpp"

#include <cmath>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>

#include "examples/synthetic_run.hpp"
#include "support/random.hpp"

namespace reference_mounting_test {
namespace {

/// A winding drive of 80 frames, one metre each, whose estimates err by what their covariance says, each by
/// itself, and whose reference is mounted with `turn`. The first estimate is exact, as a world's beginning
/// is.
stereo_slam::RunRecord winding_drive(cairn::Random& random, const cairn::Vector<3>& turn) {
  stereo_slam::RunRecord run = cairn_test::straight_run(80);
  const cairn::SE3 X(cairn::SO3::exp(turn), cairn::Vector<3>::Zero());
  cairn::SE3 at;
  for (stereo_slam::FrameRecord& frame : run.frames) {
    frame.covariance.setZero();
    cairn::Vector<6> error;
    for (int i = 0; i < 6; ++i) {
      const double sigma = i < 3 ? 0.02 : 0.002;
      frame.covariance(i, i) = sigma * sigma;
      error(i) = frame.index == 0 ? 0 : random.normal(0, sigma);
    }
    frame.truth = at * X.inverse();
    frame.T_world_camera = at * cairn::SE3::exp(-error);
    at = at * cairn::SE3::exp((cairn::Vector<6>() << 0, 0, 1, 0.01,
                               0.05 * std::cos(0.1 * static_cast<double>(frame.index)), 0.02)
                                  .finished());
  }
  return run;
}

}  // namespace

TEST_SUITE_BEGIN("stereo_slam/reference_mounting");

TEST_CASE("reference_mounting: finds how a reference is mounted, and that the covariance was right") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  const cairn::Vector<3> turn(0.004, -0.006, 0.01);
  const stereo_slam::RunRecord run = winding_drive(random, turn);
  const auto found = stereo_slam::mounted_consistency(run.frames, 0);
  REQUIRE(found);
  CHECK(found->frames == 79);
  CHECK(found->nees_as_given > 20);
  CHECK((found->turn - turn).norm() < 0.001);  // 79 poses of 2 mrad and 20 mm
  CHECK(found->nees > 4.8);                    // chi^2 of 474 over 79: 6 +- 0.39, three deviations
  CHECK(found->nees < 7.2);
}

TEST_CASE("reference_mounting: what is no mounting stays in the NEES") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  stereo_slam::RunRecord run = winding_drive(random, cairn::Vector<3>::Zero());
  CHECK(stereo_slam::mounted_consistency(run.frames, 0)->turn.norm() < 0.001);
  CHECK(std::abs(*stereo_slam::level_nees(run.frames, 0) - 3) < 0.83);  // three deviations of chi^2_237 / 79
  for (stereo_slam::FrameRecord& frame : run.frames) {                  // two percent of scale
    const cairn::Vector<3> longer = 1.02 * frame.T_world_camera.translation();
    frame.T_world_camera = cairn::SE3(frame.T_world_camera.rotation(), longer);
  }
  CHECK(stereo_slam::mounted_consistency(run.frames, 0)->nees > 100);
  CHECK(stereo_slam::mounted_consistency(run.frames, 10)->frames == 69);
}

TEST_CASE("reference_mounting: height does not count in a level drive") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  stereo_slam::RunRecord run = winding_drive(random, cairn::Vector<3>::Zero());
  const double before = *stereo_slam::level_nees(run.frames, 0);
  for (stereo_slam::FrameRecord& frame : run.frames)
    frame.truth =
        *frame.truth * cairn::SE3({}, cairn::Vector<3>(0, 0.02 * static_cast<double>(frame.index), 0));
  CHECK(*stereo_slam::level_nees(run.frames, 0) == doctest::Approx(before).epsilon(0.3).scale(0));
  CHECK(stereo_slam::mounted_consistency(run.frames, 0)->nees_as_given > 100);
}

TEST_CASE("reference_mounting: too few frames, or none with a reference, give nothing") {
  stereo_slam::RunRecord run = cairn_test::straight_run(3);
  CHECK_FALSE(stereo_slam::mounted_consistency(run.frames, 0));
  CHECK_FALSE(stereo_slam::mounted_consistency(run.frames, 7));
  CHECK_FALSE(stereo_slam::level_nees(run.frames, 0));
  run = cairn_test::straight_run(20);
  run.frames[5].truth.reset();
  CHECK_FALSE(stereo_slam::mounted_consistency(run.frames, 5));
  CHECK_FALSE(stereo_slam::mounted_consistency(run.frames, 0));  // straight ahead no roll is seen
  CHECK(stereo_slam::level_nees(run.frames, 0) == 0.0);
}

TEST_SUITE_END();

}  // namespace reference_mounting_test
