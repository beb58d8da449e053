// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include <cairn/core/cholesky.hpp>
#include <cairn/core/parallel.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/io/text.hpp>

#include "levelled_rig.hpp"
#include "lost_stretch.hpp"
#include "mistaken_sides.hpp"
#include "stopwatch.hpp"
#include "surface_patch.hpp"

namespace stereo_slam {
namespace {

/// What the work returns; adds the time it took to a stage of a frame's record.
template <class Work>
auto timed(FrameRecord& record, Stage stage, const Work& work) {
  const Stopwatch watch(record.milliseconds[static_cast<std::size_t>(stage)]);
  return work();
}

StoreOptions store_options(const PipelineOptions& options) {
  StoreOptions store = options.store;
  store.dimension = dimension_of(options.features);
  return store;
}

cairn::TriangulationOptions triangulation_options(const PipelineOptions& options,
                                                  const cairn::StereoRig& rig) {
  cairn::TriangulationOptions triangulation;
  triangulation.max_depth = options.max_depth_over_baseline * rig.baseline();
  return triangulation;
}

cairn::KeyframeMapOptions map_options(const PipelineOptions& options) {
  cairn::KeyframeMapOptions map = options.map;
  map.min_matches = options.min_inliers;
  return map;
}

/// What may be why a frame shows next to nothing, in brackets; empty where nothing strikes.
std::string oddity_of(const cairn::StereoRig& rig, const StereoFrame& frame) {
  const cairn::PinholeParameters& camera = rig.left.parameters();
  if (!rig.left.contains(cairn::Vector<2>(camera.cx, camera.cy)))
    return " (the rig has the principal point of the left camera at " + cairn::shortest(camera.cx) + ", " +
           cairn::shortest(camera.cy) + ", outside of its image)";
  int darkest = 255, brightest = 0;
  for (int y = 0; y < frame.left.height(); ++y)
    for (int x = 0; x < frame.left.width(); ++x) {
      darkest = std::min<int>(darkest, frame.left(x, y));
      brightest = std::max<int>(brightest, frame.left(x, y));
    }
  constexpr int hardly_any = 32;
  if (brightest - darkest >= hardly_any) return {};
  return " (the left image's grey levels are " + std::to_string(darkest) + " to " +
         std::to_string(brightest) + " of 255: 10 or 12 bits in files of 16 have to be scaled to fill them)";
}

std::string as_asked(const PipelineOptions& options) {
  return std::string("asked for: ") + calibration_names[static_cast<std::size_t>(options.calibrate)];
}

std::string in_words(const VerticalDisparity& seen) {
  const auto part = [](double value, double sigma) {
    return cairn::shortest(std::round(1e3 * value) / 1e3) + " +- " +
           cairn::shortest(std::round(1e3 * sigma) / 1e3);
  };
  return "vertical disparity " + part(seen.offset, seen.sigma_offset) + ", over half a width " +
         part(seen.slope_x, seen.sigma_x) + ", over half a height " + part(seen.slope_y, seen.sigma_y) +
         " pixels";
}

}  // namespace

FeatureOptions feature_options(const PipelineOptions& options) {
  return {.kind = options.features,
          .points = options.points,
          .surf_threshold = options.surf_threshold,
          .oriented = options.oriented};
}

Pipeline::Pipeline(const cairn::StereoRig& rig, const PipelineOptions& options)
    : options_(options),
      given_(rig),
      rig_(rig),
      match_stereo_(std::make_shared<const StereoMatcher>(rig, options.stereo)),
      triangulate_(rig, triangulation_options(options, rig)),
      calibration_(rig, options.calibration),
      store_(make_landmark_store(store_options(options))),
      map_(rig, map_options(options)),
      budget_(options.budget, options.points),
      motion_(options.motion),
      loop_watch_(options.loops),
      pose_covariance_(cairn::Matrix<6>::Zero()) {
  record_.seed = options.seed;
  record_.threads = options.threads;
  record_.target_points = options.points;
  record_.budget = options.budget.milliseconds;
  record_.features = feature_names[static_cast<std::size_t>(options.features)];
  record_.store = options.store.kind == StoreKind::multi ? "multi" : "single";
  record_.motion = motion_names[static_cast<std::size_t>(options.motion.filter)];
}

Pipeline::Pipeline(const cairn::StereoRig& rig, const PipelineOptions& options, SavedMap known,
                   const std::string& name)
    : Pipeline(rig, options) {
  expect_same_rig(known.map.nominal_rig(), rig, name);
  if (known.features != options.features || known.oriented != options.oriented)
    cairn::raise(name + ": the landmarks of this map are " + (known.oriented ? "oriented " : "") +
                 feature_names[static_cast<std::size_t>(known.features)] + " points, this run looks for " +
                 (options.oriented ? "oriented " : "") +
                 feature_names[static_cast<std::size_t>(options.features)]);
  if (options.calibrate == Calibration::drifting && known.map.rig_correction())
    cairn::raise(name + ": this map estimates its rig, which cannot be followed as drifting besides");
  if (options.calibrate == Calibration::on && !known.map.rig_correction())
    cairn::raise(name + ": this map does not estimate its rig, which has to begin with the map");
  if (options.calibrate == Calibration::off && known.map.rig_correction())
    cairn::raise(name + ": this map estimates its rig, which cannot be left as it was given");
  may_begin_again_ = false;
  map_ = std::move(known.map);
  noise_factors_ = NoiseFactors(map_.pixel_factor(), map_.pose_factor());
  step_ = known.steps;
  truth_ = std::move(known.truth);
  for (Landmark& landmark : known.landmarks) {
    const LandmarkId id = store_->add({landmark.descriptor, landmark.sign});
    CAIRN_EXPECTS(id == landmark.id, "the landmarks of a saved map are numbered 0, 1, 2, ...");
    store_->trust(landmark.id);
    landmarks_.add(std::move(landmark));
  }
  static_cast<void>(store_->advance());
  lost_ = true;
  record_.calibration.on = map_.rig_correction().has_value();
  record_.calibration.why = "as the map has it";
  look_through(map_.rig());
  if (options_.calibrate == Calibration::drifting) follow_rig(as_asked(options_));
}

const FrameRecord& Pipeline::step(const StereoFrame& frame, double load_milliseconds) {
  return step_by_own_points(frame, budget_.points(), load_milliseconds);
}

const FrameRecord& Pipeline::step_by_own_points(const StereoFrame& frame, int wanted,
                                                double load_milliseconds) {
  if (!front_end_) front_end_.emplace(feature_options(options_), options_.threads);
  front_end_->keep(wanted);
  front_end_->leave_alone(left_alone());
  return step(frame, (*front_end_)(frame, match_stereo_), load_milliseconds);
}

const FrameRecord& Pipeline::step(const StereoFrame& frame, const FramePoints& points,
                                  double load_milliseconds) {
  if (points.left_alone != left_alone())  // they were found before this was known
    return step_by_own_points(frame, points.wanted > 0 ? points.wanted : budget_.points(), load_milliseconds);
  FrameRecord& result = record_.frames.emplace_back();
  const auto of = [&](Stage stage) -> double& {
    return result.milliseconds[static_cast<std::size_t>(stage)];
  };
  of(Stage::load) = load_milliseconds;
  of(Stage::detect) = points.detect_milliseconds;
  of(Stage::stereo) = points.stereo_milliseconds;
  of(Stage::total) = ahead_ = points.detect_milliseconds + points.stereo_milliseconds;
  begun_ = std::chrono::steady_clock::now();
  try {
    work_on(frame, points, result);
    if (may_begin_again_) beginning_.push_back(frame);
  } catch (...) {
    record_.frames.pop_back();  // the record holds whole frames
    throw;
  }
  if (begin_again()) return record_.frames.back();
  result.points_wanted = points.wanted;
  result.shed = budget_.finish(result.points_left, points.wanted, of(Stage::total));
  return result;
}

/// Work on this frame so far. [ms]
double Pipeline::spent() const {
  return ahead_ +
         std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begun_).count();
}

