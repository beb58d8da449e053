// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "drive.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/random.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>

namespace gamma_slam {

namespace {

using cairn::Matrix;
using cairn::Random;
using cairn::SE2;
using cairn::SE3;
using cairn::SO3;
using cairn::Vector;

constexpr int width = 512, height = 384;
constexpr double focal = 400, baseline = 0.3;       // [pixels], [m]
constexpr double camera_height = 1.2, tilt = 0.35;  // [m] above the wheels, [rad] down
constexpr double reach = 12;                        // [m] of rays
constexpr double largest_height_sigma = 0.03;       // [m]: points that are worse are left out
constexpr int most_in_square = 5;                   // points of a scan in 0.2 m x 0.2 m
constexpr double lap_length = 80, without_texture_from = 30, without_texture_to = 50;  // [m]

cairn::StereoRig rig() {
  const cairn::PinholeCamera camera(
      {.fx = focal, .fy = focal, .cx = 0.5 * width, .cy = 0.5 * height, .width = width, .height = height});
  return {camera, camera, SE3(SO3(), Vector<3>(baseline, 0, 0))};
}

/// The closed track, by the length along it.
SE2 on_track(double along) {
  const double mean_radius = lap_length / (2 * std::numbers::pi) * 0.985;  // the swerves make it longer
  const auto place = [&](double s) {
    const double a = 2 * std::numbers::pi * s / lap_length, r = mean_radius * (1 + 0.06 * std::sin(3 * a));
    return Vector<2>(r * std::cos(a), r * std::sin(a));
  };
  const Vector<2> ahead = place(along + 0.01) - place(along - 0.01), here = place(along);
  return SE2(here(0), here(1), std::atan2(ahead(1), ahead(0)));
}

/// The vehicle on the ground: x ahead, y to the left, z up its own way.
SE3 standing(const Terrain& terrain, const SE2& pose) {
  const double c = std::cos(pose.angle()), s = std::sin(pose.angle()), half = 0.5;
  const auto ground = [&](double ahead, double left) {
    return terrain.height(pose.x() + c * ahead - s * left, pose.y() + s * ahead + c * left);
  };
  const double front = ground(half, 0), back = ground(-half, 0), left = ground(0, half),
               right = ground(0, -half);
  const SO3 heading = SO3::exp(Vector<3>(0, 0, pose.angle()));
  const SO3 pitch = SO3::exp(Vector<3>(0, -std::atan2(front - back, 2 * half), 0));
  const SO3 roll = SO3::exp(Vector<3>(std::atan2(left - right, 2 * half), 0, 0));
  return SE3(heading * pitch * roll, Vector<3>(pose.x(), pose.y(), 0.25 * (front + back + left + right)));
}

/// The left camera on the vehicle: x right, y down, z ahead and a little down.
SE3 mounted() {
  Matrix<3> axes;
  axes << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return SE3(SO3::from_matrix(axes) * SO3::exp(Vector<3>(-tilt, 0, 0)), Vector<3>(0, 0, camera_height));
}

/// Pitch and roll of the vehicle as the accelerometer has them, with no heading and no place.
SO3 levelled(const SE3& T_world_vehicle, double sigma, Random& random) {
  const Matrix<3> R = T_world_vehicle.rotation().matrix();
  const SO3 unturned = SO3::exp(Vector<3>(0, 0, -std::atan2(R(1, 0), R(0, 0)))) * T_world_vehicle.rotation();
  const double pitch = sigma * random.normal(), roll = sigma * random.normal();
  return SO3::exp(Vector<3>(roll, pitch, 0)) * unturned;
}

/// What the camera sees of the ground by its disparity, by rays a few pixels apart.
std::vector<GroundPoint> seen_ground(const Terrain& terrain, const SE3& T_world_camera, const SO3& level,
                                     const DriveOptions& options, Random& random) {
  constexpr int every = 6;  // pixels
  const SE3 T_camera_world = T_world_camera.inverse(),
            T_level_camera = SE3(level, Vector<3>::Zero()) * mounted();
  std::map<std::pair<int, int>, int> taken;  // points of each square, from the vehicle
  std::vector<GroundPoint> points;
  for (int v = every / 2; v < height; v += every)
    for (int u = every / 2; u < width; u += every) {
      const Vector<3> ray = Vector<3>((u - 0.5 * width) / focal, (v - 0.5 * height) / focal, 1).normalized();
      const auto ground =
          terrain.hit(T_world_camera.translation(), T_world_camera.rotation().rotate(ray), reach);
      if (!ground) continue;
      Vector<3> world = *ground;
      world(2) += terrain.roughness(world(0), world(1)) * random.normal();
      const Vector<3> p = T_camera_world * world;
      const double disparity = focal * baseline / p(2) + options.disparity_sigma * random.normal();
      if (!(disparity > 1)) continue;
      const Vector<3> q = T_level_camera * Vector<3>(p * (focal * baseline / disparity / p(2)));
      const double along_ray = options.disparity_sigma * q.norm() / disparity;
      const double grazing = std::abs(q(2) - camera_height) / q.norm();
      if (!(along_ray * grazing < largest_height_sigma) || q.norm() > 0.8 * reach) continue;
      const auto square = [](double x) { return static_cast<int>(std::floor(x / 0.2)); };
      if (taken[{square(q(0)), square(q(1))}]++ < most_in_square) points.push_back({q(0), q(1), q(2)});
    }
  return points;
}

/// Points of the ground that both looks see, followed with noise.
std::vector<cairn::StereoMatch> followed(const Terrain& terrain, const SE3& before, const SE3& now,
                                         std::size_t count, double sigma, double disparity_error,
                                         const DriveOptions& options, Random& random) {
  const cairn::StereoRig cameras = rig();
  const auto noisy = [&](double pixel) { return random.normal(pixel, sigma); };
  const double shift_u = options.common_sigma * random.normal(),
               shift_v = options.common_sigma * random.normal();
  std::vector<cairn::StereoMatch> matches;
  for (std::size_t tries = 0; matches.size() < count && tries < 20 * count; ++tries) {
    const double ray_y = random.uniform(-0.5, 0.5) * height / focal,
                 ray_x = random.uniform(-0.5, 0.5) * width / focal;
    const Vector<3> ray = Vector<3>(ray_x, ray_y, 1).normalized();
    const auto ground = terrain.hit(before.translation(), before.rotation().rotate(ray), 2 * reach);
    if (!ground) continue;
    const auto first = cameras.project(before.inverse() * *ground),
               second = cameras.project(now.inverse() * *ground);
    if (!first || !second || (*second)(0) < 0 || (*second)(0) > width || (*second)(1) < 0 ||
        (*second)(1) > height)
      continue;
    // Triangulated from the first look's noisy pixels, with the covariance that they give.
    const double u = noisy((*first)(0)), v = noisy((*first)(1)), right = noisy((*first)(2)) - disparity_error;
    if (!(u - right > 2)) continue;
    const double z = focal * baseline / (u - right), x = (u - 0.5 * width) / focal,
                 y = (v - 0.5 * height) / focal;
    Matrix<3> J;  // of the point by (u, v, right)
    const double by_disparity = -z / (u - right);
    J << z / focal + x * by_disparity, 0, -x * by_disparity,  //
        y * by_disparity, z / focal, -y * by_disparity,       //
        by_disparity, 0, -by_disparity;
    const double variance = sigma * sigma;
    matches.push_back(
        {.landmark = {x * z, y * z, z},
         .covariance = variance * J * J.transpose(),
         .left = {noisy((*second)(0)) + shift_u, noisy((*second)(1)) + shift_v},
         .right = {noisy((*second)(2)) + shift_u - disparity_error, noisy((*second)(3)) + shift_v},
         .sigma_left = sigma,
         .sigma_right = sigma});
  }
  return matches;
}

/// Covariance of the guess that the last step is made again: a vehicle hardly changes its step by more than
/// 0.3 m or 0.1 rad from one look to the next. It weighs nothing beside sixty sharp points, and stands alone
/// where a few blurred ones leave the motion open.
[[nodiscard]] Matrix<6> kept_step() {
  constexpr double step_sigma = 0.3, turn_sigma = 0.1;
  Matrix<6> covariance = Matrix<6>::Zero();
  covariance.diagonal() << Vector<3>::Constant(step_sigma * step_sigma),
      Vector<3>::Constant(turn_sigma * turn_sigma);
  return covariance;
}

/// A motion in space as one in the plane, with pitch and roll of both ends by the accelerometer.
void put_motion(TerrainScan& scan, const SE3& T_before_now, const Matrix<6>& covariance,
                const SO3& level_before, const SO3& level_now) {
  const Vector<3> t = level_before.rotate(T_before_now.translation());
  const Matrix<3> R = (level_before * T_before_now.rotation() * level_now.inverse()).matrix();
  const double turn = std::atan2(R(1, 0), R(0, 0));
  scan.moved = SE2(t(0), t(1), turn);
  scan.climbed = t(2);
  // Steps on the right are the vehicle's, which is nearly level.
  const Eigen::Index of[] = {0, 1, 5};
  for (Eigen::Index i = 0; i < 3; ++i)
    for (Eigen::Index j = 0; j < 3; ++j) scan.moved_covariance(i, j) = covariance(of[i], of[j]);
  scan.climbed_variance = covariance(2, 2);
}

}  // namespace

Drive simulated_drive(const DriveOptions& options) {
  Random random(options.seed, 23);
  Drive drive;
  const Terrain& terrain = drive.terrain.emplace(std::uint64_t{5});
  const double disparity_error = options.rig_sigma * random.normal();
  const double level_sigma = options.level_sigma * std::numbers::pi / 180;
  const SE3 T_vehicle_camera = mounted();
  SE3 before;
  SO3 level_before;
  SE3 guess(SO3(), Vector<3>(options.step, 0, 0));
  const auto count = static_cast<std::size_t>(options.laps * lap_length / options.step) + 1;
  for (std::size_t i = 0; i < count; ++i) {
    const double along = options.step * static_cast<double>(i), of_lap = std::fmod(along, lap_length);
    drive.truth.push_back(on_track(along));
    const SE3 T_world_vehicle = standing(terrain, drive.truth.back());
    const SE3 now = T_world_vehicle * T_vehicle_camera;
    const SO3 level = levelled(T_world_vehicle, level_sigma, random);
    TerrainScan scan;
    scan.time = 0.5 * static_cast<double>(i);
    if (i > 0) {
      const bool bare = of_lap > without_texture_from && of_lap < without_texture_to;
      const auto matches =
          followed(terrain, before, now, bare ? options.few_matches : options.matches,
                   (bare ? options.blurred : 1) * options.pixel_sigma, disparity_error, options, random);
      const cairn::StereoPose found = cairn::estimate_stereo_pose(
          rig(), matches, {.min_inliers = 5},
          cairn::PosePrior{
              T_vehicle_camera.inverse() * guess * T_vehicle_camera,
              Matrix<6>(kept_step().diagonal().cwiseInverse().asDiagonal())});  // isotropic: the same in
                                                                                // either's axes
      Matrix<6> covariance = kept_step();
      if (found.good()) {
        guess = T_vehicle_camera * found.T_world_camera * T_vehicle_camera.inverse();
        const Matrix<6> adjoint = T_vehicle_camera.adjoint();
        covariance = adjoint * found.covariance * adjoint.transpose();
      }
      put_motion(scan, guess, covariance, level_before, level);
    }
    scan.points = seen_ground(terrain, now, level, options, random);
    drive.scans.push_back(std::move(scan));
    before = now;
    level_before = level;
  }
  return drive;
}

std::vector<SE2> odometry_path(const Drive& drive) {
  std::vector<SE2> path{drive.truth.front()};
  for (std::size_t i = 1; i < drive.scans.size(); ++i) path.push_back(path.back() * drive.scans[i].moved);
  return path;
}

}  // namespace gamma_slam
