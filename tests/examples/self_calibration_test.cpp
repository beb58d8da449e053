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
using stereo_slam::SelfCalibration;
using stereo_slam::Sighting;

constexpr cairn::CalibrationDriftOptions options{
    .initial_sigma = 3e-4, .walk_rotation = 1e-5, .walk_baseline = 1e-6};

/// Drives `frames` frames of half a metre through a cloud of points that `actual` sees, and tells
/// `calibration` what it saw. How often that corrected the rig.
int drive(SelfCalibration& calibration, const cairn::StereoRig& actual, int frames, double step,
          cairn::Random& random) {
  std::vector<Vector<3>> cloud(3000);
  for (Vector<3>& point : cloud)
    point = Vector<3>{random.uniform(-12, 12), random.uniform(-4, 4), random.uniform(2, 60)};
  int corrections = 0;
  for (int k = 0; k < frames; ++k) {
    const SE3 pose(SO3::exp(Vector<3>(0, 0.002 * k, 0)), Vector<3>(0, 0, step * k));
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
    corrections += calibration.observe(pose, sightings) ? 1 : 0;
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
    cairn::StereoRig actual = nominal;
    actual.T_left_right = actual.T_left_right * SE3(SO3::exp(Vector<3>(0, 3e-4, 0)), Vector<3>::Zero());
    SelfCalibration calibration(nominal, options);
    CHECK(drive(calibration, actual, 40, 0.5, random) >= 2);
    const double yaw =
        (nominal.T_left_right.rotation().inverse() * calibration.rig().T_left_right.rotation()).log()(1);
    const double sigma = std::sqrt(calibration.drift().covariance()(1, 1));
    CHECK(sigma < 1e-4);
    CHECK(std::abs(yaw - 3e-4) < 4.5 * sigma);
  }

  TEST_CASE("SelfCalibration: nothing to see, nothing to correct") {
    cairn::Random random(cairn_test::seed());
    const cairn::StereoRig nominal = cairn_test::rectified_rig(0.5);
    SelfCalibration calibration(nominal, options);
    for (int k = 0; k < 40; ++k) CHECK_FALSE(calibration.observe(SE3(), {}));
    CHECK((calibration.rig().T_left_right.matrix() - nominal.T_left_right.matrix()).cwiseAbs().maxCoeff() <
          1e-15);
  }
}

}  // namespace self_calibration_test
