// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/calibration_drift.hpp>
#include <cairn/geometry/motion_calibration.hpp>

#include "support/elimination.hpp"
#include "support/random.hpp"
#include "support/rigs.hpp"

namespace motion_calibration_test {
namespace {

using cairn::Matrix;
using cairn::MotionCalibration;
using cairn::MotionCalibrationStatus;
using cairn::MovedPair;
using cairn::RigCorrection;
using cairn::SE3;
using cairn::SO3;
using cairn::StereoRig;
using cairn::Vector;

/// A metre ahead, a little aside, a little turned.
SE3 drive(double metres = 1) {
  return SE3(SO3::exp(Vector<3>(0.005, 0.02, -0.004)), metres * Vector<3>(0.05, 0.02, 1));
}

/// Points that a rig sees before and after the motion, which may be another one by then; a share of them
/// jumps in between.
std::vector<MovedPair> moved(const StereoRig& rig, const StereoRig& later_rig, const SE3& motion,
                             double noise, cairn::Random& random, std::size_t count, double wrong = 0) {
  std::vector<MovedPair> pairs;
  while (pairs.size() < count) {
    const Vector<3> p = cairn_test::visible_point(rig, random, 3, 30);
    Vector<3> later = motion.inverse() * p;
    if (random.uniform() < wrong) later = cairn_test::visible_point(rig, random, 3, 30);
    const auto before = rig.project(p), after = later_rig.project(later);
    if (!before || !after || !rig.left.contains(after->head<2>()) || !rig.right.contains(after->tail<2>()))
      continue;
    Vector<8> z;
    z << *before, *after;
    for (int i = 0; i < 8; ++i) z(i) += noise * random.normal();
    pairs.push_back(
        {z.segment<2>(0), z.segment<2>(2), z.segment<2>(4), z.segment<2>(6), noise > 0 ? noise : 0.1});
  }
  return pairs;
}

std::vector<MovedPair> moved(const StereoRig& rig, const SE3& motion, double noise, cairn::Random& random,
                             std::size_t count = 200, double wrong = 0) {
  return moved(rig, rig, motion, noise, random, count, wrong);
}

Matrix<5> prior(double sigma = 1e-3) {
  return Matrix<5>::Identity() * sigma * sigma;
}

}  // namespace

TEST_SUITE("motion_calibration") {
  TEST_CASE("calibrate_from_motion: exact pixels give the exact correction and motion, on any rig") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const StereoRig& nominal : {cairn_test::rectified_rig(), cairn_test::unrectified_rig()}) {
      const RigCorrection correction(nominal);
      Vector<5> truth;
      truth << 0.002, -0.003, 0.001, 0.002, -0.001;
      const std::vector<MovedPair> pairs = moved(correction.rig(truth), drive(), 0, random);
      const MotionCalibration result =
          cairn::calibrate_from_motion(correction, Vector<5>::Zero(), prior(10), pairs, SE3());
      REQUIRE(result.good());
      CHECK((result.state - truth).cwiseAbs().maxCoeff() < 1e-6);  // the prior pulls by some 1e-8
      // The length of the baseline is given, so the motion has its scale.
      CHECK(cairn::local(drive(), result.T_before_after).norm() < 1e-5);
      CHECK(result.inliers + 10 > pairs.size());  // a few lie at the rim of the distortion
    }
  }

  TEST_CASE("calibrate_from_motion: its covariance is right, and sees the yaw that one pair does not") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    constexpr int runs = 100;
    double nees = 0;
    const RigCorrection correction(cairn_test::rectified_rig(0.5));
    for (int run = 0; run < runs; ++run) {
      Vector<5> truth;
      for (int i = 0; i < 5; ++i) truth(i) = random.normal(0, 1e-3);
      const std::vector<MovedPair> pairs = moved(correction.rig(truth), drive(3), 0.5, random);
      const MotionCalibration result =
          cairn::calibrate_from_motion(correction, Vector<5>::Zero(), prior(), pairs, drive(3.1));
      REQUIRE(result.good());
      const Vector<5> error = result.state - truth;
      nees += cairn_test::normalised_square(result.covariance, error) / runs;

      cairn::CalibrationDrift epipolar(correction.nominal());
      std::vector<cairn::PixelPair> single;
      for (const MovedPair& pair : pairs) {
        single.push_back({pair.left_before, pair.right_before});
        single.push_back({pair.left_after, pair.right_after});
      }
      (void)epipolar.update(single);
      CHECK(9 * result.covariance(1, 1) < epipolar.covariance()(1, 1));
    }
    CAPTURE(nees);
    CHECK(cairn::chi_square_mean_band(5, runs, cairn_test::almost_sure).contains(nees));
  }

  TEST_CASE("calibrate_from_motion: wrong matches are left out") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const RigCorrection correction(cairn_test::unrectified_rig());
    Vector<5> truth;
    truth << 0.0003, 0.0005, -0.0002, 0.0004, 0.0001;
    const auto pairs = moved(correction.rig(truth), drive(2), 0.5, random, 300, 0.2);
    const auto result =
        cairn::calibrate_from_motion(correction, Vector<5>::Zero(), prior(), pairs, drive(1.8));
    REQUIRE(result.good());
    CHECK(result.inliers > 200);
    CHECK(result.inliers < 260);
    const Vector<5> error = result.state - truth;
    CHECK(cairn_test::normalised_square(result.covariance, error) < cairn::chi_square_quantile(0.9999, 5));
  }

  TEST_CASE("calibrate_from_motion: without motion the yaw stays as uncertain as one pair leaves it") {
    cairn::Random random(cairn_test::seed());
    const RigCorrection correction(cairn_test::rectified_rig());
    const auto still = cairn::calibrate_from_motion(correction, Vector<5>::Zero(), prior(),
                                                    moved(correction.nominal(), SE3(), 0.5, random), SE3());
    const auto driven = cairn::calibrate_from_motion(
        correction, Vector<5>::Zero(), prior(), moved(correction.nominal(), drive(), 0.5, random), drive());
    REQUIRE(still.good());
    REQUIRE(driven.good());
    CHECK(4 * driven.covariance(1, 1) < still.covariance(1, 1));
  }

  TEST_CASE("calibrate_from_motion: what it cannot use leaves the correction as it was, with a reason") {
    cairn::Random random(cairn_test::seed());
    const RigCorrection correction(cairn_test::rectified_rig());
    const Vector<5> state = Vector<5>::Constant(1e-4);
    std::vector<MovedPair> pairs = moved(correction.rig(state), drive(), 0.5, random, 60);
    const auto untouched = [&](const MotionCalibration& result) {
      CHECK_FALSE(result.good());
      CHECK((result.state.array() == state.array()).all());
      CHECK((result.covariance.array() == prior().array()).all());
      CHECK((result.T_before_after.matrix().array() == drive().matrix().array()).all());
    };
    const MotionCalibration nothing = cairn::calibrate_from_motion(correction, state, prior(), {}, drive());
    untouched(nothing);
    CHECK(nothing.status == MotionCalibrationStatus::too_few_points);
    // Every point jumps: whether few agree or none determine the motion depends on the draw.
    const auto chaos = moved(correction.rig(state), drive(), 0.5, random, 100, 1);
    untouched(cairn::calibrate_from_motion(correction, state, prior(), chaos, drive()));

    // Points with numbers that are not finite are passed over.
    for (std::size_t i = 0; i < 20; ++i) {
      pairs[i].right_after(static_cast<int>(i % 2)) =
          i % 3 == 0 ? std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
      pairs[i + 20].sigma = i % 2 == 0 ? 0 : std::numeric_limits<double>::quiet_NaN();
    }
    const auto rest =
        cairn::calibrate_from_motion(correction, state, prior(), pairs, drive(), {.min_inliers = 10});
    CHECK(rest.good());
    CHECK(rest.inliers <= 20);
    CHECK(rest.state.allFinite());
  }

  TEST_CASE("CalibrationDrift: a drive shows the yaw, whose error is a quarter of a pixel of disparity") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const RigCorrection correction(cairn_test::rectified_rig(0.5));
    Vector<5> truth = Vector<5>::Zero();
    truth(1) = 2.5e-4;
    cairn::CalibrationDrift drift(correction.nominal());
    for (int k = 0; k < 20; ++k)
      CHECK(drift.update_moved(moved(correction.rig(truth), drive(2), 0.5, random, 200, 0.1), drive(2), 3)
                .good());
    CHECK(std::abs(drift.state()(1) - truth(1)) < 4 * std::sqrt(drift.covariance()(1, 1)));
    CHECK(std::sqrt(drift.covariance()(1, 1)) < 1e-4);
    drift = drift.ahead(1'000'000);  // unseen for a day
    CHECK(drift.update_moved(moved(correction.rig(truth), drive(2), 0.5, random), drive(2)).good());
    CHECK(std::abs(drift.state()(1) - truth(1)) < 4 * std::sqrt(drift.covariance()(1, 1)));
    cairn::CalibrationDrift off(correction.nominal(), {.enabled = false});
    (void)off.update_moved(moved(correction.rig(truth), drive(2), 0.5, random), drive(2));
    CHECK(off.state().norm() == 0.0);
  }

  TEST_CASE("CalibrationDrift: a knock is believed from the first motion after it") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const RigCorrection correction(cairn_test::rectified_rig(0.5));
    for (const double rate_sigma : {0.0, 5e-6})
      for (const double size : {0.002, 0.02}) {  // 2 and 20 pixels
        CAPTURE(size);
        cairn::CalibrationDrift drift(correction.nominal(), {.rate_sigma = rate_sigma});
        Vector<5> truth = Vector<5>::Zero();
        const auto see = [&] {
          (void)drift.update_moved(moved(correction.rig(truth), drive(2), 0.5, random, 200, 0.1), drive(2),
                                   4);
        };
        const auto error = [&](int i) {
          return std::abs(drift.state()(i) - truth(i)) / std::sqrt(drift.covariance()(i, i));
        };
        for (int k = 0; k < 10; ++k) see();
        CHECK(error(1) < 4.5);
        const double settled = drift.covariance()(1, 1);
        truth.head<3>() += size * Vector<3>(0.48, 0.8, 0.36);
        see();
        CHECK(drift.covariance()(1, 1) > settled);
        for (int i = 0; i < 3; ++i) CHECK(error(i) < 4.5);
        for (int k = 0; k < 5; ++k) see();
        CHECK(error(1) < 4.5);
      }
  }

  TEST_CASE("CalibrationDrift: a knock is believed also where much more was seen before it") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const RigCorrection correction(cairn_test::rectified_rig(0.5));
    int believed = 0;
    constexpr int runs = 20;
    for (int run = 0; run < runs; ++run) {
      cairn::CalibrationDrift drift(correction.nominal());
      Vector<5> truth = Vector<5>::Zero();
      const auto see = [&] {
        return drift.update_moved(moved(correction.rig(truth), drive(2), 0.5, random, 100), drive(2));
      };
      for (int k = 0; k < 10; ++k) REQUIRE(see().good());  // each the next frame: hardly any walk
      Vector<3> axis(random.normal(), random.normal(), random.normal());
      truth.head<3>() += 0.006 * axis.normalized();
      const MotionCalibration after = see();
      const Vector<5> error = after.state - truth;
      believed += after.good() && cairn_test::normalised_square(after.covariance, error) < 30;
    }
    CHECK(believed >= runs - 1);
  }

  TEST_CASE("CalibrationDrift: points that move as no scene does are no knock") {
    cairn::Random random(cairn_test::seed());
    const RigCorrection correction(cairn_test::rectified_rig(0.5));
    cairn::CalibrationDrift drift(correction.nominal());
    for (int k = 0; k < 5; ++k)
      (void)drift.update_moved(moved(correction.nominal(), drive(2), 0.5, random), drive(2));
    const Vector<5> before = drift.state();
    (void)drift.update_moved(moved(correction.nominal(), drive(2), 0.5, random, 100, 1), drive(2));
    CHECK((drift.state() - before).cwiseAbs().maxCoeff() < 1e-9);
  }

  TEST_CASE(
      "CalibrationDrift: a camera that keeps turning is followed without a lag, and its rate is known") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const RigCorrection correction(cairn_test::rectified_rig(0.5));
    constexpr cairn::CalibrationDriftOptions options{.initial_sigma = 1e-3,
                                                     .walk_rotation = 0,
                                                     .walk_baseline = 0,
                                                     .rate_sigma = 5e-5,
                                                     .rate_memory = 1e9};  // it lasts
    constexpr int runs = 40, motions = 6, frames = 10;
    double nees = 0, rate_nees = 0, lag = 0, lag_without = 0;
    for (int run = 0; run < runs; ++run) {
      Vector<5> truth;
      for (int i = 0; i < 5; ++i) truth(i) = random.normal(0, options.initial_sigma);
      Vector<5> turn = Vector<5>::Zero();  // a frame
      for (int i = 0; i < 3; ++i) turn(i) = random.normal(0, options.rate_sigma);
      cairn::CalibrationDrift drift(correction.nominal(), options);
      cairn::CalibrationDriftOptions walking = options;
      walking.rate_sigma = 0;
      walking.walk_rotation = options.rate_sigma * std::sqrt(frames);  // as far in a motion
      cairn::CalibrationDrift without(correction.nominal(), walking);
      for (int k = 0; k < motions; ++k) {
        const Vector<5> later = truth + frames * turn;
        const auto pairs = moved(correction.rig(truth), correction.rig(later), drive(3), 0.5, random, 150);
        REQUIRE(drift.update_moved(pairs, drive(3.1), frames).good());
        (void)without.update_moved(pairs, drive(3.1), frames);
        truth = later;
      }
      const Vector<5> error = drift.state() - truth;
      const Vector<3> rate_error = drift.rate() - turn.head<3>();
      nees += cairn_test::normalised_square(drift.covariance(), error) / runs;
      rate_nees += cairn_test::normalised_square(drift.rate_covariance(), rate_error) / runs;
      lag += error.head<3>().squaredNorm() / runs;
      lag_without += (without.state() - truth).head<3>().squaredNorm() / runs;
      CHECK(drift.rate_covariance()(0, 0) < 0.01 * options.rate_sigma * options.rate_sigma);
    }
    CAPTURE(nees);
    CAPTURE(rate_nees);
    CAPTURE(std::sqrt(lag));
    CAPTURE(std::sqrt(lag_without));
    // 5 and 3 where a covariance is right. A thousand runs have 5.6 and 3.3: every motion is linearised
    // elsewhere.
    CHECK(nees > 3.5);
    CHECK(nees < 7.5);
    CHECK(rate_nees > 1.8);
    CHECK(rate_nees < 4.7);
    CHECK(lag < 0.25 * lag_without);  // of the squares of the rotation's errors
  }
}

}  // namespace motion_calibration_test
