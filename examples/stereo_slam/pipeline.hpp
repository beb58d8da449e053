// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Stereo landmark SLAM, one step a frame, box by box:
///
///   frames -> points -> stereo pairs -> local landmarks -> matches with the map -> pose -> keyframe -> map
///
/// World = the left camera of the first frame. The pose is always found against the map, never against the
/// last frame, so errors do not add up while the same landmarks are in view. The map is one joint Gaussian
/// over the poses of keyframes with landmarks that follow from them (cairn/slam/keyframe_map.hpp): where old
/// and drifted landmarks are in view together the old ones decide, because the covariance says that they are
/// known better. That is what closes a loop, and what makes the pose's own covariance true.
#pragma once

#include <array>
#include <chrono>
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
#include <cairn/slam/keyframe_map.hpp>
#include <cairn/vision/features.hpp>

#include "dataset.hpp"
#include "feature_choice.hpp"
#include "frame_budget.hpp"
#include "front_end.hpp"
#include "guided_matching.hpp"
#include "landmark_store.hpp"
#include "landmarks.hpp"
#include "loop_watch.hpp"
#include "noise_factors.hpp"
#include "pose_filter.hpp"
#include "riding_along.hpp"
#include "run_record.hpp"
#include "saved_map.hpp"
#include "self_calibration.hpp"
#include "stereo_matcher.hpp"
#include "vertical_disparity.hpp"

namespace stereo_slam {

/// Whether the rig's calibration is corrected while moving.
enum class Calibration {
  automatic,  ///< on where the first frame's vertical disparity shows that it is off
              ///< (vertical_disparity.hpp), drifting from where it shows later
  on,         ///< a part of the map's joint state: for rigs that are not quite what their file says
  off,
  drifting  ///< followed from motion to motion (self_calibration.hpp): for rigs that come loose
};
inline constexpr std::array<const char*, 4> calibration_names{"auto", "on", "off", "drifting"};

struct PipelineOptions {
  std::uint64_t seed = 1;
  unsigned threads = 1;
  int points = 2000;             ///< interest points kept in an image
  float surf_threshold = 10.0F;  ///< least response [(grey levels)^2]
  bool oriented = false;         ///< SURF with orientation, for cameras that roll
  FeatureKind features = FeatureKind::surf;
  StoreOptions store;
  StereoMatcherOptions stereo;

  Calibration calibrate = Calibration::automatic;
  /// How far a rig may be off, where it is estimated with the map. The length stands for all that makes the
  /// world larger or smaller: no image shows it, and it only widens the covariance. Focal lengths and
  /// principal points are left as they are given: freed, they take up what lenses do besides
  /// (docs/stereo_slam.md).
  cairn::RigSigmas rig = {.rotation = 5e-4, .direction = 5e-4, .length = 3e-3};
  /// How a rig that is followed may be off at first, and move. Without a rate the largest error on the
  /// arena's drifting rig was 2.4 times as large, and with a fifth of the sigma a knock of 2 mrad was found
  /// to be one of 0.6.
  cairn::CalibrationDriftOptions calibration = {
      .initial_sigma = 1e-3, .walk_rotation = 1e-5, .walk_baseline = 1e-6, .rate_sigma = 5e-6};

  double pixel_sigma = 0.35;     ///< noise of the coordinates of a point of scale 1 [pixels]
  double scale_exponent = 0.65;  ///< it grows with this power of the scale
  /// Where the rig is exactly known landmarks are where their surface is (surface_patch.hpp), not where a
  /// keypoint is found on it.
  bool patches = true;
  double patch_sigma = 0.05;  ///< of a point whose patch was found again, besides what its residual implies
  FrameBudgetOptions budget;  ///< of the work on a frame; what it leaves out depends on the clock
  GuidedMatchingOptions second_look;
  std::size_t min_inliers = 10;         ///< fewer: the frame is lost
  std::size_t relocating_inliers = 25;  ///< fewer: a camera that is lost stays so
  /// Farther points are too vague to keep. Where noise decides what is kept, those that it puts too near are:
  /// the limit lies where a landmark weighs little.
  double max_depth_over_baseline = 250;
  /// A frame becomes a keyframe when the share of its points that the map knows falls below this part of what
  /// it was at best since the last one.
  double keyframe_share = 0.8;
  std::size_t max_landmarks = 40000;  ///< the least seen leave when there are more
  int ageing_frames = 30;     ///< so often a landmark must have been expected before it can be too old:
  double ageing_share = 0.1;  ///< when it was found in less than this share of them
  double twin_radius = 1.5;   ///< landmarks nearer than this in both images may be the same [pixels]
  cairn::KeyframeMapOptions map;
  MotionOptions motion;
  /// A match is searched among what lies within so many standard deviations of where the motion leads.
  double motion_gate = 6;
  LoopWatchOptions loops;
  std::size_t sample_frame = 0;  ///< the frame shown with its matches in the report
  bool keep_newest = false;      ///< record() has the last frame with its matches as well
  bool localise = false;         ///< a loaded map stays as it is: no keyframe, no landmark more
};

/// The interest points that a pipeline with these options works on.
[[nodiscard]] FeatureOptions feature_options(const PipelineOptions& options);

/// The system. Feed it frames in order; then ask for the record.
class Pipeline {
public:
  Pipeline(const cairn::StereoRig& rig, const PipelineOptions& options);
  /// Goes on in a map of before, in its world; where the camera is in it shows with the first frame that
  /// recognises enough. Its options of mapping are the map's. Throws cairn::Error for a map of another rig or
  /// of other features; `name` is the map's.
  Pipeline(const cairn::StereoRig& rig, const PipelineOptions& options, SavedMap known,
           const std::string& name);

