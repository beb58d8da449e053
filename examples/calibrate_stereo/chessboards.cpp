// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "chessboards.hpp"

#include <algorithm>
#include <string>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <cairn/core/check.hpp>

namespace calibrate_stereo {
namespace {

cairn::Matrix<3> matrix_of(const cv::Mat& m) {
  cairn::Matrix<3> result;
  for (int i = 0; i < 9; ++i) result(i / 3, i % 3) = m.at<double>(i / 3, i % 3);
  return result;
}

cairn::PinholeCamera camera_of(const cv::Mat& K, const cv::Mat& D, int width, int height) {
  cairn::PinholeParameters p;
  p.fx = K.at<double>(0, 0);
  p.fy = K.at<double>(1, 1);
  p.cx = K.at<double>(0, 2);
  p.cy = K.at<double>(1, 2);
  const double* d = D.ptr<double>();
  p.k1 = d[0];
  p.k2 = d[1];
  p.p1 = d[2];
  p.p2 = d[3];
  p.k3 = d[4];
  p.width = width;
  p.height = height;
  return cairn::PinholeCamera(p);
}

/// The numbers of a lens that are not to be estimated.
int fixed(int distortion) {
  int flags = 0;
  if (distortion < 5) flags |= cv::CALIB_FIX_K3;
  if (distortion < 4) flags |= cv::CALIB_ZERO_TANGENT_DIST;
  if (distortion < 2) flags |= cv::CALIB_FIX_K2;
  if (distortion < 1) flags |= cv::CALIB_FIX_K1;
  return flags;
}

}  // namespace

std::optional<std::vector<cairn::Vector<2>>> find_corners(cairn::ImageView image, int columns, int rows) {
  cv::Mat grey(image.height(), image.width(), CV_8UC1);
  for (int y = 0; y < image.height(); ++y) std::copy_n(image.row(y), image.width(), grey.ptr(y));
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(grey, {columns, rows}, corners,
                                 cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE))
    return std::nullopt;
  cv::cornerSubPix(grey, corners, {5, 5}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
  std::vector<cairn::Vector<2>> result;
  for (const cv::Point2f& corner : corners) result.emplace_back(corner.x, corner.y);
  return result;
}

Start begin(std::span<const cairn::Vector<3>> board, std::span<const BoardView> views, int width, int height,
            const BoardCalibrationOptions& options) {
  std::vector<std::vector<cv::Point3f>> points(views.size());
  std::vector<std::vector<cv::Point2f>> left(views.size()), right(views.size());
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t i = 0; i < board.size(); ++i) {
      points[v].emplace_back(static_cast<float>(board[i](0)), static_cast<float>(board[i](1)),
                             static_cast<float>(board[i](2)));
      left[v].emplace_back(static_cast<float>(views[v].left[i](0)), static_cast<float>(views[v].left[i](1)));
      right[v].emplace_back(static_cast<float>(views[v].right[i](0)),
                            static_cast<float>(views[v].right[i](1)));
    }
  try {
    const cv::Size size(width, height);
    const int flags = fixed(options.distortion);
    cv::Mat K1, D1, K2, D2, R, T, E, F;
    std::vector<cv::Mat> turns, places, unused_turns, unused_places;
    cv::calibrateCamera(points, left, size, K1, D1, unused_turns, unused_places, flags);
    cv::calibrateCamera(points, right, size, K2, D2, unused_turns, unused_places, flags);
    Start start;
    start.rms = cv::stereoCalibrate(points, left, right, K1, D1, K2, D2, size, R, T, E, F,
                                    flags | cv::CALIB_USE_INTRINSIC_GUESS,
                                    {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-9});
    const cairn::SE3 T_right_left(cairn::SO3::from_matrix(matrix_of(R)),
                                  {T.at<double>(0), T.at<double>(1), T.at<double>(2)});
    start.rig = {camera_of(K1, D1, width, height), camera_of(K2, D2, width, height), T_right_left.inverse()};
    for (std::size_t v = 0; v < views.size(); ++v) {
      cv::Mat turn, place, rotation;
      cv::solvePnP(points[v], left[v], K1, D1, turn, place);
      cv::Rodrigues(turn, rotation);
      start.T_left_board.emplace_back(
          cairn::SO3::from_matrix(matrix_of(rotation)),
          cairn::Vector<3>(place.at<double>(0), place.at<double>(1), place.at<double>(2)));
    }
    return start;
  } catch (const cv::Exception& error) {
    cairn::raise("OpenCV's calibration: " + std::string(error.what()));
  }
}

}  // namespace calibrate_stereo
