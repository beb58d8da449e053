// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What one run of the stereo SLAM example leaves behind: everything the summary, the map file and the report
/// show.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/rig_correction.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/vision/image.hpp>

#include "frame_budget.hpp"

namespace stereo_slam {

/// The stages of one step, in order; names as they stand in timing.json.
enum class Stage { load, detect, stereo, match, pose, update, store, total };
inline constexpr std::array<const char*, 8> stage_names{"load", "detect", "stereo", "match",
                                                        "pose", "update", "store",  "total"};

/// Variances up to this are those of the frame with which a map begins, which is where its world is.
inline constexpr double gauge_variance = 2e-12;

struct FrameRecord {
  std::size_t index = 0;            ///< frame number in the data set
  double time = 0;                  ///< [s]
  cairn::SE3 T_world_camera;        ///< estimated pose of the left camera; world = first camera
  cairn::Matrix<6, 6> covariance;   ///< of the pose, tangent at the pose: translation, then rotation
  std::optional<cairn::SE3> truth;  ///< true T_world_camera in the same world, where the data has it
  bool tracked = false;
  bool carried = false;      ///< not tracked, but its motion says where it is
  bool bridged = false;      ///< neither, but it lies between frames that were: known in hindsight
  bool relocalised = false;  ///< tracked, though nothing was known of where the camera is
  int points_left = 0;
  int points_right = 0;
  int points_wanted = 0;  ///< in an image; fewer than were asked for where the budget is short
  int stereo_matches = 0;
  int map_matches = 0;
  int inliers = 0;
  std::size_t landmarks = 0;     ///< in the map after this frame
  std::size_t keyframes = 0;     ///< the same
  bool keyframe = false;         ///< this frame became one
  std::size_t reference = 0;     ///< the newest keyframe, in the order of adding
  cairn::SE3 T_world_reference;  ///< its pose as it was then
  double fit = 0;                ///< median chi^2 of the inliers over what right sigmas make it; 0: none
  ShedSet shed;                  ///< what the budget left out
  std::array<double, stage_names.size()> milliseconds{};
};

struct LandmarkRecord {
  cairn::Vector<3> position;       ///< [m], world frame
  cairn::Matrix<3, 3> covariance;  ///< [m^2]
  std::uint8_t grey = 0;
  int age = 0;  ///< frames since first seen
  int sightings = 0;
};

/// One point of the sample frame: a left-image point, where its partner lies in the right image, and what
/// became of it.
struct SamplePoint {
  enum class Kind {
    fresh,
    matched,
    inlier
  };  ///< no partner in the map; a partner; a partner the pose agrees with
  float x = 0, y = 0, right_x = 0, right_y = 0;
  Kind kind = Kind::fresh;
};

struct SampleFrame {
  std::size_t index = 0;
  cairn::Image left;
  cairn::Image right;
  std::vector<SamplePoint> points;
};

/// The rig's calibration: whether it was corrected, why, and by how much.
struct CalibrationRecord {
  bool on = false;
  std::string why;
  /// Of the rig, with the units of geometry/rig_correction.hpp; a sigma of 0: not estimated.
  cairn::RigState numbers = cairn::RigState::Zero(), sigmas = cairn::RigState::Zero();
};

/// A place that is met again after it was out of view for long.
struct LoopClosure {
  std::size_t frame = 0;                     ///< its place in the record
  std::size_t landmarks = 0;                 ///< that came back
  int away = 0;                              ///< steps for which these had been out of view, median
  std::optional<cairn::SE3> T_world_before;  ///< pose of the frame by the other landmarks alone
};

/// What rides along in the image and is left out (riding_along.hpp).
struct RidingAlongRecord {
  std::optional<std::size_t> since;  ///< the first frame after which something was, by its number
  double share = 0;                  ///< of the image, at the end
  double largest_share = 0;
};

struct RunRecord {
  std::string dataset;
  std::string features, store, motion = "off";
  std::uint64_t seed = 0;
  unsigned threads = 1;
  int target_points = 0;
  std::optional<double> budget;  ///< of work a frame [ms]
  double seconds = 0;            ///< wall time of the whole run
  std::vector<FrameRecord> frames;
  std::vector<LandmarkRecord> landmarks;
  CalibrationRecord calibration;
  RidingAlongRecord riding_along;
  cairn::StereoRig rig;  ///< as it is believed to be at the end
  std::vector<LoopClosure> loops;
  std::vector<cairn::SE3> corrected;  ///< T_world_camera of every frame as the map has it at the end
  std::size_t refused = 0;            ///< poses that the motion could not lead to
  std::size_t merged = 0;             ///< landmarks that were another's twin
  std::size_t aged = 0;               ///< landmarks that were not found where they should be
  /// The world of the truth was laid on a pose that was estimated: the error of that one is in all errors,
  /// and no covariance knows of it.
  bool truth_laid_on_estimate = false;
  double variance_factor = 1;  ///< by which variances are larger than the pixel sigma says, at the end
  std::optional<SampleFrame> sample;
  std::optional<SampleFrame> newest;       ///< the last frame, where it was asked for
  std::vector<std::string> notes;          ///< what the reader should know: skipped frames, lost frames
  std::optional<std::string> ended_early;  ///< after which frame the run ended and why, where it did
};

}  // namespace stereo_slam
