// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/geometry/calibration_drift.hpp>
#include <cairn/geometry/triangulation.hpp>

#include "support/elimination.hpp"
#include "support/random.hpp"
#include "support/rigs.hpp"
#include "support/violation.hpp"

namespace calibration_drift_test {
namespace {

using cairn::CalibrationDrift;
using cairn::CalibrationHealth;
using cairn::Matrix;
using cairn::PixelPair;
using cairn::SE3;
using cairn::StereoRig;
using cairn::Vector;
using cairn_test::turned;

/// One frame's matches seen by `rig`, a share of them wrong.
std::vector<PixelPair> frame(const StereoRig& rig, cairn::Random& random, std::size_t count = 200,
                             double wrong = 0) {
  std::vector<PixelPair> pairs(count);
  for (PixelPair& pair : pairs) {
    Vector<4> x = *rig.project(cairn_test::visible_point(rig, random, 1, 10));
    for (int i = 0; i < 4; ++i) x(i) += random.normal(0, 0.5);
    if (random.uniform() < wrong) x(3) += random.uniform(-100, 100);
    pair = {x.head<2>(), x.tail<2>()};
  }
  return pairs;
}

Vector<3> rotation_error(const StereoRig& found, const StereoRig& truth) {
  return (truth.T_left_right.rotation().inverse() * found.T_left_right.rotation()).log();
}

}  // namespace

TEST_SUITE("calibration_drift") {
  TEST_CASE("CalibrationDrift: corrects a step of the pitch within ten frames, on any rig") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    for (const StereoRig& nominal : {cairn_test::rectified_rig(), cairn_test::unrectified_rig()})
      for (const double step : {0.001, 0.01}) {  // 1 and 10 pixels
        CAPTURE(step);
        const StereoRig truth = turned(nominal, Vector<3>(step, 0, step / 2));
        CalibrationDrift drift(nominal);
        for (int k = 0; k < 5; ++k) (void)drift.update(frame(nominal, random));
        CalibrationHealth health;
        std::vector<PixelPair> last;
        for (int k = 0; k < 10; ++k) health = drift.update(last = frame(truth, random, 200, 0.1));
        const Vector<3> error = rotation_error(drift.corrected(), truth);
        for (const int axis : {0, 2}) {
          const double variance = drift.covariance()(axis, axis);
          CHECK(error(axis) * error(axis) < 25 * variance);
          CHECK(std::sqrt(variance) < (axis == 0 ? 6e-5 : 1.5e-4));
        }
        CHECK(health.healthy);
        // The same pairs under the rig as it is: their noise and the wrong ones.
        const double by_truth = CalibrationDrift(truth, {.enabled = false}).update(last).distance_after;
        CHECK(health.distance_after < 1.25 * by_truth);
      }
  }

