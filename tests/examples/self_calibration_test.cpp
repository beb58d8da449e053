// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "self_calibration.hpp"

#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/random.hpp>

#include "support/random.hpp"
#include "support/rigs.hpp"

namespace self_calibration_test {
namespace {

using cairn::SE3;
using cairn::SO3;
using cairn::Vector;
using cairn_test::turned;
using stereo_slam::SelfCalibration;
using stereo_slam::Sighting;

constexpr cairn::CalibrationDriftOptions options{
    .initial_sigma = 3e-4, .walk_rotation = 1e-5, .walk_baseline = 1e-6};

/// Drives `frames` frames of half a metre through a cloud of points, and tells `calibration` what `first`
/// saw, whose right camera turns by `turn` in every frame. How often that corrected the rig.
int drive(SelfCalibration& calibration, const cairn::StereoRig& first, int frames, double step,
          cairn::Random& random, const Vector<3>& turn = Vector<3>::Zero()) {
  std::vector<Vector<3>> cloud(3000);
  for (Vector<3>& point : cloud)
    point = Vector<3>{random.uniform(-12, 12), random.uniform(-4, 4), random.uniform(2, 60)};
  int corrections = 0;
  for (int k = 0; k < frames; ++k) {
    const SE3 pose(SO3::exp(Vector<3>(0, 0.002 * k, 0)), Vector<3>(0, 0, step * k));
    const cairn::StereoRig actual = turned(first, k * turn);
    std::vector<Sighting> sightings;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Vector<3> p = pose.inverse() * cloud[i];
      if (p(2) < 2 || p(2) > 25) continue;
      const auto pixels = actual.project(p);
      if (!pixels || !actual.left.contains(pixels->head<2>()) || !actual.right.contains(pixels->tail<2>()))
        continue;
      Vector<4> z = *pixels;
      for (int c = 0; c < 4; ++c) z(c) += 0.4 * random.normal();
      sightings.push_back({static_cast<stereo_slam::LandmarkId>(i), z.head<2>(), z.tail<2>(), 0.4});
    }
    corrections += calibration.observe(k, pose, sightings) ? 1 : 0;
  }
  return corrections;
}

}  // namespace

TEST_SUITE("self_calibration") {
  TEST_CASE("SelfCalibration: finds the right camera's yaw while driving") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::StereoRig nominal = cairn_test::rectified_rig(0.5);
    const cairn::StereoRig actual = turned(nominal, Vector<3>(0, 3e-4, 0));
    SelfCalibration calibration(nominal, options);
    CHECK(drive(calibration, actual, 40, 0.5, random) >= 2);
    const double yaw =
        (nominal.T_left_right.rotation().inverse() * calibration.now().corrected().T_left_right.rotation())
            .log()(1);
    const double sigma = std::sqrt(calibration.now().covariance()(1, 1));
    CHECK(sigma < 1e-4);
    CHECK(std::abs(yaw - 3e-4) < 4.5 * sigma);
  }

  TEST_CASE("SelfCalibration: between motions it knows where a camera is that keeps turning") {
    const auto seed = cairn_test::seed();
    CAPTURE(seed);
    cairn::Random random(seed);
    const cairn::StereoRig nominal = cairn_test::rectified_rig(0.5);
    const Vector<3> turn(2e-5, -3e-5, 1e-5);
    cairn::CalibrationDriftOptions with_rate = options;
    with_rate.rate_sigma = 2e-5;
    SelfCalibration calibration(nominal, with_rate), walking(nominal, options);
    constexpr int frames = 78;
    cairn::Random again = random;
    CHECK(drive(calibration, nominal, frames, 0.3, random, turn) >= 4);
    (void)drive(walking, nominal, frames, 0.3, again, turn);
    const auto yaw_error = [&](const cairn::StereoRig& found, int frame) {
      return (turned(nominal, frame * turn).T_left_right.rotation().inverse() * found.T_left_right.rotation())
          .log()(1);
    };
    const cairn::CalibrationDrift now = calibration.now(), next = calibration.next();
    CAPTURE(yaw_error(walking.now().corrected(), frames - 1));
    CHECK(std::abs(yaw_error(now.corrected(), frames - 1)) < 4.5 * std::sqrt(now.covariance()(1, 1)));
    CHECK(std::abs(yaw_error(next.corrected(), frames)) < 4.5 * std::sqrt(next.covariance()(1, 1)));
    CHECK(std::sqrt(next.covariance()(1, 1)) < 2e-4);
    // The motion that has not ended goes on: what is known of the last frame is not what was found at its
    // start.
    CHECK(next.covariance()(1, 1) > now.covariance()(1, 1));
    CHECK(2 * std::abs(yaw_error(now.corrected(), frames - 1)) <
          std::abs(yaw_error(walking.now().corrected(), frames - 1)));
  }

  TEST_CASE("SelfCalibration: while it sees too little it knows less and less") {
    cairn::Random random(cairn_test::seed());
    const cairn::StereoRig nominal = cairn_test::rectified_rig(0.5);
    SelfCalibration calibration(nominal, options);
    (void)drive(calibration, nominal, 40, 0.5, random);
    const double before = calibration.now().covariance()(1, 1);
    const int last = 40 + 5000;
    CHECK_FALSE(calibration.observe(last, SE3(), {}));  // in the dark since
    const double expected = before + 5000 * options.walk_rotation * options.walk_rotation;
    CHECK(calibration.now().covariance()(1, 1) == doctest::Approx(expected).epsilon(0.01).scale(0));
  }

  TEST_CASE("SelfCalibration: nothing to see, nothing to correct") {
    cairn::Random random(cairn_test::seed());
    const cairn::StereoRig nominal = cairn_test::rectified_rig(0.5);
    SelfCalibration calibration(nominal, options);
    for (int k = 0; k < 40; ++k) CHECK_FALSE(calibration.observe(k, SE3(), {}));
    CHECK((calibration.now().corrected().T_left_right.matrix() - nominal.T_left_right.matrix())
              .cwiseAbs()
              .maxCoeff() < 1e-15);
  }
}

}  // namespace self_calibration_test