/// Does work that a frame can do without, where its budget has time for it.
template <class Work>
void Pipeline::if_time(Shed kind, const Work& work, bool always) {
  if (!always && !budget_.allows(kind, spent())) return;
  double milliseconds = 0;
  {
    const Stopwatch watch(milliseconds);
    work();
  }
  budget_.took(kind, milliseconds);
}

std::shared_ptr<const StereoMatcher> Pipeline::settled_matcher() const {
  return corrects_rig() ? nullptr : match_stereo_;
}

/// Whether the rig is or may yet come to be another than it is now.
bool Pipeline::corrects_rig() const {
  if (map_.empty()) return options_.calibrate != Calibration::off;
  return loose_ || map_.rig_correction();
}

void Pipeline::work_on(const StereoFrame& frame, const FramePoints& points, FrameRecord& result) {
  result.index = frame.index;
  result.time = frame.time;
  left_ = &points.left;
  image_ = frame.left;
  timed(result, Stage::total, [&] {
    if (!riding_along_)
      riding_along_.emplace(frame.left, frame.right,
                            RidingAlongOptions{options_.min_inliers, options_.relocating_inliers});
    const std::optional<std::string> torn = of_two_moments(frame);
    timed(result, Stage::stereo, [&] {
      std::vector<PointPair> pairs =
          points.matched_by == match_stereo_ ? points.pairs : pairs_of(frame, points);
      if (map_.empty() && !torn && level_rig(frame, points, pairs)) pairs = pairs_of(frame, points);
      constexpr std::size_t beginning = 3;  // frames; one can show nothing
      if (!torn && record_.frames.size() <= beginning)
        if (const auto why = mistaken_sides(rig_, options_.stereo, frame, points, pairs, options_.threads))
          cairn::raise(frame.name + ": " + *why);
      find_local_landmarks(points, pairs);
    });
    motion_.predict(seconds_between(time_.value_or(frame.time), frame.time));
    time_ = frame.time;
    if (torn)
      lose(frame, *torn, result);
    else if (map_.empty())
      begin(frame, result);
    else
      follow(frame, result);
  });
  if (const auto note = riding_along_->close_frame(result.index)) record_.notes.push_back(*note);
  result.truth = truth_in_map(frame, result.tracked);
  result.points_left = static_cast<int>(points.left.size());
  result.points_right = static_cast<int>(points.right.size());
  result.stereo_matches = static_cast<int>(locals_.size());
  result.T_world_camera = T_world_camera_;
  result.covariance = pose_covariance_;
  result.landmarks = landmarks_.size();
  result.keyframes = map_.keyframe_count();
  if (!map_.empty()) {
    result.reference = map_.keyframes_added() - 1;
    result.T_world_reference = map_.keyframe_pose(result.reference).value_or(cairn::SE3());
  }
  ++step_;
}

/// Where the frame is in truth. Where the map lies in that world it knows of the frame that it began with; in
/// another world it lies as the first pose that is found says.
std::optional<cairn::SE3> Pipeline::truth_in_map(const StereoFrame& frame, bool tracked) {
  if (!frame.truth) return std::nullopt;
  if (!truth_ || truth_->name != frame.truth_world) {
    if (!tracked) return std::nullopt;
    truth_ = {frame.truth_world, *frame.truth * T_world_camera_.inverse()};
    record_.truth_laid_on_estimate = pose_covariance_.diagonal().maxCoeff() > gauge_variance;
    if (record_.truth_laid_on_estimate)
      record_.notes.push_back(frame.name +
                              ": the truth is in a world that the map does not know and is laid on the pose "
                              "estimated here, whose error is in all others: no NEES");
  }
  return truth_->T_truth_map.inverse() * *frame.truth;
}