  /// Works on one frame; `load_milliseconds` is what reading it took. Returns what came of it. Where that
  /// throws the record is of the frames before.
  const FrameRecord& step(const StereoFrame& frame, double load_milliseconds = 0);
  /// The same for a frame whose points a front end with feature_options() found; pairs by another matcher
  /// than the rig's as it is now are not looked at.
  const FrameRecord& step(const StereoFrame& frame, const FramePoints& points, double load_milliseconds = 0);

  /// What finds the stereo pairs of all frames to come; nullptr while the rig may still be corrected.
  [[nodiscard]] std::shared_ptr<const StereoMatcher> settled_matcher() const;

  /// Where the next frames need no points: what rides along. nullptr where nothing does.
  [[nodiscard]] std::shared_ptr<const HiddenParts> left_alone() const {
    return riding_along_ ? riding_along_->left_alone() : nullptr;
  }

  /// Points that an image of the next frames should have, to keep within the budget.
  [[nodiscard]] int wanted_points() const noexcept { return budget_.points(); }

  /// Everything that happened, with the map as it stands now. Frames that were lost between others have the
  /// poses that these give them (lost_stretch.hpp).
  [[nodiscard]] RunRecord record();

  /// The map as it stands now, for another run: without the landmarks that are on probation.
  [[nodiscard]] SavedMap map() const;

private:
  /// A point of the left image whose place is known in the camera's frame.
  struct LocalLandmark {
    std::uint32_t point;  ///< of the left image
    cairn::Vector<2> left_pixel, right_pixel;
    double sigma;            ///< of each pixel coordinate
    PointPair pair;          ///< the pair that it is of
    cairn::Vector<2> moved;  ///< right_pixel less where the right camera saw it, of a rig that is loose
  };
  /// A local landmark and the landmark of the map it is taken for.
  struct Match {
    std::uint32_t local;
    LandmarkId landmark;
  };

  /// Where the camera is, and what says so. Nothing where it is lost.
  struct Located {
    cairn::MapLocation location;
    std::vector<cairn::StereoSighting> sightings;  ///< one a match
    Places places = Places::keypoints;             ///< what says where most of them are
    std::vector<Match> agreed;
    std::vector<cairn::StereoSighting> agreed_sightings;
  };

  void work_on(const StereoFrame& frame, const FramePoints& points, FrameRecord& result);
  [[nodiscard]] double spent() const;
  template <class Work>
  void if_time(Shed kind, const Work& work, bool always = false);
  [[nodiscard]] bool corrects_rig() const;
  [[nodiscard]] std::vector<PointPair> pairs_of(const StereoFrame& frame, const FramePoints& points) const;
  void find_local_landmarks(const FramePoints& points, std::span<const PointPair> pairs);
  [[nodiscard]] std::vector<Match> match_with_map() const;
  /// Leaves of `matches` what can be where the motion leads, and adds what the second look finds.
  [[nodiscard]] std::optional<Located> locate(std::vector<Match>& matches);
  [[nodiscard]] std::vector<Match> within_reach(const std::vector<Match>& matches);
  [[nodiscard]] bool believes(const cairn::MapLocation& here);
  [[nodiscard]] std::optional<std::string> of_two_moments(const StereoFrame& frame);
  bool level_rig(const StereoFrame& frame, const FramePoints& points, std::span<const PointPair> pairs);
  void begin(const StereoFrame& frame, FrameRecord& result);
  [[nodiscard]] std::optional<cairn::SE3> truth_in_map(const StereoFrame& frame, bool tracked);
  void choose_calibration();
  void watch_rig();
  void follow_rig(const std::string& why);
  [[nodiscard]] VerticalDisparity disparity_of_locals() const;
  [[nodiscard]] std::optional<cairn::Vector<2>> put_back(const cairn::Vector<3>& point) const;
  void follow(const StereoFrame& frame, FrameRecord& result);
  void lose(const StereoFrame& frame, const std::string& why, FrameRecord& result);
  void move_to(const Located& located, FrameRecord& result);
  void make_keyframe_if_due(const Located& located, const StereoFrame& frame, FrameRecord& result);
  void make_keyframe(const Located& located, const StereoFrame& frame, FrameRecord& result);
  void add_landmarks(const std::vector<Match>& known, const StereoFrame& frame);
  void close_step();
  void keep_bounded();
  void note_loop(const Located& located);
  void age(const Located& located);
  void merge_twins(const Located& located);
  void forget(LandmarkId id);
  [[nodiscard]] std::vector<cairn::SE3> corrected_path(const std::vector<FrameRecord>& frames) const;
  void calibrate(const Located& located);
  void look_through(const cairn::StereoRig& rig);
  void find_pairs_by(const cairn::StereoRig& rig);

