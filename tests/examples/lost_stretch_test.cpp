// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "lost_stretch.hpp"

#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/random.hpp>

#include "support/random.hpp"

namespace lost_stretch_test {
namespace {

using cairn::Matrix;
using cairn::SE3;
using cairn::Vector;
using stereo_slam::FrameRecord;
using stereo_slam::lay_lost_frames;
using stereo_slam::Moving;
using stereo_slam::SteadyTwist;

/// The process in steps of h seconds, drawn from its own noise.
std::vector<SE3> path_of(const Vector<6>& twist, const SteadyTwist& process, double h, int steps,
                         cairn::Random& random) {
  Moving x(SE3(), twist);
  std::vector<SE3> path{x.part<0>()};
  for (int i = 0; i < steps; ++i) {
    const cairn::Cholesky<12> root(process.noise(x, {}, h));
    Vector<12> n;
    for (int k = 0; k < 12; ++k) n(k) = random.normal(0, 1);
    x = cairn::retract(process.propagate(x, {}, h), Vector<12>(root.lower() * n));
    path.push_back(x.part<0>());
  }
  return path;
}

/// Frames along a steady twist, a tenth of a second from each other, all tracked.
std::vector<FrameRecord> steady(const Vector<6>& twist, std::size_t count) {
  std::vector<FrameRecord> frames(count);
  for (std::size_t i = 0; i < count; ++i) {
    frames[i].time = 0.1 * static_cast<double>(i);
    frames[i].T_world_camera = SE3::exp(Vector<6>(frames[i].time * twist));
    frames[i].covariance = 1e-4 * Matrix<6>::Identity();
    frames[i].tracked = true;
  }
  return frames;
}

/// As a run leaves it: the last pose and its covariance.
void lose(std::vector<FrameRecord>& frames, std::size_t i) {
  frames[i].tracked = false;
  if (i == 0) return;
  frames[i].T_world_camera = frames[i - 1].T_world_camera;
  frames[i].covariance = frames[i - 1].covariance;
}

double apart(const SE3& a, const SE3& b) {
  return cairn::local(a, b).norm();
}

const Vector<6> twist = (Vector<6>() << 0.3, -0.1, 8, 0.02, 0.3, -0.01).finished();

}  // namespace

TEST_SUITE_BEGIN("stereo_slam/lost_stretch");

TEST_CASE("lost_stretch: a pose between two is off by what white acceleration leaves") {
  CAPTURE(cairn_test::seed());
  cairn::Random random(cairn_test::seed());
  const SteadyTwist process{0.7, 0.2};
  constexpr int steps = 20, runs = 3000;
  constexpr double h = 0.02, duration = steps * h;
  Vector<6> slow = 0.1 * twist;
  for (const int at : {3, 10, 16}) {
    Matrix<6> sum = Matrix<6>::Zero();
    for (int i = 0; i < runs; ++i) {
      const std::vector<SE3> path = path_of(slow, process, h, steps, random);
      const auto pose = stereo_slam::pose_between(
          {path.front(), Matrix<6>::Zero()}, {path.back(), Matrix<6>::Zero()}, at * h, duration, process);
      const Vector<6> d = cairn::local(pose.mean, path[static_cast<std::size_t>(at)]);
      sum += d * d.transpose() / runs;
    }
    const Matrix<6> P = stereo_slam::pose_between({SE3(), Matrix<6>::Zero()}, {SE3(), Matrix<6>::Zero()},
                                                  at * h, duration, process)
                            .covariance;
    for (int i = 0; i < 6; ++i)  // five standard deviations of a sample variance, 3 % for the turning
      CHECK(std::abs(sum(i, i) / P(i, i) - 1) < 5 * std::sqrt(2.0 / runs) + 0.03);
  }
}

TEST_CASE("lost_stretch: frames between others lie on the motion between them, and say how sure that is") {
  const std::vector<FrameRecord> all = steady(twist, 12);
  std::vector<FrameRecord> frames = all;
  for (const std::size_t i : {4U, 5U, 6U, 9U}) lose(frames, i);
  lay_lost_frames(frames, {});
  for (std::size_t i = 0; i < frames.size(); ++i) {
    CAPTURE(i);
    const bool lost = (i >= 4 && i <= 6) || i == 9;
    CHECK(frames[i].bridged == lost);
    CHECK(frames[i].tracked == !lost);
    CHECK(apart(frames[i].T_world_camera, all[i].T_world_camera) < 1e-12);
    CHECK((frames[i].covariance(0, 0) > 1e-4) == lost);
  }
  // A unit acceleration in the middle of 0.4 s, and a quarter in.
  CHECK(frames[5].covariance(2, 2) == doctest::Approx(1e-4 + std::pow(0.2, 4) / 1.2).scale(0));
  CHECK(frames[4].covariance(5, 5) == doctest::Approx(1e-4 + std::pow(0.1 * 0.3, 2) / 1.2).scale(0));
}

TEST_CASE(
    "lost_stretch: what lies before the first known frame stays, what lies after the last grows vague") {
  const std::vector<FrameRecord> all = steady(twist, 30);
  std::vector<FrameRecord> frames = all;
  for (std::size_t i = 0; i < 3; ++i) lose(frames, i);
  for (std::size_t i = 20; i < 30; ++i) lose(frames, i);
  const std::vector<FrameRecord> before = frames;
  lay_lost_frames(frames, {});
  for (std::size_t i = 0; i < frames.size(); ++i) {
    CAPTURE(i);
    CHECK_FALSE(frames[i].bridged);
    CHECK(apart(frames[i].T_world_camera, before[i].T_world_camera) == 0);
    if (i < 20) CHECK(frames[i].covariance == before[i].covariance);
    if (i < 20) continue;
    CHECK(frames[i].covariance(0, 0) > frames[i - 1].covariance(0, 0));
    // The camera went on: it is within what is said, and that is not ten times too much.
    const Vector<6> gone = cairn::local(frames[i].T_world_camera, all[i].T_world_camera);
    const double nees = cairn::Cholesky<6>(frames[i].covariance).whiten(gone).squaredNorm();
    CHECK(nees < 6);
    CHECK(nees > 0.5);
  }
}

TEST_CASE("lost_stretch: carried frames are known ones; times that stand still are no divisor") {
  std::vector<FrameRecord> frames = steady(twist, 8);
  for (std::size_t i = 2; i < 6; ++i) lose(frames, i);
  frames[2].carried = true;
  for (FrameRecord& frame : frames) frame.time = 7;
  lay_lost_frames(frames, {});
  CHECK_FALSE(frames[2].bridged);
  for (std::size_t i = 3; i < 6; ++i) {
    CHECK(frames[i].bridged);
    const double part = static_cast<double>(i - 2) / 4;
    const Vector<6> whole = cairn::local(frames[2].T_world_camera, frames[6].T_world_camera);
    CHECK(apart(frames[i].T_world_camera, cairn::retract(frames[2].T_world_camera, Vector<6>(part * whole))) <
          1e-12);
  }
  std::vector<FrameRecord> none, never(3);
  lay_lost_frames(none, {});
  lay_lost_frames(never, {});
  for (const FrameRecord& frame : never) CHECK_FALSE(frame.bridged);
}

TEST_SUITE_END();

}  // namespace lost_stretch_test