/// Takes the right camera to be pitched as its rows are; false where they are as the rig says.
bool Pipeline::level_rig(const StereoFrame& frame, const FramePoints& points,
                         std::span<const PointPair> pairs) {
  const auto level = levelled(rig_, options_.stereo, frame, points, pairs, options_.threads);
  if (!level) return false;
  const auto rounded = [](double value) { return cairn::shortest(std::round(1e3 * value) / 1e3); };
  const std::string seen =
      "the rows of the right image are " + rounded(level->rows) + " pixels from where the rig has them";
  if (options_.calibrate == Calibration::off)
    cairn::raise(frame.name + ": " + seen +
                 ": expected a rig that is calibrated as these images are (calibrate_stereo makes one), or "
                 "--calibrate auto, which corrects it");
  record_.notes.push_back(frame.name + ": " + seen + "; its camera is taken to be turned by " +
                          rounded(level->angle * 180 / std::numbers::pi) + " degrees about its x axis");
  levelled_ = true;
  look_through(level->rig);
  map_ = cairn::KeyframeMap(rig_, map_options(options_));
  calibration_ = SelfCalibration(rig_, options_.calibration);
  return true;
}

/// What says that the two images are not of one moment: one of them, and not the other, is that of the frame
/// before to the last bit. A camera that hangs is no other way to be seen: its points lie where the map has
/// them, and by what the other image shows they move in depth.
std::optional<std::string> Pipeline::of_two_moments(const StereoFrame& frame) {
  const bool left_again = frame.left == last_left_, right_again = frame.right == last_right_;
  if (!left_again) last_left_ = frame.left;
  if (!right_again) last_right_ = frame.right;
  if (left_again == right_again) return std::nullopt;
  return std::string("the ") + (left_again ? "left" : "right") +
         " image is that of the frame before, and the other is not";
}

/// The first frame that shows enough is where the world begins.
void Pipeline::begin(const StereoFrame& frame, FrameRecord& result) {
  result.tracked = locals_.size() >= options_.min_inliers;
  if (!result.tracked)
    return lose(frame, "too few points with a place make no beginning" + oddity_of(rig_, frame), result);
  timed(result, Stage::store, [&] {
    choose_calibration();
    map_.begin(T_world_camera_);
    add_landmarks({}, frame);
    close_step();
  });
  pose_covariance_ = cairn::Matrix<6>::Identity() * (options_.map.first_sigma * options_.map.first_sigma);
  motion_.begin(T_world_camera_, pose_covariance_);
  result.keyframe = true;
}

/// Whether the rig is to be part of the map's joint state.
void Pipeline::choose_calibration() {
  CalibrationRecord& record = record_.calibration;
  record.on = options_.calibrate == Calibration::on;
  record.why = as_asked(options_);
  if (options_.calibrate == Calibration::drifting) return follow_rig(record.why);
  if (options_.calibrate == Calibration::automatic) {
    const VerticalDisparity seen = disparity_of_locals();
    record.on = seen.shows() || levelled_;
    record.why = in_words(seen) + (levelled_ ? ", and the rig had to be levelled" : "");
  }
  if (!record.on) return;
  cairn::KeyframeMapOptions with_rig = map_options(options_);
  // The map takes pixels for independent and multiplies its covariances by how much they are not. What is
  // known beforehand of the rig is put on the same scale.
  with_rig.rig = options_.rig.scaled(1 / std::sqrt(NoiseFactors::by_keypoints));
  map_ = cairn::KeyframeMap(rig_, with_rig);
}

/// A rig that no longer is as the map knows it has come loose. One frame can be wrong.
void Pipeline::watch_rig() {
  if (options_.calibrate != Calibration::automatic) return;
  const VerticalDisparity seen = disparity_of_locals();
  constexpr int beyond_chance = 5;
  shown_off_ = seen.shows() ? shown_off_ + 1 : 0;
  const bool loose = map_.rig_correction() ? disparity_watch_.departs(seen) : shown_off_ >= beyond_chance;
  if (!loose) return;
  follow_rig("from frame " + std::to_string(step_) + " on: " + in_words(seen));
  record_.notes.push_back("the rig has come loose; its right camera is followed " + record_.calibration.why);
}

void Pipeline::follow_rig(const std::string& why) {
  record_.calibration.on = true;
  record_.calibration.why = why;
  loose_ = rig_;
  calibration_ = SelfCalibration(rig_, options_.calibration);
}

/// Against the rig as given, which stays the same while the map's estimate changes.
VerticalDisparity Pipeline::disparity_of_locals() const {
  std::vector<cairn::PixelPair> pairs;
  for (const LocalLandmark& local : locals_) pairs.push_back({local.left_pixel, local.right_pixel});
  return vertical_disparity(map_.nominal_rig(), pairs);
}

/// Every other frame: where it is, and what the map learns by it.
void Pipeline::follow(const StereoFrame& frame, FrameRecord& result) {
  std::vector<Match> matches = timed(result, Stage::match, [&] { return match_with_map(); });
  std::optional<Located> located = timed(result, Stage::pose, [&] { return locate(matches); });
  const bool refused = located && !believes(located->location);
  if (refused) {
    ++record_.refused;
    located.reset();
  }
  result.tracked = located.has_value();
  result.relocalised = located && lost_;
  result.map_matches = static_cast<int>(matches.size());
  const bool is_sample = record_.frames.size() == options_.sample_frame + 1;
  if (is_sample || options_.keep_newest) {
    const SampleFrame shown = sample_of(frame, matches, located ? located->agreed : std::vector<Match>());
    if (options_.keep_newest) record_.newest = shown;
    if (is_sample) record_.sample = shown;
  }
  if (!located)
    return lose(frame,
                refused ? "the pose that the map gives is not one that the motion can lead to"
                        : std::to_string(matches.size()) + " matches with the map do not agree on a pose",
                result);
  result.inliers = static_cast<int>(located->agreed.size());
  note_loop(*located);
  move_to(*located, result);
  if (!options_.localise)
    timed(result, Stage::update, [&] { make_keyframe_if_due(*located, frame, result); });
  timed(result, Stage::store, [&] {
    if (!options_.localise) if_time(Shed::tidying, [&] { age(*located); });
    close_step();
  });
  timed(result, Stage::update, [&] {
    if (loose_)
      calibrate(*located);
    else
      watch_rig();
  });
}

