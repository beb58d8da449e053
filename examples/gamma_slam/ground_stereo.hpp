// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Heights of the ground from a pair of images of any stereo rig.
///
/// Both images are resampled at half their size so that pairs share a row (A. Fusiello, E. Trucco, A. Verri,
/// Machine Vision and Applications 12, 2000), windows are compared along the rows by their normalised
/// correlation, and the plane with the most points below the camera says what is level and how high the
/// camera stands.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/so3.hpp>
#include <cairn/vision/image.hpp>

#include "drive.hpp"

namespace gamma_slam {

struct GroundStereoOptions {
  int every = 3;                   ///< pixels of the small images between points that are looked for
  int half_window = 4;             ///< pixels to either side that are compared
  double nearest = 3;              ///< depths searched [m]
  double reach = 16;               ///< [m] from the vehicle
  double tallest = 2.5;            ///< [m]: what is higher is not under the wheels
  double least_correlation = 0.8;  ///< of a window and its partner
  double clearly = 0.05;           ///< by how much the best partner beats all but its neighbours
  double least_contrast = 4;       ///< standard deviation of a window's grey levels
  double disparity_sigma = 0.2;    ///< [pixels of the small images]
  double height_sigma = 0.04;      ///< [m]: points that are worse are left out
  int most_in_square = 8;          ///< points of a scan in 0.2 m x 0.2 m
};

/// What one pair of images says of the ground.
struct GroundView {
  cairn::SO3 R_level_camera;        ///< from the left camera's axes to x ahead, y to the left, z up
  double camera_height = 0;         ///< [m] above the ground's plane
  std::vector<GroundPoint> points;  ///< from the camera's foot
};

/// Finds ground for one rig; safe to use from several threads.
class GroundStereo {
public:
  /// Throws cairn::Error where the cameras look so much along the baseline that no rows can be made, or an
  /// option is out of range.
  explicit GroundStereo(const cairn::StereoRig& rig, const GroundStereoOptions& options = {});

  /// Nothing where fewer than 50 points lie on a plane below the camera. Random numbers by `seed`.
  [[nodiscard]] std::optional<GroundView> operator()(cairn::ImageView left, cairn::ImageView right,
                                                     std::uint64_t seed) const;

private:
  struct SmallImage {
    int width, height;
    std::vector<float> grey;
    [[nodiscard]] float operator()(int x, int y) const noexcept {
      return grey[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
    }
  };
  struct Seen {
    cairn::Vector<3> point;  // left camera [m]
    double disparity;        // [pixels of the small images]
  };
  using Lookups = std::vector<cairn::Vector<2>>;  // a pixel of the camera for each of a small image

  [[nodiscard]] Lookups lookups(const cairn::PinholeCamera& camera, const cairn::Matrix<3>& R_rows) const;
  [[nodiscard]] SmallImage resampled(cairn::ImageView image, const Lookups& from) const;
  [[nodiscard]] std::optional<double> disparity_at(const SmallImage& from, const SmallImage& to, int towards,
                                                   int x, int y) const;
  [[nodiscard]] std::vector<Seen> matched(const SmallImage& left, const SmallImage& right) const;

  GroundStereoOptions options_;
  int width_, height_;
  double focal_, baseline_;
  cairn::Matrix<3> R_rows_left_;
  Lookups left_, right_;
};

}  // namespace gamma_slam
