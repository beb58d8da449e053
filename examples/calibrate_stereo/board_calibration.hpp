// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The calibration of a stereo rig from a flat board of known points seen by both cameras, with its
/// covariance.
///
/// All numbers of both cameras, the pose of the right camera in the left one and the pose of the board in
/// every view together minimise the squared pixel distances: Levenberg and Marquardt's method on
///   F = sum_v sum_i |z_l - h(c_l, T_v x_i)|^2 + |z_r - h(c_r, T_lr^-1 T_v x_i)|^2        (1)
/// with T_v from the board to the left camera. The covariance is s^2 (J^T J)^-1 with s^2 = F over the number
/// of residuals beyond the numbers. (Z. Zhang, "A flexible new technique for camera calibration", IEEE PAMI
/// 22, 2000, section 3.2; the start is not part of this file.)
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>

#include "support/rig_file.hpp"

namespace calibrate_stereo {

/// The board in one pair of images: where each of its points appears, in the order of the points.
struct BoardView {
  std::string name;
  std::vector<cairn::Vector<2>> left, right;  ///< [pixels]
};

/// Points of a board of columns x rows inner corners with squares of `square` [m]: row by row, z = 0.
[[nodiscard]] std::vector<cairn::Vector<3>> board_points(int columns, int rows, double square);

struct BoardCalibrationOptions {
  int distortion = 5;  ///< numbers of a lens that are estimated: the first of k1, k2, p1, p2, k3
  int most_steps = 100;
};

/// How far a view's points are from where the calibration puts them, RMS [pixels].
struct ViewError {
  std::string name;
  double left = 0, right = 0;
  double epipolar = 0;  ///< distance from the epipolar line (cairn/geometry/stereo_rig.hpp)
};

struct BoardCalibration {
  example::CalibratedRig rig;  ///< with its sigmas
  double pixel_sigma = 0;      ///< s of (1), of one coordinate [pixels]
  double rms = 0;              ///< of the distance of a point, root of F over the points [pixels]
  double baseline_sigma = 0;   ///< [m]
  std::vector<ViewError> views;
  std::vector<cairn::SE3> T_left_board;  ///< one a view
  int steps = 0;
};

/// Minimises (1) from `start` and the poses of the board there. Throws cairn::Error where views and points
/// are not as many as they should be or not finite, where the views do not determine the numbers (all boards
/// parallel, too few views), or where it does not come to a minimum.
[[nodiscard]] BoardCalibration calibrate(std::span<const cairn::Vector<3>> board,
                                         std::span<const BoardView> views, const cairn::StereoRig& start,
                                         std::span<const cairn::SE3> T_left_board,
                                         const BoardCalibrationOptions& options = {});

/// How far a number of another calibration of the same views is from this one's at most, in this one's
/// standard deviations: of both cameras and of the right one's pose. Numbers that were not estimated are left
/// out.
[[nodiscard]] double largest_difference(const BoardCalibration& calibration, const cairn::StereoRig& other);

/// What a calibration says of a view that was none of its own.
struct HeldOut {
  double epipolar = 0;  ///< RMS [pixels]
  double length = 0;    ///< mean length of a square's side by triangulation over its true length, less one
};
[[nodiscard]] HeldOut check_view(std::span<const cairn::Vector<3>> board, int columns, const BoardView& view,
                                 const cairn::StereoRig& rig);

/// check_view for each view with the calibration of all others, begun at `full`: the error that a pair which
/// the calibration has not seen is to expect.
[[nodiscard]] std::vector<HeldOut> leave_one_out(std::span<const cairn::Vector<3>> board, int columns,
                                                 std::span<const BoardView> views,
                                                 const BoardCalibration& full,
                                                 const BoardCalibrationOptions& options = {});

}  // namespace calibrate_stereo