/// A frame that is nowhere: the camera is where its motion leads, as long as that is known.
void Pipeline::lose(const StereoFrame& frame, const std::string& why, FrameRecord& result) {
  T_last_camera_ = cairn::SE3();
  result.carried = !map_.empty() && !lost_ && motion_.knows();
  if (result.carried) {
    const cairn::Gaussian<cairn::SE3> pose = *motion_.pose();
    T_world_camera_ = pose.mean;
    pose_covariance_ = pose.covariance;
  } else {
    lost_ = !map_.empty();
  }
  record_.notes.push_back(frame.name + ": lost, " + why + "; the " +
                          (result.carried ? "motion goes on" : "last pose is kept until it is found again"));
}

/// Whether the camera can be there. One that is lost can be anywhere.
bool Pipeline::believes(const cairn::MapLocation& here) {
  if (!motion_.on()) return true;
  if (!lost_) return motion_.update(here.T_world_camera, here.covariance);
  motion_.begin(here.T_world_camera, here.covariance);
  return true;
}

std::vector<PointPair> Pipeline::pairs_of(const StereoFrame& frame, const FramePoints& points) const {
  return (*match_stereo_)(frame.left, points.left, frame.right, points.right, options_.threads);
}

/// The stereo pairs that make points in space.
void Pipeline::find_local_landmarks(const FramePoints& points, std::span<const PointPair> pairs) {
  locals_.clear();
  left_out_.clear();
  riding_along_->watch(points.left, points.right);
  for (const PointPair& pair : pairs) {
    if (riding_along_->hides(pair.left_pixel, pair.right_pixel)) continue;
    const double scale = left_->keypoints[pair.left].scale;
    const double sigma = options_.pixel_sigma * std::pow(scale, options_.scale_exponent);
    const cairn::Triangulation seen = triangulate_(pair.left_pixel, pair.right_pixel, sigma, sigma);
    if (!seen.good()) continue;
    if (const auto moved = put_back(seen.point))
      locals_.push_back({pair.left, pair.left_pixel, pair.right_pixel + *moved, sigma, pair, *moved});
  }
}

/// How far from where the right camera sees a point it would see it, were the rig as the map knows it: what
/// goes into the map is true of one rig, whatever that was when a place was seen.
std::optional<cairn::Vector<2>> Pipeline::put_back(const cairn::Vector<3>& point) const {
  if (!loose_) return cairn::Vector<2>::Zero();
  const auto known = rig_.project(point), now = loose_->project(point);
  if (!known || !now) return std::nullopt;
  return known->tail<2>() - now->tail<2>();
}

/// The landmark of the map that looks like each local one, where one clearly does (ratio test: Lowe, IJCV
/// 60, 2004, 7.1).
std::vector<Pipeline::Match> Pipeline::match_with_map() const {
  std::vector<Look> looks;
  looks.reserve(locals_.size());
  for (const LocalLandmark& local : locals_)
    looks.push_back({left_->descriptor(local.point), left_->keypoints[local.point].laplacian});
  const std::vector<std::optional<StoreMatch>> found = store_->match(looks, options_.threads);

  // Two local landmarks cannot be the same landmark: the one that looks more like it keeps it.
  std::vector<std::tuple<LandmarkId, float, std::uint32_t>> claims;
  for (std::size_t i = 0; i < found.size(); ++i)
    if (found[i]) claims.emplace_back(found[i]->id, found[i]->distance, static_cast<std::uint32_t>(i));
  std::ranges::sort(claims);
  std::vector<Match> matches;
  for (std::size_t i = 0; i < claims.size(); ++i)
    if (i == 0 || std::get<0>(claims[i]) != std::get<0>(claims[i - 1]))
      matches.push_back({std::get<2>(claims[i]), std::get<0>(claims[i])});
  earliest_first(matches);
  return matches;
}

/// RANSAC over the matches, a second look for landmarks that the pose says must be in view, and the last word
/// to the joint covariance of the keyframes that all of them rest on.
std::optional<Pipeline::Located> Pipeline::locate(std::vector<Match>& matches) {
  const auto estimate = [&](std::span<const cairn::StereoMatch> seen) {
    return cairn::estimate_stereo_pose(rig_, seen, pose_options(), prediction());
  };
  std::vector<Match> near = within_reach(matches);
  std::vector<cairn::StereoMatch> seen = observations(near);
  cairn::StereoPose pose = estimate(seen);
  if (!pose.good() && near.size() < matches.size()) {
    near = matches;
    seen = observations(near);
    pose = estimate(seen);
  }
  matches = std::move(near);
  leave_out_what_rides_along(pose, matches, seen, estimate);
  if (!pose.good()) return std::nullopt;
  expected_.clear();
  if_time(Shed::second_look, [&] { look_again(pose, matches); });
  Located located;
  located.sightings = sightings(matches);
  located.places = settle(pose.T_world_camera, matches, located.sightings);
  located.location = map_.locate(pose.T_world_camera, located.sightings);
  if (!located.location.good()) return std::nullopt;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (located.location.inliers[i] == 0) continue;
    located.agreed.push_back(matches[i]);
    located.agreed_sightings.push_back(located.sightings[i]);
  }
  if (lost_ && located.agreed.size() < options_.relocating_inliers) return std::nullopt;
  return located;
}