  TEST_CASE("CalibrationDrift: a knock is not learned from the wrong pairs of its frame") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed, 9);
    const StereoRig nominal = cairn_test::rectified_rig();
    const StereoRig truth = turned(nominal, Vector<3>(0.01, 0, 0.005));
    int misled = 0;
    for (int run = 0; run < 40; ++run) {
      CalibrationDrift drift(nominal);
      for (int k = 0; k < 5; ++k) (void)drift.update(frame(nominal, random));
      (void)drift.update(frame(truth, random, 200, 0.3));
      const double error = rotation_error(drift.corrected(), truth)(0);
      misled += error * error > 36 * drift.covariance()(0, 0) ? 1 : 0;
    }
    CHECK(misled <= 1);  // where wrong pairs pass the wide gate of the start it is a quarter of all
  }

  TEST_CASE("CalibrationDrift: its covariance is right, for the well and the badly seen numbers") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig nominal = cairn_test::rectified_rig();
    cairn::CalibrationDriftOptions options;
    options.walk_rotation = options.walk_baseline = 0;
    options.gate = 10;
    constexpr int runs = 60;
    double nees = 0;
    for (int run = 0; run < runs; ++run) {
      Vector<5> truth;
      for (int i = 0; i < 5; ++i) truth(i) = random.normal(0, options.initial_sigma);
      StereoRig rig = turned(nominal, truth.head<3>());
      const Vector<3> t(1, truth(3), truth(4));  // u1, u2, u3 are x, y, z here
      rig.T_left_right = SE3(rig.T_left_right.rotation(), nominal.baseline() * t / t.norm());
      CalibrationDrift drift(nominal, options);
      for (int k = 0; k < 5; ++k) (void)drift.update(frame(rig, random, 100));
      const Vector<5> error = drift.state() - truth;
      nees += cairn_test::normalised_square(drift.covariance(), error) / runs;
      // pitch is seen ten times better than yaw, and the filter knows
      CHECK(drift.covariance()(0, 0) * 10 < drift.covariance()(1, 1));
    }
    CAPTURE(nees);
    CHECK(cairn::chi_square_mean_band(5, runs, cairn_test::almost_sure).contains(nees));
  }

  TEST_CASE(
      "CalibrationDrift: without drift the correction stays within its own sigmas and depth stays good") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    CalibrationDrift drift(rig);
    for (int k = 0; k < 50; ++k) CHECK(drift.update(frame(rig, random, 200, 0.1)).healthy);
    for (int i = 0; i < 5; ++i) CHECK(std::abs(drift.state()(i)) < 4 * std::sqrt(drift.covariance()(i, i)));
    const StereoRig corrected = drift.corrected();
    CHECK(std::abs(rotation_error(corrected, rig)(0)) < 1e-4);
    CHECK(corrected.baseline() == doctest::Approx(rig.baseline()).epsilon(1e-12));
  }

  TEST_CASE("CalibrationDrift: switched off, it changes nothing and still reports health") {
    cairn::Random random(cairn_test::seed());
    const StereoRig nominal = cairn_test::unrectified_rig(), truth = turned(nominal, Vector<3>(0.004, 0, 0));
    CalibrationDrift drift(nominal, {.enabled = false});
    const CalibrationHealth health = drift.update(frame(truth, random));
    CHECK((drift.corrected().T_left_right.matrix().array() == nominal.T_left_right.matrix().array()).all());
    CHECK(drift.state().norm() == 0.0);
    CHECK(health.distance_after > 3);
    CHECK_FALSE(health.healthy);
  }

  TEST_CASE("CalibrationDrift: follows a slow drift of pitch and roll") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig nominal = cairn_test::rectified_rig();
    CalibrationDrift drift(nominal);
    double worst = 0;
    for (int k = 0; k < 200; ++k) {
      const StereoRig truth = turned(nominal, Vector<3>(2e-5 * k, 0, -1e-5 * k));
      (void)drift.update(frame(truth, random));
      if (k > 10) worst = std::max(worst, std::abs(rotation_error(drift.corrected(), truth)(0)));
    }
    CHECK(worst < 2.5e-4);  // a quarter of a pixel; the drift is four pixels
  }

  TEST_CASE("CalibrationDrift: between measurements it spreads as a rig does that turns, forgets and walks") {
    constexpr cairn::CalibrationDriftOptions options{.initial_sigma = 2e-3,
                                                     .walk_rotation = 3e-4,
                                                     .walk_baseline = 1e-4,
                                                     .rate_sigma = 1e-4,
                                                     .rate_memory = 20};
    const CalibrationDrift start(cairn_test::rectified_rig(), options);
    for (const int frames : {1, 7, 20, 300}) {
      CAPTURE(frames);
      // The variances' differential equations, in small steps: w' = rate + noise, rate' = -rate/memory +
      // noise.
      const double noise = 2 * options.rate_sigma * options.rate_sigma / options.rate_memory;
      double ww = options.initial_sigma * options.initial_sigma, wr = 0,
             rr = options.rate_sigma * options.rate_sigma, tt = ww;
      constexpr int steps = 20000;  // a frame
      constexpr double dt = 1.0 / steps;
      for (int k = 0; k < frames * steps; ++k) {
        ww += dt * (2 * wr + options.walk_rotation * options.walk_rotation);
        wr += dt * (rr - wr / options.rate_memory);
        rr += dt * (noise - 2 * rr / options.rate_memory);
        tt += dt * options.walk_baseline * options.walk_baseline;
      }
      const CalibrationDrift then = start.ahead(frames);
      for (int i = 0; i < 3; ++i) {
        CHECK(then.covariance()(i, i) == doctest::Approx(ww).epsilon(1e-4).scale(0));
        CHECK(then.rate_covariance()(i, i) == doctest::Approx(rr).epsilon(1e-4).scale(0));
      }
      CHECK(then.covariance()(4, 4) == doctest::Approx(tt).epsilon(1e-4).scale(0));
      CHECK(then.covariance()(0, 1) == 0.0);
      // In one go or frame by frame: w, its rate, and, by what comes next, both together.
      CalibrationDrift stepped = start;
      for (int k = 0; k < frames; ++k) stepped = stepped.ahead(1);
      const Matrix<5> whole = then.ahead(5).covariance(), sum = stepped.ahead(5).covariance();
      CHECK((whole - sum).cwiseAbs().maxCoeff() < 1e-9 * whole.cwiseAbs().maxCoeff());
    }
    for (const double memory : {1e-300, 1e155, 1e300}) {  // whose squares are no numbers
      CAPTURE(memory);
      const CalibrationDrift turning(cairn_test::rectified_rig(),
                                     {.walk_rotation = 0, .rate_sigma = 1e-4, .rate_memory = memory});
      const double turned = memory < 1 ? 0 : 300 * 1e-4;
      CHECK(turning.ahead(300).covariance()(0, 0) ==
            doctest::Approx(1e-6 + turned * turned).epsilon(1e-9).scale(0));
    }
    CHECK(start.ahead(0).covariance() == start.covariance());
    CHECK(cairn_test::violation_of([&] { (void)start.ahead(-1); }) == "CalibrationDrift: cannot go back");
    const CalibrationDrift off(cairn_test::rectified_rig(), {.enabled = false});
    CHECK(off.ahead(9).covariance() == off.covariance());
  }

  TEST_CASE("CalibrationDrift: refuses options that are none") {
    const StereoRig rig = cairn_test::rectified_rig();
    using Options = cairn::CalibrationDriftOptions;
    for (double Options::* const number :
         {&Options::initial_sigma, &Options::walk_rotation, &Options::walk_baseline, &Options::rate_sigma,
          &Options::rate_memory, &Options::pixel_sigma})
      for (const double bad : {-1.0, static_cast<double>(NAN), static_cast<double>(INFINITY)}) {
        Options options;
        options.*number = bad;
        CHECK(cairn_test::violation_of([&] { CalibrationDrift(rig, options); }).find("expected") !=
              std::string::npos);
      }
    CHECK_FALSE(cairn_test::violation_of([&] { CalibrationDrift(rig, {.rate_memory = 0}); }).empty());
    CHECK_FALSE(cairn_test::violation_of([&] { CalibrationDrift(rig, {.initial_sigma = 0}); }).empty());
    CHECK(cairn_test::violation_of([&] { CalibrationDrift(rig, {.walk_baseline = 0}); }).empty());
  }

  TEST_CASE("CalibrationDrift: few pairs that are wrong, or many that no rig explains, change nothing") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const StereoRig rig = cairn_test::rectified_rig();
    CalibrationDrift drift(rig);
    for (int k = 0; k < 50; ++k) drift.update(frame(rig, random));
    const Vector<5> known = drift.state();
    for (const std::size_t count : {std::size_t{1}, std::size_t{3}, std::size_t{19}, std::size_t{200}}) {
      CAPTURE(count);
      auto pairs = frame(rig, random, count);
      for (PixelPair& pair : pairs)
        pair.right(1) += (random.uniform() < 0.5 ? -1 : 1) * random.uniform(40, 90);
      const CalibrationHealth health = drift.update(pairs);
      CHECK(health.gated == count);
      CHECK((drift.state() - known).norm() < 1e-9);
      CHECK_FALSE(health.healthy);
    }
    CHECK(drift.update(frame(rig, random)).healthy);
  }

  TEST_CASE("CalibrationDrift: frames without pairs or with impossible pixels are harmless") {
    const StereoRig rig = cairn_test::unrectified_rig();
    CalibrationDrift drift(rig);
    CHECK(drift.update({}).used == 0);
    const std::vector<PixelPair> bad{{Vector<2>(NAN, 0), Vector<2>(0, 0)},
                                     {Vector<2>(1e9, 0), Vector<2>(0, 1e9)}};
    CHECK(drift.update(bad).used == 0);
    CHECK(drift.state().norm() == 0.0);
    CHECK(drift.covariance().allFinite());
  }
}

}  // namespace calibration_drift_test
