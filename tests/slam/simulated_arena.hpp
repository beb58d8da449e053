// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A stereo camera that drives laps in an arena of points, with known association: what a map's covariance is
/// held against. No images, and no code of the map.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include <cairn/core/random.hpp>
#include <cairn/eval/consistency.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/slam/keyframe_map.hpp>

namespace cairn_test {

inline cairn::StereoRig arena_rig() {
  const cairn::PinholeCamera camera(
      {.fx = 1055, .fy = 1055, .cx = 383.5, .cy = 287.5, .width = 768, .height = 576});
  return {camera, camera, cairn::SE3(cairn::SO3(), cairn::Vector<3>(0.2, 0, 0))};
}

struct ArenaOptions {
  std::uint64_t seed = 1;
  int frames = 429;
  int frames_a_lap = 200;
  double sigma = 0.4;     ///< [pixels]
  double bias_share = 0;  ///< of the variance, that stays while a landmark stays in view
  double detected = 0.7;  ///< share of the points in view that a frame shows
  int points = 4200;
  cairn::StereoRig rig = arena_rig();  ///< that sees it
};

struct ArenaFrame {
  cairn::SE3 T_world_camera;
  std::vector<cairn::StereoSighting> sightings;  ///< ascending landmarks
};

/// The camera of a frame: on a circle of 15 m, looking along it, with a little heave, pitch and roll.
inline cairn::SE3 arena_pose(const ArenaOptions& options, int frame) {
  const double turn = 2 * std::numbers::pi * frame / options.frames_a_lap,
               radius = 15 / (2 * std::numbers::pi);
  const cairn::Vector<3> place(radius * (1 - std::cos(turn)), 0.02 * std::sin(3 * turn),
                               radius * std::sin(turn));
  const cairn::SO3 yaw = cairn::SO3::exp(cairn::Vector<3>(0, turn, 0));
  return {yaw * cairn::SO3::exp(cairn::Vector<3>(0.01 * std::sin(5 * turn), 0, 0.01 * std::sin(2 * turn))),
          place};
}

/// The frames in the world of the first camera.
inline std::vector<ArenaFrame> arena_frames(const ArenaOptions& options) {
  cairn::Random random(options.seed, 1);
  const double centre = 15 / (2 * std::numbers::pi);
  std::vector<cairn::Vector<3>> points;
  for (int i = 0; i < options.points; ++i) {
    const double along = random.uniform(-5, 5), height = random.uniform(-0.9, 0.6);
    cairn::Vector<3> p(centre + along, height, 5);
    if (i % 5 == 0)
      p = {centre + along, height, random.uniform(-5, 5)};
    else if (i % 5 == 1)
      p(2) = -5;
    else if (i % 5 == 2)
      p = {centre + 5, height, along};
    else if (i % 5 == 3)
      p = {centre - 5, height, along};
    points.push_back(p);
  }
  const cairn::StereoRig& rig = options.rig;
  const cairn::SE3 T_world_first = arena_pose(options, 0);
  std::vector<cairn::Vector<4>> bias(points.size());
  std::vector<int> last(points.size(), -1000);
  std::vector<ArenaFrame> frames;
  const double lasting = options.sigma * std::sqrt(options.bias_share),
               passing = options.sigma * std::sqrt(1 - options.bias_share);
  for (int f = 0; f < options.frames; ++f) {
    ArenaFrame frame{T_world_first.inverse() * arena_pose(options, f), {}};
    const cairn::SE3 T_camera_arena = arena_pose(options, f).inverse();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const cairn::Vector<3> p = T_camera_arena * points[i];
      if (p(2) < 0.6 || p(2) > 7) continue;
      const auto pixels = rig.project(p);
      if (!pixels || !rig.left.contains(pixels->head<2>()) || !rig.right.contains(pixels->tail<2>()))
        continue;
      if (f - last[i] > 20)
        for (int k = 0; k < 4; ++k) bias[i](k) = lasting * random.normal();
      last[i] = f;
      if (random.uniform() > options.detected) continue;
      cairn::StereoSighting s;
      s.landmark = static_cast<std::uint32_t>(i);
      s.sigma = options.sigma;
      for (int k = 0; k < 2; ++k) {
        s.left(k) = (*pixels)(k) + bias[i](k) + passing * random.normal();
        s.right(k) = (*pixels)(2 + k) + bias[i](2 + k) + passing * random.normal();
      }
      frame.sightings.push_back(s);
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

inline cairn::StereoRig car_rig() {
  const cairn::PinholeCamera camera(
      {.fx = 707, .fy = 707, .cx = 602, .cy = 183, .width = 1226, .height = 370});
  return {camera, camera, cairn::SE3(cairn::SO3(), cairn::Vector<3>(0.537, 0, 0))};
}

/// Straight down a street, 0.9 m a frame, between walls and over the ground: most landmarks are first seen
/// from 20 to 150 times as far as the baseline is long, where noise in the disparity is no longer small.
inline std::vector<ArenaFrame> street_frames(std::uint64_t seed, int count, double sigma = 0.4) {
  cairn::Random random(seed, 3);
  const cairn::StereoRig rig = car_rig();
  const double length = count + 100.0;
  std::vector<cairn::Vector<3>> points;
  for (int i = 0; i < static_cast<int>(15 * length); ++i) {
    const double along = random.uniform(0, length);
    if (i % 5 == 0)
      points.emplace_back(random.uniform(-5, 5), 1.65, along);
    else
      points.emplace_back((i % 5 < 3 ? 1 : -1) * random.uniform(5, 12), random.uniform(-5, 1.6), along);
  }
  std::vector<ArenaFrame> frames;
  for (int f = 0; f < count; ++f) {
    ArenaFrame frame{cairn::SE3(cairn::SO3(), cairn::Vector<3>(0, 0, 0.9 * f)), {}};
    for (std::size_t i = 0; i < points.size(); ++i) {
      const cairn::Vector<3> p = points[i] - frame.T_world_camera.translation();
      if (p(2) < 3 || p(2) > 80) continue;
      const auto pixels = rig.project(p);
      if (!pixels || !rig.left.contains(pixels->head<2>()) || !rig.right.contains(pixels->tail<2>()) ||
          random.uniform() > 0.6)
        continue;
      cairn::StereoSighting s;
      s.landmark = static_cast<std::uint32_t>(i);
      s.sigma = sigma;
      for (int k = 0; k < 2; ++k) {
        s.left(k) = (*pixels)(k) + sigma * random.normal();
        s.right(k) = (*pixels)(2 + k) + sigma * random.normal();
      }
      frame.sightings.push_back(s);
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

/// What became of a run.
struct ArenaRun {
  cairn::Vector<6> last_error = cairn::Vector<6>::Zero();  ///< of the last pose that was found, its own axes
  cairn::Matrix<6> last_covariance = cairn::Matrix<6>::Zero();
  std::vector<double> nees;
  std::vector<double> off;             ///< how far each pose is from the true one [m]
  std::vector<std::size_t> keyframes;  ///< after each frame
  double rms_position = 0;
  double rms_sigma = 0;  ///< what the covariances make of it, whatever the noise of this run
  int lost = 0;
  [[nodiscard]] double mean_nees(std::size_t begin = 0,
                                 std::size_t end = static_cast<std::size_t>(-1)) const {
    double sum = 0;
    end = std::min(end, nees.size());
    for (std::size_t i = begin; i < end; ++i) sum += nees[i];
    return sum / static_cast<double>(end - begin);
  }
};

struct ArenaRule {
  double unknown = 0.3;  ///< a keyframe where more of a frame's points than this share are not in the map
  int apart = 5;         ///< and so many frames after the last one
};

/// Drives the map over the frames, as a pipeline does: robust pose on the landmarks, then the map's.
inline ArenaRun run_arena(const std::vector<ArenaFrame>& frames, cairn::KeyframeMap& map,
                          const ArenaRule& rule = {}) {
  ArenaRun run;
  map.begin(cairn::SE3());
  for (const cairn::StereoSighting& s : frames[0].sightings) static_cast<void>(map.add_landmark(s));
  cairn::SE3 pose;
  int since = 0;
  double squares = 0, variances = 0;
  for (std::size_t f = 1; f < frames.size(); ++f) {
    std::vector<cairn::StereoSighting> known, unknown;
    std::vector<cairn::StereoMatch> matches;
    for (const cairn::StereoSighting& s : frames[f].sightings) {
      const auto landmark = map.landmark(s.landmark);
      if (!landmark) {
        unknown.push_back(s);
        continue;
      }
      known.push_back(s);
      matches.push_back({landmark->mean, landmark->covariance, s.left, s.right, s.sigma, s.sigma});
    }
    const cairn::StereoPose start = cairn::refine_stereo_pose(map.rig(), matches, pose);
    const cairn::MapLocation here = map.locate(start.T_world_camera, known);
    ++since;
    if (!start.good() || !here.good()) {
      ++run.lost;
      continue;
    }
    pose = here.T_world_camera;
    const auto error = cairn::local(pose, frames[f].T_world_camera);
    run.nees.push_back(cairn::normalised_squared(error, here.covariance).value());
    run.last_error = error;
    run.last_covariance = here.covariance;
    run.off.push_back(error.head<3>().norm());
    squares += error.head<3>().squaredNorm();
    variances += here.covariance.topLeftCorner<3, 3>().trace();
    const double share =
        static_cast<double>(unknown.size()) / static_cast<double>(frames[f].sightings.size());
    if (share > rule.unknown && since >= rule.apart && map.add_keyframe(here, known)) {
      for (const cairn::StereoSighting& s : unknown) static_cast<void>(map.add_landmark(s));
      since = 0;
    }
    run.keyframes.push_back(map.keyframe_count());
  }
  run.rms_position = std::sqrt(squares / static_cast<double>(run.nees.size()));
  run.rms_sigma = std::sqrt(variances / static_cast<double>(run.nees.size()));
  return run;
}

}  // namespace cairn_test