/// Makes `pose` the rig's where it is that of what rides along, and takes the matches with that out.
void Pipeline::leave_out_what_rides_along(cairn::StereoPose& pose, std::vector<Match>& matches,
                                          std::span<const cairn::StereoMatch> seen,
                                          const RidingAlong::Estimate& estimate) {
  std::vector<Apparent> apparent;
  apparent.reserve(matches.size());
  for (const Match& match : matches) {
    const LocalLandmark& local = locals_[match.local];
    Apparent& one = apparent.emplace_back();
    one.first = landmarks_[match.landmark].first_pixels.cast<double>();
    one.now << local.pair.left_pixel, local.pair.right_pixel;
  }
  RidingAlong::Decision decision =
      riding_along_->decide(std::move(pose), rig_.left, {seen, apparent}, estimate);
  pose = std::move(decision.pose);
  for (const std::size_t i : decision.riding) left_out_.push_back(matches[i].local);
  for (auto i = decision.riding.rbegin(); i != decision.riding.rend(); ++i) {
    matches.erase(matches.begin() + static_cast<std::ptrdiff_t>(*i));
    pose.inliers.erase(pose.inliers.begin() + static_cast<std::ptrdiff_t>(*i));
  }
}

/// What rides along and is noticed or suspected in the first frames was taken for the world until then, by
/// the rig's calibration as well: they are looked at anew with what is known now, from where the map began.
/// False where that is not so.
bool Pipeline::begin_again() {
  constexpr std::size_t longest = 12;  // frames
  if (!may_begin_again_) return false;
  const RidingAlong::Sureness sureness = riding_along_->sureness();
  const bool noticed = sureness > began_with_;
  may_begin_again_ = !noticed && beginning_.size() < longest;
  const std::vector<StereoFrame> frames =
      may_begin_again_ ? std::vector<StereoFrame>() : std::exchange(beginning_, {});
  if (!noticed) return false;
  Pipeline again(given_, options_);
  again.may_begin_again_ = sureness == RidingAlong::suspected;
  again.began_with_ = sureness;
  again.riding_along_ = std::move(riding_along_);
  again.riding_along_->begin_again();
  if (sureness == RidingAlong::known) again.record_.notes.push_back(record_.notes.back());
  std::vector<double> loading;
  for (const FrameRecord& frame : record_.frames)
    loading.push_back(frame.milliseconds[static_cast<std::size_t>(Stage::load)]);
  *this = std::move(again);
  for (std::size_t i = 0; i < frames.size(); ++i) step(frames[i], loading[i]);
  return true;
}

/// Which points of the frame are taken for a landmark already, or for what rides along.
std::vector<std::uint8_t> Pipeline::spoken_for(std::span<const Match> matches) const {
  std::vector<std::uint8_t> taken(locals_.size(), 0);
  for (const Match& match : matches) taken[match.local] = 1;
  for (const std::uint32_t local : left_out_) taken[local] = 1;
  return taken;
}

/// The matches whose landmark may be seen there from where the motion leads: all of them where that is not
/// known.
std::vector<Pipeline::Match> Pipeline::within_reach(const std::vector<Match>& matches) {
  if (lost_ || !motion_.on() || !motion_.knows()) return matches;
  const cairn::Gaussian<cairn::SE3> camera = *motion_.pose();
  const cairn::SE3 T_camera_world = camera.mean.inverse();
  const double gate = options_.motion_gate * options_.motion_gate;
  std::vector<Match> near;
  for (const Match& match : matches) {
    const LocalLandmark& local = locals_[match.local];
    const auto landmark = map_.landmark(match.landmark);
    if (!landmark) continue;
    const cairn::Vector<3> p = T_camera_world * landmark->mean;
    const auto seen = rig_.project_with_jacobian(p);
    if (!seen) continue;
    cairn::Matrix<3, 6> J;  // of p by a right step of the camera
    J << -cairn::Matrix<3>::Identity(), cairn::skew(p);
    const cairn::Matrix<3> R = T_camera_world.rotation().matrix();
    const cairn::Matrix<3> place =
        J * camera.covariance * J.transpose() + R * landmark->covariance * R.transpose();
    cairn::Matrix<4> P = seen->J_point * place * seen->J_point.transpose();
    P.diagonal().array() += local.sigma * local.sigma;
    const cairn::Vector<4> off =
        (cairn::Vector<4>() << local.left_pixel, local.right_pixel).finished() - seen->pixels;
    const cairn::Cholesky<4> root(P);
    if (root.good() && root.whiten(off).squaredNorm() < gate) near.push_back(match);
  }
  return near;
}

/// Landmarks that were born with a patch are seen where that is now. What its keypoint says is off by as much
/// as the one that it was born at was, twice the variance: that remains where the patch is not found, and
/// where there is no time to look for it. Returns what says where most are.
Places Pipeline::settle(const cairn::SE3& T_world_camera, std::span<const Match> matches,
                        std::span<cairn::StereoSighting> sightings) {
  struct Search {
    std::size_t match;
    const SurfacePatch* patch;
    cairn::SE3 T_now_then;
    double inverse_depth;  // then
    std::optional<FoundPatch> found;
  };
  std::vector<Search> searches;
  const cairn::SE3 T_camera_world = T_world_camera.inverse();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const SurfacePatch* const patch = landmarks_[matches[i].landmark].patch.get();
    if (patch == nullptr) continue;
    sightings[i].sigma *= std::numbers::sqrt2;
    if (!locals_[matches[i].local].pair.refined) continue;
    const auto T_world_then = map_.keyframe_pose(patch->keyframe);
    const auto landmark = map_.landmark(matches[i].landmark);
    if (!T_world_then || !landmark) continue;
    const double depth = (T_world_then->inverse() * landmark->mean)(2);
    if (depth > 0) searches.push_back({i, patch, T_camera_world * *T_world_then, 1 / depth, std::nullopt});
  }
  if (searches.empty()) return Places::keypoints;
  std::size_t settled = 0;
  if_time(Shed::patches, [&] {
    cairn::parallel_for(searches.size(), options_.threads, [&](std::size_t begin, std::size_t end) {
      for (Search& one : std::span(searches).subspan(begin, end - begin))
        one.found = find_patch(*one.patch, rig_.left, one.T_now_then, one.inverse_depth, image_,
                               sightings[one.match].left);
    });
    for (const Search& one : searches) {
      if (!one.found || one.found->correlation < options_.stereo.min_correlation) continue;
      cairn::StereoSighting& seen = sightings[one.match];
      seen.right += locals_[matches[one.match].local].pair.right_step(one.found->pixel - seen.left);
      seen.left = one.found->pixel;
      seen.sigma = std::hypot(options_.patch_sigma, one.found->sigma);
      ++settled;
    }
  });
  return 2 * settled > matches.size() ? Places::patches : Places::keypoints;
}

