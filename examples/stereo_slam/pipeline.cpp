// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "pipeline.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <cairn/core/parallel.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/structured.hpp>

namespace stereo_slam {
namespace {

/// Adds the time of its own life to a stage of a frame's record.
class StageTimer {
public:
  StageTimer(FrameRecord& record, Stage stage)
      : milliseconds_(record.milliseconds[static_cast<std::size_t>(stage)]) {}
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;
  ~StageTimer() {
    milliseconds_ +=
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
  }

private:
  double& milliseconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// A landmark stands still: F = I, B = 0, and a little noise so that its filter never stops listening.
struct StandingStill {
  static constexpr bool linear = true;
  using State = cairn::Vector<3>;
  using Control = cairn::NoControl;
  double sigma;  ///< [m] a step
  [[nodiscard]] State propagate(const State& x, const Control&, double) const { return x; }
  [[nodiscard]] cairn::Identity<3> jacobian(const State&, const Control&, double) const { return {}; }
  [[nodiscard]] cairn::Matrix<3> noise(const State&, const Control&, double) const {
    return sigma * sigma * cairn::Matrix<3>::Identity();
  }
};

/// A stereo pair sees where a landmark is: H = I, R the anisotropic covariance of the triangulation.
struct SeenAt {
  static constexpr bool linear = true;
  using State = cairn::Vector<3>;
  using Measurement = cairn::Vector<3>;
  cairn::Matrix<3> R;
  [[nodiscard]] Measurement predict(const State& x) const { return x; }
  [[nodiscard]] cairn::Identity<3> jacobian(const State&) const { return {}; }
  [[nodiscard]] const cairn::Matrix<3>& noise(const State&) const { return R; }
};

FeatureOptions feature_options(const PipelineOptions& options) {
  return {.kind = options.features,
          .points = options.points,
          .surf_threshold = options.surf_threshold,
          .oriented = options.oriented,
          .threads = std::max(1U, options.threads / 2)};
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

float squared_distance(std::span<const float> a, std::span<const float> b) {
  float sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

}  // namespace

Pipeline::Pipeline(const cairn::StereoRig& rig, const PipelineOptions& options)
    : options_(options),
      rig_(rig),
      extract_left_(make_extractor(feature_options(options))),
      extract_right_(make_extractor(feature_options(options))),
      match_stereo_(rig, options.stereo),
      triangulate_(rig, triangulation_options(options, rig)),
      calibration_(rig, options.calibration),
      store_(make_landmark_store(store_options(options))),
      pose_covariance_(cairn::Matrix<6>::Zero()) {
  record_.seed = options.seed;
  record_.threads = options.threads;
  record_.target_points = options.points;
  record_.features = feature_names[static_cast<std::size_t>(options.features)];
  record_.store = options.store.kind == StoreKind::multi ? "multi" : "single";
}

const FrameRecord& Pipeline::step(const StereoFrame& frame, double load_milliseconds) {
  record_.frames.emplace_back();
  try {
    return work_on(frame, load_milliseconds);
  } catch (...) {
    record_.frames.pop_back();  // the record holds whole frames
    throw;
  }
}

const FrameRecord& Pipeline::work_on(const StereoFrame& frame, double load_milliseconds) {
  FrameRecord& result = record_.frames.back();
  result.index = frame.index;
  result.time = frame.time;
  result.milliseconds[static_cast<std::size_t>(Stage::load)] = load_milliseconds;
  {
    const StageTimer timer(result, Stage::total);
    detect(frame);
    find_local_landmarks(frame);
    std::vector<Match> matches = match_with_map();
    const std::optional<Located> located = locate(matches);
    if (located) {
      move_to(located->pose);
      refine_landmarks(located->agreed);
      extend_map(located->agreed, frame);
      close_step();
      if (options_.calibrate) calibrate(located->agreed);
    } else {
      stay();
      record_.notes.push_back(frame.name + ": lost, " + std::to_string(matches.size()) +
                              " matches with the map do not agree on a pose; the last pose is kept");
    }
    if (record_.frames.size() == options_.sample_frame + 1)
      keep_sample(frame, matches, located ? located->agreed : std::vector<Match>());
    result.tracked = located.has_value();
    result.map_matches = static_cast<int>(matches.size());
    result.inliers = located ? static_cast<int>(located->agreed.size()) : 0;
  }
  if (frame.truth) {
    if (!T_truth_world_) T_truth_world_ = *frame.truth * T_world_camera_.inverse();
    result.truth = T_truth_world_->inverse() * *frame.truth;
  }
  result.points_left = static_cast<int>(left_->size());
  result.points_right = static_cast<int>(right_->size());
  result.stereo_matches = static_cast<int>(locals_.size());
  result.landmarks = landmarks_.size();
  ++step_;
  return result;
}

/// Interest points of both images, one thread each.
void Pipeline::detect(const StereoFrame& frame) {
  const StageTimer timer(record_.frames.back(), Stage::detect);
  cairn::parallel_for(2, options_.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t side = begin; side < end; ++side)
      (side == 0 ? left_ : right_) = side == 0 ? &extract_left_(frame.left) : &extract_right_(frame.right);
  });
}

/// Stereo pairs become points in space with the anisotropic covariance of their triangulation.
void Pipeline::find_local_landmarks(const StereoFrame& frame) {
  const StageTimer timer(record_.frames.back(), Stage::stereo);
  const std::vector<PointPair> pairs =
      match_stereo_(frame.left, *left_, frame.right, *right_, options_.threads);
  locals_.clear();
  for (const PointPair& pair : pairs) {
    const double growth = std::max(1.0F, left_->keypoints[pair.left].scale / options_.fine_scale);
    const double sigma = options_.pixel_sigma * growth;
    const cairn::Triangulation point = triangulate_(pair.left_pixel, pair.right_pixel, sigma, sigma);
    if (!point.good()) continue;
    locals_.push_back({pair.left, pair.left_pixel, pair.right_pixel, sigma, point.point, point.covariance});
  }
}

/// The landmark of the map that looks like each local one, where one clearly does. (thesis 1.4: ratio test)
std::vector<Pipeline::Match> Pipeline::match_with_map() const {
  const StageTimer timer(record_.frames.back(), Stage::match);
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
/// to the earliest of those that agree.
std::optional<Pipeline::Located> Pipeline::locate(std::vector<Match>& matches) const {
  const StageTimer timer(record_.frames.back(), Stage::pose);
  if (landmarks_.size() == 0) {  // the first frame that shows anything is where the world begins
    if (locals_.size() < options_.min_inliers) return std::nullopt;
    Located start;
    start.pose.T_world_camera = T_world_camera_;
    return start;
  }
  const cairn::PosePrior prediction{predicted_pose()};
  cairn::StereoPose pose =
      cairn::estimate_stereo_pose(rig_, observations(matches), pose_options(), prediction);
  if (!pose.good()) return std::nullopt;
  second_look(pose.T_world_camera, matches);
  earliest_first(matches);
  pose = cairn::refine_stereo_pose(rig_, observations(matches), pose.T_world_camera, pose_options());
  if (!pose.good()) return std::nullopt;
  Located located;
  for (std::size_t i = 0; i < matches.size(); ++i)
    if (pose.inliers[i] != 0) located.agreed.push_back(matches[i]);
  located.pose = decide_by_earliest(located.agreed, pose);
  return located;
}

/// Looks around where the pose says a landmark is for a local one that looks like it. Finds those that the
/// ratio test dropped because two landmarks look alike; without it they would enter the map a second time.
void Pipeline::second_look(const cairn::SE3& T_world_camera, std::vector<Match>& matches) const {
  std::vector<std::uint8_t> taken(locals_.size(), 0);
  std::vector<LandmarkId> known;
  for (const Match& match : matches) {
    taken[match.local] = 1;
    known.push_back(match.landmark);
  }
  std::ranges::sort(known);
  std::vector<std::uint32_t> by_row;
  for (std::uint32_t i = 0; i < locals_.size(); ++i)
    if (taken[i] == 0) by_row.push_back(i);
  const auto row = [&](std::uint32_t i) { return locals_[i].left_pixel(1); };
  std::ranges::sort(by_row, [&](auto a, auto b) { return std::pair(row(a), a) < std::pair(row(b), b); });

  struct Candidate {
    float distance;
    std::uint32_t local;
    LandmarkId landmark;
    auto operator<=>(const Candidate&) const = default;
  };
  const double radius = options_.second_look_radius;
  const float most = static_cast<float>(options_.store.max_distance * options_.store.max_distance);
  const cairn::SE3 T_camera_world = T_world_camera.inverse();
  const cairn::Matrix<3> R = T_camera_world.rotation().matrix();
  std::vector<Candidate> candidates;
  for (const Landmark& landmark : landmarks_.all()) {
    const cairn::Vector<3> p = R * landmark.position.mean + T_camera_world.translation();
    if (p(2) < rig_.baseline() || std::ranges::binary_search(known, landmark.id)) continue;
    const auto pixels = rig_.project(p);
    if (!pixels || !rig_.left.contains(pixels->head<2>())) continue;
    auto near = std::ranges::lower_bound(by_row, (*pixels)(1) - radius, {}, row);
    for (; near != by_row.end() && row(*near) <= (*pixels)(1) + radius; ++near) {
      const LocalLandmark& local = locals_[*near];
      if ((local.left_pixel - pixels->head<2>()).squaredNorm() > radius * radius) continue;
      if ((local.right_pixel - pixels->tail<2>()).squaredNorm() > radius * radius) continue;
      if (left_->keypoints[local.point].laplacian != landmark.sign) continue;
      const float distance = squared_distance(left_->descriptor(local.point), landmark.descriptor);
      if (distance <= most) candidates.push_back({distance, *near, landmark.id});
    }
  }
  std::ranges::sort(candidates);
  std::vector<LandmarkId> given;
  for (const Candidate& candidate : candidates) {
    if (taken[candidate.local] != 0 || std::ranges::find(given, candidate.landmark) != given.end()) continue;
    taken[candidate.local] = 1;
    given.push_back(candidate.landmark);
    matches.push_back({candidate.local, candidate.landmark});
  }
}

/// The pose by as few of the earliest landmarks as determine it about as well as all of them do. (thesis 3.5)
cairn::StereoPose Pipeline::decide_by_earliest(const std::vector<Match>& agreed,
                                               const cairn::StereoPose& all) const {
  for (std::size_t count = options_.earliest; count < agreed.size(); count *= 2) {
    // Landmarks of one step stand together: take the whole of the step that the count reaches.
    const int last_step = landmarks_[agreed[count - 1].landmark].first_seen;
    std::size_t end = count;
    while (end < agreed.size() && landmarks_[agreed[end].landmark].first_seen == last_step) ++end;
    const cairn::StereoPose pose = cairn::refine_stereo_pose(rig_, observations(std::span(agreed).first(end)),
                                                             all.T_world_camera, pose_options());
    constexpr double much_vaguer = 9;  // in variance, along the worst direction
    if (pose.good() &&
        (pose.covariance.diagonal().array() <= much_vaguer * all.covariance.diagonal().array()).all())
      return pose;
  }
  return all;
}

void Pipeline::move_to(const cairn::StereoPose& pose) {
  T_last_camera_ = T_world_camera_.inverse() * pose.T_world_camera;
  T_world_camera_ = pose.T_world_camera;
  pose_covariance_ = pose.covariance;
  record_pose();
}

void Pipeline::stay() {
  T_last_camera_ = cairn::SE3();
  record_pose();
}

void Pipeline::record_pose() {
  record_.frames.back().T_world_camera = T_world_camera_;
  record_.frames.back().covariance = pose_covariance_;
}

/// Kalman filter of every landmark that was seen. Its R holds the pose's error too. (notes 11.4)
void Pipeline::refine_landmarks(const std::vector<Match>& agreed) {
  const StageTimer timer(record_.frames.back(), Stage::update);
  const cairn::Kalman filter{.gate = options_.landmark_gate};
  for (const Match& match : agreed) {
    Landmark& landmark = landmarks_[match.landmark];
    const LocalLandmark& local = locals_[match.local];
    const cairn::Gaussian<cairn::Vector<3>> seen = in_world(local);
    const double sigma = options_.landmark_noise * local.position(2);
    if (filter.predict(landmark.position, StandingStill{sigma}, 1.0) != cairn::Status::accepted) continue;
    if (!filter.update(landmark.position, SeenAt{seen.covariance}, seen.mean).accepted()) continue;
    ++landmark.sightings;
    landmark.seen(step_, local.left_pixel, local.right_pixel);
    store_->sighted(match.landmark);
  }
}

/// Local landmarks without a partner are new.
void Pipeline::extend_map(const std::vector<Match>& agreed, const StereoFrame& frame) {
  const StageTimer timer(record_.frames.back(), Stage::store);
  std::vector<std::uint8_t> known(locals_.size(), 0);
  for (const Match& match : agreed) known[match.local] = 1;
  for (std::size_t i = 0; i < locals_.size(); ++i) {
    if (known[i] != 0) continue;
    const LocalLandmark& local = locals_[i];
    const cairn::Keypoint& point = left_->keypoints[local.point];
    Landmark landmark;
    landmark.id = store_->add({left_->descriptor(local.point), point.laplacian});
    landmark.position = in_world(local);
    const std::span<const float> look = left_->descriptor(local.point);
    landmark.descriptor.assign(look.begin(), look.end());
    landmark.sign = point.laplacian;
    landmark.grey =
        frame.left(static_cast<int>(std::lround(point.x)), static_cast<int>(std::lround(point.y)));
    landmark.first_seen = step_;
    landmark.seen(step_, local.left_pixel, local.right_pixel);
    landmarks_.add(std::move(landmark));
  }
}

/// Promotion, expiry, insertion.
void Pipeline::close_step() {
  const StageTimer timer(record_.frames.back(), Stage::store);
  for (const LandmarkId id : store_->advance()) landmarks_.remove(id);
}

/// What the landmarks' motion in the images says of the rig.
void Pipeline::calibrate(const std::vector<Match>& agreed) {
  const StageTimer timer(record_.frames.back(), Stage::update);
  std::vector<Sighting> sightings;
  sightings.reserve(agreed.size());
  for (const Match& match : agreed) {
    const LocalLandmark& local = locals_[match.local];
    sightings.push_back({match.landmark, local.left_pixel, local.right_pixel, local.sigma});
  }
  if (calibration_.observe(T_world_camera_, std::move(sightings))) take_rig(calibration_.rig());
}

/// Another rig puts what was seen elsewhere: landmarks move as their last sighting does.
void Pipeline::take_rig(const cairn::StereoRig& rig) {
  const cairn::Triangulator triangulate(rig, triangulation_options(options_, rig));
  for (Landmark& landmark : landmarks_.all()) {
    const cairn::Triangulation before = triangulate_(landmark.left_pixel, landmark.right_pixel);
    const cairn::Triangulation after = triangulate(landmark.left_pixel, landmark.right_pixel);
    if (!before.good() || !after.good()) continue;
    const cairn::SE3& pose = record_.frames[static_cast<std::size_t>(landmark.last_seen)].T_world_camera;
    landmark.position.mean += pose.rotation() * (after.point - before.point);
  }
  rig_ = rig;
  triangulate_ = triangulate;
  match_stereo_ = StereoMatcher(rig, options_.stereo);
}

void Pipeline::earliest_first(std::vector<Match>& matches) const {
  std::ranges::sort(matches, {}, [&](const Match& match) {
    return std::pair(landmarks_[match.landmark].first_seen, match.landmark);
  });
}

std::vector<cairn::StereoMatch> Pipeline::observations(std::span<const Match> matches) const {
  std::vector<cairn::StereoMatch> result;
  result.reserve(matches.size());
  for (const Match& match : matches) {
    const LocalLandmark& local = locals_[match.local];
    const Landmark& landmark = landmarks_[match.landmark];
    result.push_back({landmark.position.mean, landmark.position.covariance, local.left_pixel,
                      local.right_pixel, local.sigma, local.sigma});
  }
  return result;
}

/// A local landmark in the world: R Sigma R^T + J P J^T, J = R [I, -skew(p)] the derivative by the pose.
cairn::Gaussian<cairn::Vector<3>> Pipeline::in_world(const LocalLandmark& local) const {
  const cairn::Matrix<3> R = T_world_camera_.rotation().matrix();
  cairn::Matrix<3, 6> J;
  J << R, -R * cairn::skew(local.position);
  return {T_world_camera_ * local.position,
          cairn::symmetrised(R * local.covariance * R.transpose() + J * pose_covariance_ * J.transpose())};
}

cairn::SE3 Pipeline::predicted_pose() const {
  return T_world_camera_ * T_last_camera_;
}

cairn::StereoPoseOptions Pipeline::pose_options() const {
  cairn::StereoPoseOptions pose;
  pose.ransac.seed = options_.seed + static_cast<std::uint64_t>(step_);
  pose.ransac.order = cairn::SamplingOrder::progressive;
  pose.min_inliers = options_.min_inliers;
  return pose;
}

void Pipeline::keep_sample(const StereoFrame& frame, const std::vector<Match>& matches,
                           const std::vector<Match>& agreed) {
  SampleFrame sample{frame.index, frame.left, frame.right, {}};
  for (const LocalLandmark& local : locals_) {
    const cairn::Vector<4, float> p =
        (cairn::Vector<4>() << local.left_pixel, local.right_pixel).finished().cast<float>();
    sample.points.push_back({p(0), p(1), p(2), p(3), SamplePoint::Kind::fresh});
  }
  for (const Match& match : matches) sample.points[match.local].kind = SamplePoint::Kind::matched;
  for (const Match& match : agreed) sample.points[match.local].kind = SamplePoint::Kind::inlier;
  record_.sample = std::move(sample);
}

RunRecord Pipeline::record() const {
  RunRecord record = record_;
  record.landmarks.reserve(landmarks_.size());
  for (const Landmark& landmark : landmarks_.all())
    record.landmarks.push_back({landmark.position.mean, landmark.position.covariance, landmark.grey,
                                step_ - 1 - landmark.first_seen, landmark.sightings});
  return record;
}

}  // namespace stereo_slam
