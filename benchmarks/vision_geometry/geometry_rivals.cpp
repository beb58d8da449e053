// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "geometry_rivals.hpp"

#include <vector>

#include <cairn/geometry/alignment.hpp>
#include <cairn/geometry/triangulation.hpp>

#ifdef CAIRN_BENCH_OPENCV_CALIB3D
#include <opencv2/calib3d.hpp>
#endif

namespace rivals {

#ifdef CAIRN_BENCH_OPENCV_CALIB3D

namespace {

cv::Mat camera_matrix(const cairn::PinholeCamera& camera) {
  return (cv::Mat_<double>(3, 3) << camera.fx(), 0, camera.cx(), 0, camera.fy(), camera.cy(), 0, 0, 1);
}

std::optional<cairn::SE3> pnp(const cairn::StereoRig& rig, std::span<const cairn::StereoMatch> matches) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const cairn::StereoMatch& match : matches) {
    points.emplace_back(match.landmark(0), match.landmark(1), match.landmark(2));
    pixels.emplace_back(match.left(0), match.left(1));
  }
  cv::Mat rotation, translation, inliers;
  if (!cv::solvePnPRansac(points, pixels, camera_matrix(rig.left), cv::noArray(), rotation, translation,
                          false, 1000, 2.0F, 0.9999, inliers))
    return std::nullopt;
  std::vector<cv::Point3d> good_points;
  std::vector<cv::Point2d> good_pixels;
  for (int i = 0; i < inliers.rows; ++i) {
    good_points.push_back(points[static_cast<std::size_t>(inliers.at<int>(i))]);
    good_pixels.push_back(pixels[static_cast<std::size_t>(inliers.at<int>(i))]);
  }
  cv::solvePnPRefineLM(good_points, good_pixels, camera_matrix(rig.left), cv::noArray(), rotation,
                       translation);
  const auto vector = [](const cv::Mat& m) {
    return cairn::Vector<3>(m.at<double>(0), m.at<double>(1), m.at<double>(2));
  };
  return cairn::SE3(cairn::SO3::exp(vector(rotation)), vector(translation)).inverse();
}

std::optional<cairn::SE3> affine(const cairn::StereoRig& rig, std::span<const cairn::StereoMatch> matches) {
  std::vector<cv::Point3d> source, target;
  const cairn::Triangulator triangulator(rig);
  for (const cairn::StereoMatch& match : matches) {
    const cairn::Triangulation seen = triangulator(match.left, match.right);
    if (!seen.good()) continue;
    source.emplace_back(seen.point(0), seen.point(1), seen.point(2));
    target.emplace_back(match.landmark(0), match.landmark(1), match.landmark(2));
  }
  cv::Mat transform, inliers;
  if (cv::estimateAffine3D(source, target, transform, inliers, 0.3, 0.9999) == 0) return std::nullopt;
  // an affine map is no pose; the closed form on its inliers is
  std::vector<cairn::Vector<3>> x, y;
  for (std::size_t i = 0; i < source.size(); ++i)
    if (inliers.at<unsigned char>(static_cast<int>(i)) != 0) {
      x.emplace_back(source[i].x, source[i].y, source[i].z);
      y.emplace_back(target[i].x, target[i].y, target[i].z);
    }
  return cairn::align_points(x, y).T_target_source;
}

}  // namespace

#endif

std::span<const PoseRival> pose_rivals() {
  static const std::vector<PoseRival> all = {
#ifdef CAIRN_BENCH_OPENCV_CALIB3D
      {"OpenCV solvePnPRansac + LM", &pnp},
      {"OpenCV estimateAffine3D", &affine},
#endif
#ifdef CAIRN_BENCH_OPENGV
      {"OpenGV 3-point RANSAC + LM", &opengv_pose},
#endif
  };
  return all;
}

}  // namespace rivals