/// Landmarks that the keyframes in play saw, and no local one is taken for yet, are searched for where the
/// pose says they are.
void Pipeline::look_again(const cairn::StereoPose& pose, std::vector<Match>& matches) {
  const std::vector<std::uint8_t> taken = spoken_for(matches);
  std::vector<LandmarkId> known, in_play;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    known.push_back(matches[i].landmark);
    if (pose.inliers[i] != 0) in_play.push_back(matches[i].landmark);
  }
  std::ranges::sort(known);
  std::vector<FreePoint> points;
  for (std::uint32_t i = 0; i < locals_.size(); ++i)
    if (taken[i] == 0)
      points.push_back({i,
                        locals_[i].left_pixel,
                        locals_[i].right_pixel,
                        {left_->descriptor(locals_[i].point), left_->keypoints[locals_[i].point].laplacian}});
  for (const LandmarkId id : map_.seen_with(in_play)) {
    if (std::ranges::binary_search(known, id)) continue;
    const Landmark& landmark = landmarks_[id];
    if (const auto position = map_.landmark(id))
      expected_.push_back({id, position->mean, {landmark.descriptor, landmark.sign}});
  }
  GuidedMatchingOptions guided = options_.second_look;
  guided.max_distance = options_.store.max_distance;
  for (const GuidedMatch& match :
       match_guided(rig_, pose.T_world_camera, std::move(points), expected_, guided))
    matches.push_back({match.point, match.landmark});
}

void Pipeline::move_to(const Located& located, FrameRecord& result) {
  const cairn::MapLocation& here = located.location;
  T_last_camera_ = lost_ ? cairn::SE3() : T_world_camera_.inverse() * here.T_world_camera;
  lost_ = false;
  T_world_camera_ = here.T_world_camera;
  pose_covariance_ = here.covariance;
  result.fit = noise_factors_.observe(here, located.places);
  map_.set_variance_factors(noise_factors_.pixels(), noise_factors_.poses());
  for (const Match& match : located.agreed) {
    Landmark& landmark = landmarks_[match.landmark];
    ++landmark.sightings;
    landmark.last_seen = step_;
    store_->sighted(match.landmark);
  }
}

/// A keyframe is due when much less of what is seen is known than was at best since the last one, and can be
/// put off until it is as much less again.
void Pipeline::make_keyframe_if_due(const Located& located, const StereoFrame& frame, FrameRecord& result) {
  const double share =
      static_cast<double>(located.agreed.size()) / static_cast<double>(locals_.size() - left_out_.size());
  best_share_ = std::max(best_share_, share);
  const double due = options_.keyframe_share * best_share_;
  if (share < due)
    if_time(
        Shed::keyframe, [&] { make_keyframe(located, frame, result); },
        share < options_.keyframe_share * due);
}

void Pipeline::make_keyframe(const Located& located, const StereoFrame& frame, FrameRecord& result) {
  if (!map_.add_keyframe(located.location, located.sightings)) return;
  if (map_.rig_correction()) look_through(map_.rig());
  if_time(Shed::tidying, [&] { merge_twins(located); });
  add_landmarks(located.agreed, frame);
  result.keyframe = true;
  best_share_ = 0;
}

/// Local landmarks without a partner are new.
void Pipeline::add_landmarks(const std::vector<Match>& known, const StereoFrame& frame) {
  // A patch says where its landmark is to a twentieth of a pixel, and lenses that are wrong by more do not
  // let it: on a recorded drive that nothing was chosen on, patches doubled the error. Of a rig that comes
  // loose they make a smaller error whose NEES is nine times as large.
  const bool with_patches = options_.patches && !corrects_rig();
  const std::vector<std::uint8_t> taken = spoken_for(known);
  for (std::uint32_t i = 0; i < locals_.size(); ++i) {
    if (taken[i] != 0) continue;
    const cairn::Keypoint& point = left_->keypoints[locals_[i].point];
    const std::span<const float> look = left_->descriptor(locals_[i].point);
    Landmark landmark;
    if (with_patches && locals_[i].pair.refined)
      if (auto patch = SurfacePatch::of(frame.left, locals_[i].left_pixel,
                                        match_stereo_->slope_of_inverse_depth(locals_[i].pair),
                                        map_.keyframes_added() - 1))
        landmark.patch = std::make_shared<const SurfacePatch>(*patch);
    landmark.id = store_->add({look, point.laplacian});
    cairn::StereoSighting seen = sighting(i, landmark.id);
    if (landmark.patch) seen.sigma = options_.patch_sigma;
    if (!map_.add_landmark(seen)) {
      store_->erase(landmark.id);
      continue;
    }
    landmark.descriptor.assign(look.begin(), look.end());
    landmark.sign = point.laplacian;
    landmark.grey =
        frame.left(static_cast<int>(std::lround(point.x)), static_cast<int>(std::lround(point.y)));
    landmark.first_seen = landmark.last_seen = step_;
    landmark.first_pixels << locals_[i].left_pixel.cast<float>(),
        (locals_[i].right_pixel - locals_[i].moved).cast<float>();
    landmarks_.add(std::move(landmark));
  }
}

/// Promotion, expiry, insertion, and what the map gave up by itself.
void Pipeline::close_step() {
  for (const LandmarkId id : map_.take_dropped()) {
    store_->erase(id);
    landmarks_.remove(id);
  }
  keep_bounded();
  for (const LandmarkId id : store_->advance()) {
    map_.forget(id);
    landmarks_.remove(id);
  }
}

