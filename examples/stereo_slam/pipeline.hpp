// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Stereo landmark SLAM, one step a frame, box by box:
///
///   frames -> points -> stereo pairs -> local landmarks -> matches with the map -> pose -> landmark filters
///   -> map
///
/// World = the left camera of the first frame. The pose is always found against the map, never against the
/// last frame, so errors do not add up while the same landmarks are in view. Of the matches that agree, the
/// landmarks seen EARLIEST decide, because they carry the least accumulated error: that is what closes a
/// loop.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/geometry/stereo_pose.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/vision/features.hpp>

#include "dataset.hpp"
#include "feature_choice.hpp"
#include "landmark_store.hpp"
#include "landmarks.hpp"
#include "run_record.hpp"
#include "self_calibration.hpp"
#include "stereo_matcher.hpp"

namespace stereo_slam {

struct PipelineOptions {
  std::uint64_t seed = 1;
  unsigned threads = 1;
  int points = 2000;             ///< interest points kept in an image
  float surf_threshold = 10.0F;  ///< least response [(grey levels)^2]
  bool oriented = false;         ///< SURF with orientation, for cameras that roll
  FeatureKind features = FeatureKind::surf;
  StoreOptions store;
  StereoMatcherOptions stereo;

  bool calibrate = false;  ///< correct the rig's calibration while moving (self_calibration.hpp)
  cairn::CalibrationDriftOptions calibration = {
      .initial_sigma = 2e-4, .walk_rotation = 1e-5, .walk_baseline = 1e-6};

  double pixel_sigma = 0.7;       ///< noise of a point's coordinates at the finest scale [pixels]
  float fine_scale = 4;           ///< up to this scale; above, the noise grows with it [pixels]
  double second_look_radius = 8;  ///< search for known landmarks around where the pose predicts them [pixels]
  std::size_t earliest = 100;     ///< so many of the earliest agreeing landmarks decide the pose
  std::size_t min_inliers = 10;   ///< fewer: the frame is lost
  double max_depth_over_baseline = 150;  ///< farther points are too vague to keep
  double landmark_noise =
      5e-4;  ///< added to a landmark in a step, over its depth: calibrations are not exact
  double landmark_gate = 16.27;  ///< NIS of a sighting, chi-square of 3 degrees of freedom at 0.999
  std::size_t sample_frame = 0;  ///< the frame shown with its matches in the report
};

/// The system. Feed it frames in order; then ask for the record.
class Pipeline {
public:
  Pipeline(const cairn::StereoRig& rig, const PipelineOptions& options);

  /// Works on one frame; `load_milliseconds` is what reading it took. Returns what came of it. Where that
  /// throws the record is of the frames before.
  const FrameRecord& step(const StereoFrame& frame, double load_milliseconds = 0);

  /// Everything that happened, with the map as it stands now.
  [[nodiscard]] RunRecord record() const;

private:
  /// A point of the left image whose place is known in the camera's frame.
  struct LocalLandmark {
    std::uint32_t point;  ///< of the left image
    cairn::Vector<2> left_pixel, right_pixel;
    double sigma;               ///< of each pixel coordinate
    cairn::Vector<3> position;  ///< left camera frame
    cairn::Matrix<3> covariance;
  };
  /// A local landmark and the landmark of the map it is taken for.
  struct Match {
    std::uint32_t local;
    LandmarkId landmark;
  };

  /// Where the camera is, and the matches that say so, earliest landmarks first. Nothing where it is lost.
  struct Located {
    cairn::StereoPose pose;
    std::vector<Match> agreed;
  };

  const FrameRecord& work_on(const StereoFrame& frame, double load_milliseconds);
  void detect(const StereoFrame& frame);
  void find_local_landmarks(const StereoFrame& frame);
  [[nodiscard]] std::vector<Match> match_with_map() const;
  /// Adds to `matches` what the second look finds.
  [[nodiscard]] std::optional<Located> locate(std::vector<Match>& matches) const;
  void move_to(const cairn::StereoPose& pose);
  void stay();
  void record_pose();
  void refine_landmarks(const std::vector<Match>& agreed);
  void extend_map(const std::vector<Match>& agreed, const StereoFrame& frame);
  void close_step();
  void calibrate(const std::vector<Match>& agreed);
  void take_rig(const cairn::StereoRig& rig);

  void second_look(const cairn::SE3& T_world_camera, std::vector<Match>& matches) const;
  [[nodiscard]] cairn::StereoPose decide_by_earliest(const std::vector<Match>& agreed,
                                                     const cairn::StereoPose& all) const;
  void earliest_first(std::vector<Match>& matches) const;
  [[nodiscard]] std::vector<cairn::StereoMatch> observations(std::span<const Match> matches) const;
  [[nodiscard]] cairn::Gaussian<cairn::Vector<3>> in_world(const LocalLandmark& local) const;
  [[nodiscard]] cairn::SE3 predicted_pose() const;
  [[nodiscard]] cairn::StereoPoseOptions pose_options() const;
  void keep_sample(const StereoFrame& frame, const std::vector<Match>& matches,
                   const std::vector<Match>& agreed);

  PipelineOptions options_;
  cairn::StereoRig rig_;
  Extractor extract_left_, extract_right_;
  const cairn::Features* left_ = nullptr;  // of the current frame; they live in the extractors
  const cairn::Features* right_ = nullptr;
  StereoMatcher match_stereo_;
  cairn::Triangulator triangulate_;
  SelfCalibration calibration_;
  std::unique_ptr<LandmarkStore> store_;
  Landmarks landmarks_;
  std::vector<LocalLandmark> locals_;
  cairn::SE3 T_world_camera_;
  cairn::SE3 T_last_camera_;  // motion of the last step, for the prediction
  cairn::Matrix<6> pose_covariance_;
  std::optional<cairn::SE3> T_truth_world_;  // from this run's world to the truth's
  int step_ = 0;
  mutable RunRecord record_;  // const stages add their times
};

}  // namespace stereo_slam
