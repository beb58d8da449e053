// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "recorded_drive.hpp"

#include <array>
#include <cmath>
#include <memory>
#include <mutex>
#include <numbers>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/random.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/index/packed_points.hpp>
#include <cairn/manifold/se3.hpp>

#include "dataset.hpp"
#include "feature_choice.hpp"
#include "stereo_matcher.hpp"

namespace gamma_slam {

namespace {

using cairn::Matrix;
using cairn::Random;
using cairn::SE2;
using cairn::SE3;
using cairn::SO3;
using cairn::Vector;

constexpr const char* truth_files =
    "kitti_raw has them in poses_cam0_rectified.txt, kitti_odometry in poses.txt, euroc in "
    "state_groundtruth_estimate0/";
constexpr double pixel_sigma = 0.35;  // of an interest point of scale 1

/// Interest points that both images of a frame have.
struct Landmarks {
  std::vector<cairn::Triangulation> points;
  std::vector<Vector<2>> left, right;
  std::vector<double> sigma;
  std::vector<float> descriptors;
  std::size_t dimension = 0;

  [[nodiscard]] cairn::Rows<float> looks() const { return {descriptors, dimension}; }
};

/// What one frame gives, by itself.
struct Frame {
  double time = 0;
  SE3 truth;
  std::string name;
  Landmarks landmarks;
  GroundView ground;
};

Landmarks landmarks_of(const stereo_slam::StereoFrame& frame, const cairn::StereoRig& rig) {
  const stereo_slam::FeatureOptions options{.points = 1500};
  const stereo_slam::Extractor left = stereo_slam::make_extractor(options),
                               right = stereo_slam::make_extractor(options);
  const cairn::Features &in_left = left(frame.left), &in_right = right(frame.right);
  const stereo_slam::StereoMatcher match(rig, {});
  const cairn::Triangulator triangulate(rig, {.max_depth = 150 * rig.baseline()});
  Landmarks found;
  found.dimension = static_cast<std::size_t>(in_left.dimension);
  for (const stereo_slam::PointPair& pair : match(frame.left, in_left, frame.right, in_right, 1)) {
    const double sigma = pixel_sigma * std::pow(in_left.keypoints[pair.left].scale, 0.65);
    const cairn::Triangulation point = triangulate(pair.left_pixel, pair.right_pixel, sigma, sigma);
    if (!point.good()) continue;
    found.points.push_back(point);
    found.left.push_back(pair.left_pixel);
    found.right.push_back(pair.right_pixel);
    found.sigma.push_back(sigma);
    const auto look = in_left.descriptor(pair.left);
    found.descriptors.insert(found.descriptors.end(), look.begin(), look.end());
  }
  return found;
}

Frame frame_of(const stereo_slam::Dataset& data, std::size_t i, const GroundStereo& ground) {
  const stereo_slam::StereoFrame images = data.frame(i);
  if (!images.truth)
    cairn::raise(images.name + std::string(" has no true pose, by which errors are measured: ") +
                 truth_files);
  const auto view = ground(images.left, images.right, i);
  if (!view) cairn::raise(images.name + " shows no plane below the camera");
  return {images.time, *images.truth, images.name, landmarks_of(images, data.rig()), *view};
}

/// The frames before the first that cannot be used, and why that is so.
struct Frames {
  std::vector<Frame> all;
  std::optional<std::string> why_no_more;

  void end_at(std::size_t count, const std::string& why) {
    if (count < 2) cairn::raise(why);
    all.resize(count);
    why_no_more = why;
  }
};

Frames frames_of(const stereo_slam::Dataset& data, const RecordedDriveOptions& options,
                 const std::function<std::optional<std::string>()>& on_frame) {
  const GroundStereo ground(data.rig(), options.ground);
  Frames frames{std::vector<Frame>(data.size()), {}};
  std::mutex one_at_a_time;  // for what follows
  std::size_t good = data.size();
  std::string why;
  std::optional<std::string> interrupted;
  const auto is_wanted = [&](std::size_t i) {
    const std::lock_guard lock(one_at_a_time);
    return i < good && !interrupted;
  };
  cairn::parallel_for(data.size(), options.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end && is_wanted(i); ++i) {
      std::string failed;
      try {
        frames.all[i] = frame_of(data, i, ground);
      } catch (const cairn::Error& error) {
        failed = error.what();
      }
      const std::lock_guard lock(one_at_a_time);
      if (!failed.empty() && i < good) {
        good = i;
        why = failed;
      }
      if (on_frame && !interrupted) interrupted = on_frame();
    }
  });
  if (interrupted) throw Interrupted(*interrupted);
  if (good < data.size()) frames.end_at(good, why);
  return frames;
}

/// Where the camera was at `now`, seen from `before`.
cairn::StereoPose moved(const cairn::StereoRig& rig, const Frame& before, const Frame& now,
                        const SE3& guess) {
  const Landmarks &old = before.landmarks, &seen = now.landmarks;
  std::vector<cairn::StereoMatch> matches;
  if (!old.points.empty() && !seen.points.empty()) {
    const cairn::PackedPoints looks(old.looks());
    for (const cairn::Match& m : cairn::match(looks, seen.looks(), {.ratio = 1.25F, .max_distance = 0.5F}))
      matches.push_back({.landmark = old.points[m.id].point,
                         .covariance = old.points[m.id].covariance,
                         .left = seen.left[m.query],
                         .right = seen.right[m.query],
                         .sigma_left = seen.sigma[m.query],
                         .sigma_right = seen.sigma[m.query]});
  }
  return cairn::estimate_stereo_pose(rig, matches, {}, cairn::PosePrior{guess});
}