/// Over the cap those leave that were seen least often, of these the ones not seen for longest.
void Pipeline::keep_bounded() {
  if (landmarks_.size() <= options_.max_landmarks) return;
  std::vector<std::tuple<int, int, LandmarkId>> order;
  for (const Landmark& landmark : landmarks_.all())
    order.emplace_back(landmark.sightings, landmark.last_seen, landmark.id);
  const auto surplus = static_cast<std::ptrdiff_t>(landmarks_.size() - options_.max_landmarks);
  std::ranges::nth_element(order, order.begin() + surplus);
  for (auto gone = order.begin(); gone != order.begin() + surplus; ++gone) forget(std::get<2>(*gone));
}

void Pipeline::forget(LandmarkId id) {
  map_.forget(id);
  store_->erase(id);
  landmarks_.remove(id);
}

/// Whether a place is met again, and where the frame would be without it.
void Pipeline::note_loop(const Located& located) {
  std::vector<int> away;
  std::vector<double> back;
  std::vector<cairn::StereoSighting> others;
  for (const cairn::StereoSighting& seen : located.agreed_sightings) {
    away.push_back(step_ - landmarks_[seen.landmark].last_seen);
    if (loop_watch_.comes_back(away.back()))
      back.push_back(away.back());
    else
      others.push_back(seen);
  }
  if (!loop_watch_.observe(step_, away) || lost_) return;
  LoopClosure loop{record_.frames.size() - 1, back.size(), 0, std::nullopt};
  loop.away = static_cast<int>(cairn::median(std::move(back)));
  if_time(Shed::tidying, [&] {
    const cairn::MapLocation before = map_.locate(located.location.T_world_camera, others);
    if (before.good()) loop.T_world_before = before.T_world_camera;
  });
  record_.loops.push_back(loop);
}

/// Landmarks that are hardly ever found where they must be go: what they were is no more, or never was.
void Pipeline::age(const Located& located) {
  std::vector<LandmarkId> seen;
  for (const Match& match : located.agreed) {
    seen.push_back(match.landmark);
    if (map_.contains(match.landmark)) ++landmarks_[match.landmark].expected;
  }
  std::ranges::sort(seen);
  const cairn::SE3 T_camera_world = T_world_camera_.inverse();
  for (const ExpectedLandmark& one : expected_) {
    if (!map_.contains(one.id) || std::ranges::binary_search(seen, one.id)) continue;
    const auto pixels = rig_.project(T_camera_world * one.position);
    const double margin = options_.second_look.radius;
    if (!pixels || !rig_.left.contains(pixels->head<2>(), margin) ||
        !rig_.right.contains(pixels->tail<2>(), margin))
      continue;
    Landmark& landmark = landmarks_[one.id];
    ++landmark.expected;
    if (landmark.expected < options_.ageing_frames ||
        landmark.sightings >= options_.ageing_share * landmark.expected)
      continue;
    forget(one.id);
    ++record_.aged;
  }
}

/// Landmarks that are where an agreeing one is and look like it are that one: the younger goes. Its sightings
/// are not taken over, so that nothing is counted twice.
void Pipeline::merge_twins(const Located& located) {
  std::vector<LandmarkId> seen;
  std::vector<FreePoint> points;
  std::vector<LandmarkId> landmark_of(locals_.size());
  for (const Match& match : located.agreed) {
    const LocalLandmark& local = locals_[match.local];
    seen.push_back(match.landmark);
    landmark_of[match.local] = match.landmark;
    points.push_back({match.local,
                      local.left_pixel,
                      local.right_pixel,
                      {left_->descriptor(local.point), left_->keypoints[local.point].laplacian}});
  }
  std::ranges::sort(seen);
  std::vector<ExpectedLandmark> others;
  for (const ExpectedLandmark& one : expected_)
    if (!std::ranges::binary_search(seen, one.id)) others.push_back(one);
  const GuidedMatchingOptions near{options_.twin_radius, options_.store.max_distance};
  for (const GuidedMatch& twin : match_guided(rig_, T_world_camera_, std::move(points), others, near)) {
    LandmarkId kept = landmark_of[twin.point], gone = twin.landmark;
    if (!map_.contains(kept) || !map_.contains(gone)) continue;
    if (std::pair(landmarks_[gone].first_seen, gone) < std::pair(landmarks_[kept].first_seen, kept))
      std::swap(kept, gone);
    Landmark& older = landmarks_[kept];
    older.sightings += landmarks_[gone].sightings;
    older.expected += landmarks_[gone].expected;
    older.last_seen = std::max(older.last_seen, landmarks_[gone].last_seen);
    store_->merge(kept, gone);
    map_.forget(gone);
    landmarks_.remove(gone);
    ++record_.merged;
  }
}

/// What the landmarks' motion in the images says of the rig.
void Pipeline::calibrate(const Located& located) {
  std::vector<Sighting> seen;
  seen.reserve(located.agreed.size());
  for (std::size_t i = 0; i < located.agreed.size(); ++i) {
    const cairn::StereoSighting& one = located.agreed_sightings[i];
    const cairn::Vector<2> right = one.right - locals_[located.agreed[i].local].moved;
    seen.push_back({one.landmark, one.left, right, one.sigma});
  }
  calibration_.observe(step_, T_world_camera_, std::move(seen));
  loose_ = calibration_.next().corrected();
  find_pairs_by(*loose_);
}

void Pipeline::look_through(const cairn::StereoRig& rig) {
  rig_ = rig;
  find_pairs_by(loose_.value_or(rig));
}

void Pipeline::find_pairs_by(const cairn::StereoRig& rig) {
  triangulate_ = cairn::Triangulator(rig, triangulation_options(options_, rig));
  match_stereo_ = std::make_shared<const StereoMatcher>(rig, options_.stereo);
}

void Pipeline::earliest_first(std::vector<Match>& matches) const {
  std::ranges::sort(matches, {}, [&](const Match& match) {
    return std::pair(landmarks_[match.landmark].first_seen, match.landmark);
  });
}

