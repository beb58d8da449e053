// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Real stereo tracks without images: KITTI 00, frames 0 to 76, 52,544 observations of 15,638 landmarks, and
/// the trajectory of ORB-SLAM2 to compare with. For the test and the scoreboard of the stereo pose.
#pragma once

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/triangulation.hpp>

#include "support/elimination.hpp"

namespace cairn_test {

struct TrackedFrame {
  std::map<int, cairn::Vector<4>> observations;  ///< by landmark: left u, v, right u, v
  cairn::SE3 reference;                          ///< T_world_camera of ORB-SLAM2
};

struct StereoTracks {
  cairn::StereoRig rig;
  std::vector<TrackedFrame> frames;
};

/// Reads stereo_tracks_kitti00 and trajectories/KITTI_00_ORB.txt below the data folder.
inline StereoTracks read_stereo_tracks(const std::filesystem::path& data) {
  const std::filesystem::path folder = data / "stereo_tracks_kitti00";
  StereoTracks tracks;
  std::ifstream calibration(folder / "VO_calibration00.txt");
  double fx = 0, fy = 0, skew = 0, u0 = 0, v0 = 0, baseline = 0;
  if (!(calibration >> fx >> fy >> skew >> u0 >> v0 >> baseline))
    cairn::raise("no calibration of the stereo tracks");
  const cairn::PinholeCamera camera({.fx = fx, .fy = fy, .cx = u0, .cy = v0, .width = 1241, .height = 376});
  tracks.rig = {camera, camera, cairn::SE3(cairn::SO3(), cairn::Vector<3>(baseline, 0, 0))};

  tracks.frames.resize(77);
  std::ifstream observations(folder / "VO_stereo_factors00s.txt");
  std::size_t frame = 0;
  int landmark = 0;
  double u_left = 0, u_right = 0, v = 0, x = 0, y = 0, z = 0;
  while (observations >> frame >> landmark >> u_left >> u_right >> v >> x >> y >> z)
    tracks.frames.at(frame).observations[landmark] = {u_left, v, u_right, v};

  std::ifstream poses(data / "trajectories" / "KITTI_00_ORB.txt");
  for (TrackedFrame& tracked : tracks.frames) {
    cairn::Matrix<4> m = cairn::Matrix<4>::Identity();
    for (int i = 0; i < 12; ++i)
      if (!(poses >> m(i / 4, i % 4)))
        cairn::raise("the reference trajectory of the stereo tracks is too short");
    tracked.reference = cairn::SE3::from_matrix(m);
  }
  return tracks;
}

/// Root mean square errors of the motion from frame to frame, and the distance between the ends.
struct TrackError {
  double metres = 0, degrees = 0, end_metres = 0;
  int lost = 0;
};

namespace tracks_detail {

/// A landmark's position by one observation and its covariance, camera frame; the row is measured once.
struct Sighting {
  cairn::Vector<3> point;
  cairn::Matrix<3> covariance;
};

inline Sighting sighting(const cairn::StereoRig& rig, const cairn::Vector<4>& pixels, double sigma) {
  const double f = rig.left.fx(), b = rig.baseline(), d = pixels(0) - pixels(2);
  const cairn::Vector<3> p((pixels(0) - rig.left.cx()) * b / d, (pixels(1) - rig.left.cy()) * b / d,
                           f * b / d);
  cairn::Matrix<3> J;  // by left u, right u, v
  J << (b - p(0)) / d, p(0) / d, 0, -p(1) / d, p(1) / d, b / d, -p(2) / d, p(2) / d, 0;
  return {p, sigma * sigma * J * J.transpose()};
}

inline cairn::StereoMatch match(const cairn::Vector<4>& pixels, const Sighting& landmark, double sigma) {
  return {landmark.point, landmark.covariance, pixels.head<2>(), pixels.tail<2>(), sigma, sigma};
}

/// Static landmark, F = H = I; sightings further than four sigmas are left out.
inline void fuse(Sighting& map, const Sighting& seen) {
  const cairn::Matrix<3> S = map.covariance + seen.covariance;
  const cairn::Vector<3> innovation = seen.point - map.point;
  if (normalised_square(S, innovation) > 16) return;
  const cairn::Matrix<3> gain = solved(S, map.covariance).transpose();
  map.point += gain * innovation;
  map.covariance = cairn::symmetrised(map.covariance - gain * map.covariance);
}

}  // namespace tracks_detail

/// Poses every frame against the previous one's points (`fused` false), or against landmarks fused by Kalman
/// filters over all frames so far.
inline TrackError run_stereo_tracks(const StereoTracks& tracks, bool fused, double sigma = 0.5) {
  namespace detail = tracks_detail;
  cairn::StereoPoseOptions options;
  options.right_rows = false;
  std::map<int, detail::Sighting> map;
  cairn::SE3 pose;  // T_world_camera; the world is the first camera
  TrackError error;
  for (std::size_t k = 0; k < tracks.frames.size(); ++k) {
    const auto& frame = tracks.frames[k];
    if (k > 0) {
      std::vector<cairn::StereoMatch> matches;
      for (const auto& [id, pixels] : frame.observations)
        if (const auto known = map.find(id); known != map.end())
          matches.push_back(detail::match(pixels, known->second, sigma));
      const cairn::StereoPose found = cairn::estimate_stereo_pose(tracks.rig, matches, options);
      error.lost += !found.good();
      const cairn::SE3 previous = fused ? pose : cairn::SE3();
      const cairn::SE3 step = previous.inverse() * found.T_world_camera;
      const cairn::Vector<6> e =
          cairn::local(tracks.frames[k - 1].reference.inverse() * frame.reference, step);
      error.metres += e.head<3>().squaredNorm();
      error.degrees += e.tail<3>().squaredNorm();
      pose = pose * step;
    }
    if (!fused) map.clear();
    const cairn::SE3 frame_pose = fused ? pose : cairn::SE3();
    const cairn::Matrix<3> R = frame_pose.rotation().matrix();
    for (const auto& [id, pixels] : frame.observations) {
      detail::Sighting seen = detail::sighting(tracks.rig, pixels, sigma);
      seen = {frame_pose * seen.point, R * seen.covariance * R.transpose()};
      if (const auto [known, fresh] = map.emplace(id, seen); !fresh) detail::fuse(known->second, seen);
    }
  }
  const auto steps = static_cast<double>(tracks.frames.size() - 1);
  error.metres = std::sqrt(error.metres / steps);
  error.degrees = std::sqrt(error.degrees / steps) * 180 / M_PI;
  const cairn::SE3 end = tracks.frames.front().reference.inverse() * tracks.frames.back().reference;
  error.end_metres = (pose.translation() - end.translation()).norm();
  return error;
}

}  // namespace cairn_test