  [[nodiscard]] Places settle(const cairn::SE3& T_world_camera, std::span<const Match> matches,
                              std::span<cairn::StereoSighting> sightings);
  const FrameRecord& step_by_own_points(const StereoFrame& frame, int wanted, double load_milliseconds);
  void leave_out_what_rides_along(cairn::StereoPose& pose, std::vector<Match>& matches,
                                  std::span<const cairn::StereoMatch> seen,
                                  const RidingAlong::Estimate& estimate);
  bool begin_again();
  [[nodiscard]] std::vector<std::uint8_t> spoken_for(std::span<const Match> matches) const;
  void look_again(const cairn::StereoPose& pose, std::vector<Match>& matches);
  void earliest_first(std::vector<Match>& matches) const;
  [[nodiscard]] std::vector<cairn::StereoMatch> observations(std::vector<Match>& matches);
  [[nodiscard]] std::vector<cairn::StereoSighting> sightings(std::span<const Match> matches) const;
  [[nodiscard]] cairn::StereoSighting sighting(std::uint32_t local, LandmarkId landmark) const;
  [[nodiscard]] std::optional<cairn::PosePrior> prediction() const;
  [[nodiscard]] cairn::StereoPoseOptions pose_options() const;
  [[nodiscard]] SampleFrame sample_of(const StereoFrame& frame, const std::vector<Match>& matches,
                                      const std::vector<Match>& agreed) const;

  PipelineOptions options_;
  cairn::StereoRig given_;                 // as it was given
  cairn::StereoRig rig_;                   // as the map knows it
  std::optional<cairn::StereoRig> loose_;  // as it is now, where it is followed
  int shown_off_ = 0;                      // looks in a row that showed that it is not as the map knows it
  DisparityWatch disparity_watch_;         // where the map estimates it
  std::optional<FrontEnd> front_end_;      // made for the first frame that comes without points
  const cairn::Features* left_ = nullptr;  // of the frame that is worked on
  cairn::ImageView image_;                 // its left image
  cairn::Image last_left_, last_right_;    // of the frame before
  std::shared_ptr<const StereoMatcher> match_stereo_;
  cairn::Triangulator triangulate_;
  bool levelled_ = false;  // the rig is not as it was given
  SelfCalibration calibration_;
  std::unique_ptr<LandmarkStore> store_;
  Landmarks landmarks_;
  cairn::KeyframeMap map_;
  NoiseFactors noise_factors_;
  FrameBudget budget_;
  std::chrono::steady_clock::time_point begun_;  // work on the frame, here
  double ahead_ = 0;                             // work on it before [ms]
  PoseFilter motion_;
  std::optional<double> time_;  // of the frame before [s]
  LoopWatch loop_watch_;
  std::vector<ExpectedLandmark> expected_;  // of the second look
  bool lost_ = false;                       // where the camera is is not known from the frame before
  double best_share_ = 0;                   // of a frame's points that the map knew, since the last keyframe
  std::vector<LocalLandmark> locals_;
  std::optional<RidingAlong> riding_along_;  // from the first frame on
  bool may_begin_again_ = true;
  RidingAlong::Sureness began_with_ = RidingAlong::unsuspected;
  std::vector<StereoFrame> beginning_;   // the first frames, while the map may begin again
  std::vector<std::uint32_t> left_out_;  // locals of this frame that stood still against its motion
  cairn::SE3 T_world_camera_;
  cairn::SE3 T_last_camera_;  // motion of the last step, for the prediction
  cairn::Matrix<6> pose_covariance_;
  std::optional<TruthWorld> truth_;
  int step_ = 0;
  RunRecord record_;
};

}  // namespace stereo_slam