/// The matches as a pose is estimated from them; those whose landmark the map gave up are taken out.
std::vector<cairn::StereoMatch> Pipeline::observations(std::vector<Match>& matches) {
  std::vector<cairn::StereoMatch> result;
  result.reserve(matches.size());
  std::erase_if(matches, [&](const Match& match) {
    const LocalLandmark& local = locals_[match.local];
    const auto landmark = map_.landmark(match.landmark);
    if (landmark)
      result.push_back({landmark->mean, landmark->covariance, local.left_pixel, local.right_pixel,
                        local.sigma, local.sigma});
    return !landmark;
  });
  return result;
}

cairn::StereoSighting Pipeline::sighting(std::uint32_t local, LandmarkId landmark) const {
  return {landmark, locals_[local].left_pixel, locals_[local].right_pixel, locals_[local].sigma};
}

std::vector<cairn::StereoSighting> Pipeline::sightings(std::span<const Match> matches) const {
  std::vector<cairn::StereoSighting> result;
  result.reserve(matches.size());
  for (const Match& match : matches) result.push_back(sighting(match.local, match.landmark));
  return result;
}

/// Where the motion of the last step leads; of a camera that is lost nothing is known.
std::optional<cairn::PosePrior> Pipeline::prediction() const {
  if (lost_) return std::nullopt;
  if (const auto pose = motion_.pose(); motion_.on() && pose) return cairn::PosePrior{pose->mean};
  return cairn::PosePrior{T_world_camera_ * T_last_camera_};
}

cairn::StereoPoseOptions Pipeline::pose_options() const {
  cairn::StereoPoseOptions pose;
  pose.ransac.seed = options_.seed + static_cast<std::uint64_t>(step_);
  pose.ransac.order = cairn::SamplingOrder::progressive;
  pose.min_inliers = options_.min_inliers;
  return pose;
}

SampleFrame Pipeline::sample_of(const StereoFrame& frame, const std::vector<Match>& matches,
                                const std::vector<Match>& agreed) const {
  SampleFrame sample{frame.index, frame.left, frame.right, {}};
  for (const LocalLandmark& local : locals_) {
    const cairn::Vector<2> seen = local.right_pixel - local.moved;  // where the image shows it
    const cairn::Vector<4, float> p = (cairn::Vector<4>() << local.left_pixel, seen).finished().cast<float>();
    sample.points.push_back({p(0), p(1), p(2), p(3), SamplePoint::Kind::fresh});
  }
  for (const Match& match : matches) sample.points[match.local].kind = SamplePoint::Kind::matched;
  for (const Match& match : agreed) sample.points[match.local].kind = SamplePoint::Kind::inlier;
  return sample;
}

SavedMap Pipeline::map() const {
  SavedMap saved{options_.features, options_.oriented, step_, map_, {}, std::nullopt};
  for (const Landmark& landmark : landmarks_.all())
    if (store_->is_base(landmark.id) && map_.contains(landmark.id))
      saved.landmarks.push_back(landmark);
    else
      static_cast<void>(saved.map.forget(landmark.id));
  std::ranges::sort(saved.landmarks, {}, &Landmark::id);
  saved.map.renumber();
  for (std::size_t i = 0; i < saved.landmarks.size(); ++i) saved.landmarks[i].id = static_cast<LandmarkId>(i);
  if (truth_ && !truth_->name.empty() && !record_.truth_laid_on_estimate) saved.truth = truth_;
  return saved;
}

/// Every frame keeps its place beside the keyframe that was newest then; where that has left, it moves as the
/// frames nearest in time do whose keyframe is there.
std::vector<cairn::SE3> Pipeline::corrected_path(const std::vector<FrameRecord>& frames) const {
  std::vector<std::size_t> known;
  for (std::size_t i = 0; i < frames.size(); ++i)
    if (map_.keyframe_pose(frames[i].reference)) known.push_back(i);
  std::vector<cairn::SE3> path;
  std::size_t next = 0;  // of the known, the first at or after frame i
  for (std::size_t i = 0; i < frames.size(); ++i) {
    path.push_back(frames[i].T_world_camera);
    if (known.empty()) continue;
    while (next < known.size() && known[next] < i) ++next;
    std::size_t nearest = next == known.size() ? known.back() : known[next];
    if (next > 0 && i - known[next - 1] < std::max(nearest, i) - i) nearest = known[next - 1];
    const FrameRecord& of = frames[nearest];
    path.back() = *map_.keyframe_pose(of.reference) * of.T_world_reference.inverse() * path.back();
  }
  return path;
}

RunRecord Pipeline::record() {
  RunRecord record = record_;
  if (riding_along_) record.riding_along = riding_along_->record();
  record.variance_factor = noise_factors_.poses();
  record.rig = rig_;
  lay_lost_frames(record.frames, options_.motion.process);
  record.corrected = corrected_path(record.frames);
  if (const auto rig = map_.rig_correction()) {
    record.calibration.numbers = rig->mean;
    const cairn::RigState before = options_.rig.each();
    for (int i = 0; i < cairn::rig_numbers; ++i)  // what is held to be known was not estimated
      record.calibration.sigmas(i) = before(i) > 0 ? std::sqrt(rig->covariance(i, i)) : 0;
  }
  if (loose_) {
    const cairn::CalibrationDrift known = calibration_.now();
    record.rig = known.corrected();
    record.calibration.numbers.head<5>() = cairn::RigCorrection(map_.nominal_rig()).state(record.rig);
    record.calibration.sigmas.head<5>() = known.covariance().diagonal().cwiseSqrt();
  }
  record.landmarks.reserve(landmarks_.size());
  for (const Landmark& landmark : landmarks_.all())
    if (const auto position = map_.landmark_in_world(landmark.id))
      record.landmarks.push_back({position->mean, position->covariance, landmark.grey,
                                  step_ - 1 - landmark.first_seen, landmark.sightings});
  return record;
}

}  // namespace stereo_slam
