// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Which point of the left image is which of the right one.
///
/// Every rig, rectified or not, has two rotations after which true pairs share a row (Fusiello, Trucco and
/// Verri, Machine Vision and Applications 12, 2000). Turning the points, not the pictures, makes the epipolar
/// gate exact and a band of rows for any rig:
///   candidates: |row_left - row_right| <= band, disparity of an allowed depth, same sign, similar scale;
///   a match is the best of its candidates in both directions and clearly better than the second;
///   its right position is then refined on the grey levels (patch_alignment.hpp).
#pragma once

#include <cstdint>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/vision/features.hpp>
#include <cairn/vision/image.hpp>

namespace stereo_slam {

struct StereoMatcherOptions {
  double band = 2.0;            ///< largest distance of the rows [pixels], for points of scale 2 and less
  double nearest = 0.4;         ///< depths searched [m]
  double farthest = 400.0;      ///< [m]
  float scale_ratio = 1.5F;     ///< largest ratio of the two scales
  float distance_ratio = 0.9F;  ///< best distance over the second best, at most
  float max_distance = 0.6F;    ///< of unit descriptors
  bool refine = true;           ///< align the grey levels
  float min_correlation = 0.75F;
};

/// A pair of points, and how well its pixels are known.
struct PointPair {
  std::uint32_t left = 0;   ///< index of the left point
  std::uint32_t right = 0;  ///< index of the right point
  cairn::Vector<2> left_pixel;
  cairn::Vector<2> right_pixel;  ///< refined
  bool refined = false;
  /// Of a refined one: where the partner moves with the left point, right(u) = u + stretch u + shear v.
  float stretch = 0, shear = 0;

  /// Where the partner moves when the left point moves a little.
  [[nodiscard]] cairn::Vector<2> right_step(const cairn::Vector<2>& left_step) const noexcept {
    return {left_step(0) + stretch * left_step(0) + shear * left_step(1), left_step(1)};
  }
};

/// Matches points of one rig. operator() is safe to call concurrently.
class StereoMatcher {
public:
  /// Throws cairn::Error when the cameras look so much along the baseline that no rotation makes rows of the
  /// pairs.
  StereoMatcher(const cairn::StereoRig& rig, const StereoMatcherOptions& options);

  /// Matches in the order of the left points; the same for every number of threads.
  [[nodiscard]] std::vector<PointPair> operator()(cairn::ImageView left_image, const cairn::Features& left,
                                                  cairn::ImageView right_image, const cairn::Features& right,
                                                  unsigned threads) const;

  /// By what part of itself the inverse of the depth in the left camera grows from pixel to pixel of its
  /// image, on the surface that a refined pair is of; 0 where that is not in front of both cameras.
  [[nodiscard]] cairn::Vector<2> slope_of_inverse_depth(const PointPair& match) const;

private:
  struct RowPoint;
  class Rows;
  struct Best;
  struct Nearest;
  [[nodiscard]] std::vector<RowPoint> to_rows(const cairn::Features& features,
                                              const cairn::PinholeCamera& camera,
                                              const cairn::Matrix<3>& rotation) const;
  [[nodiscard]] bool may_match(const RowPoint& left, const RowPoint& right) const;
  [[nodiscard]] Nearest nearest(const cairn::Features& left, const cairn::Features& right,
                                unsigned threads) const;
  void refine(PointPair& match, cairn::ImageView left, cairn::ImageView right) const;

  cairn::StereoRig rig_;
  StereoMatcherOptions options_;
  cairn::Matrix<3> R_rows_left_;   // left camera frame -> frame in which the baseline is the x axis
  cairn::Matrix<3> R_rows_right_;  // right camera frame -> the same
  double focal_ = 1;               // scales normalised rows and disparities to pixels
  float least_disparity_ = 0;
  float most_disparity_ = 0;
};

}  // namespace stereo_slam