/// The camera's motion as the vehicle's in the plane, both ends levelled by their ground.
TerrainScan step_of(const cairn::StereoPose& pose, const GroundView& before, const GroundView& now) {
  const SO3& level = before.R_level_camera;
  const Vector<3> t = level.rotate(pose.T_world_camera.translation());
  const Matrix<3> R = (level * pose.T_world_camera.rotation() * now.R_level_camera.inverse()).matrix();
  TerrainScan scan;
  scan.moved = SE2(t(0), t(1), std::atan2(R(1, 0), R(0, 0)));
  scan.climbed = t(2) - (now.camera_height - before.camera_height);
  Matrix<6> turned = Matrix<6>::Zero();  // steps on the right: from the camera's axes to the vehicle's
  turned.topLeftCorner<3, 3>() = turned.bottomRightCorner<3, 3>() = now.R_level_camera.matrix();
  const Matrix<6> covariance = turned * pose.covariance * turned.transpose();
  const std::array<Eigen::Index, 3> of{0, 1, 5};
  for (Eigen::Index i = 0; i < 3; ++i)
    for (Eigen::Index j = 0; j < 3; ++j)
      scan.moved_covariance(i, j) =
          covariance(of[static_cast<std::size_t>(i)], of[static_cast<std::size_t>(j)]);
  constexpr double height_sigma = 0.02;  // [m], of the plane's
  scan.climbed_variance = covariance(2, 2) + height_sigma * height_sigma;
  return scan;
}

void perturb(TerrainScan& scan, const OdometryNoise& noise, Random& random) {
  const double d = scan.moved.translation().norm();
  const Vector<3> sigma(noise.along * d, noise.side * d, noise.turn * std::numbers::pi / 180);
  const double turn = random.normal(), side = random.normal(), along = random.normal();
  scan.moved = cairn::retract(scan.moved, Vector<3>(sigma.cwiseProduct(Vector<3>(along, side, turn))));
  scan.moved_covariance += Matrix<3>(sigma.cwiseAbs2().asDiagonal());
}

/// Every second point, from the first or from the second on.
std::vector<GroundPoint> half_of(const std::vector<GroundPoint>& points, std::size_t first) {
  std::vector<GroundPoint> half;
  for (std::size_t i = first; i < points.size(); i += 2) half.push_back(points[i]);
  return half;
}

/// The camera's true pose as the vehicle's in the plane, from the first one.
SE2 in_plane(const SE3& first, const SE3& pose, const SO3& level) {
  const SE3 T = first.inverse() * pose;
  const Vector<3> t = level.rotate(T.translation());
  const Vector<3> ahead = level.rotate(T.rotation().rotate(Vector<3>(0, 0, 1)));
  return SE2(t(0), t(1), std::atan2(ahead(1), ahead(0)));
}

}  // namespace

std::shared_ptr<const stereo_slam::Dataset> opened_recording(const RecordedDriveOptions& options) {
  stereo_slam::DatasetOptions which;
  which.kind = options.kind;
  which.folder = options.folder;
  which.frames = options.frames;
  which.threads = options.threads;
  std::shared_ptr<const stereo_slam::Dataset> data = stereo_slam::open_dataset(which);
  if (data->size() < 2) cairn::raise("expected a recording of at least two frames");
  return data;
}

std::size_t frame_count(const stereo_slam::Dataset& data) {
  return data.size();
}

Drive recorded_drive(const stereo_slam::Dataset& data, const RecordedDriveOptions& options,
                     const std::function<std::optional<std::string>()>& on_frame,
                     const std::function<std::optional<std::string>()>& on_step) {
  Frames found = frames_of(data, options, on_frame);
  const std::vector<Frame>& frames = found.all;
  Drive drive;
  drive.name = data.name() + ", there and back";
  const auto add = [&](std::size_t frame, TerrainScan scan, double time, bool back) {
    scan.time = time;
    scan.points = half_of(frames[frame].ground.points, back ? 1 : 0);
    drive.truth.push_back(in_plane(frames[0].truth, frames[frame].truth, frames[0].ground.R_level_camera));
    drive.scans.push_back(std::move(scan));
  };
  Random random(options.seed, 31);
  std::vector<TerrainScan> steps;  // step i leads to frame i + 1
  SE3 guess;
  add(0, {}, frames[0].time, false);
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const cairn::StereoPose pose = moved(data.rig(), frames[i - 1], frames[i], guess);
    if (!pose.good()) {
      found.end_at(i, "visual odometry failed at " + frames[i].name + ": " + cairn::explain(pose.status));
      break;
    }
    guess = pose.T_world_camera;
    steps.push_back(step_of(pose, frames[i - 1].ground, frames[i].ground));
    TerrainScan scan = steps.back();
    perturb(scan, options.noise, random);
    add(i, std::move(scan), frames[i].time, false);
    if (on_step)
      if (const auto interrupted = on_step()) throw Interrupted(*interrupted);
  }
  if (found.why_no_more)
    drive.ended_early = "ended after " + std::to_string(frames.size()) + " of " +
                        std::to_string(data.size()) +
                        " frames, and driven back from there: " + *found.why_no_more;
  const double turn = frames.back().time;
  for (std::size_t i = frames.size() - 1; i-- > 0;) {
    TerrainScan scan = steps[i];
    const Matrix<3> adjoint = scan.moved.adjoint();
    scan.moved = scan.moved.inverse();
    scan.moved_covariance = adjoint * scan.moved_covariance * adjoint.transpose();
    scan.climbed = -scan.climbed;
    perturb(scan, options.noise, random);
    add(i, std::move(scan), 2 * turn - frames[i].time, true);
  }
  return drive;
}

}  // namespace gamma_slam
