// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The map of a stereo camera whose covariance is true: keyframe poses in one joint Gaussian, landmarks
/// conditional on the keyframes that saw them.
///
/// All landmarks that a frame makes share the error of that frame's pose. A filter for each of them forgets
/// that, and the next pose then averages one error as if it were a thousand: its covariance is too small by a
/// factor that grows for ever. Here the poses of keyframes keep all their correlations, and each landmark
/// keeps the few sightings it follows from. Pixels are independent, so
///   p(map) = p(poses) prod_i p(x_i | poses of the keyframes that saw i)                   (1)
/// is exact, and costs 36 N^2 numbers for N keyframes, whatever the number of landmarks.
///
/// ```cpp
/// cairn::KeyframeMap map(rig);
/// map.begin(cairn::SE3());                                   // where the world is
/// for (const cairn::StereoSighting& s : first) map.add_landmark(s);
/// for (const Frame& frame : frames) {
///   const cairn::MapLocation here = map.locate(guess, frame.matches);  // leaves no trace in the map
///   if (!here.good() || !frame.shows_much_that_is_new) continue;
///   if (!map.add_keyframe(here, frame.matches)) continue;
///   for (const cairn::StereoSighting& s : frame.unmatched) map.add_landmark(s);
/// }
/// ```
///
/// What a sighting says is used in the covariance of the keyframes once: a keyframe learns from those of its
/// matches that it records in the landmarks' lists, no others, and the lists are short (a few sightings a
/// visit, six in all), so that what is seen for long does not pretend to be new. Landmarks and keyframes are
/// never moved towards the present; at a return it is the covariance that lets the earliest decide.
///
/// Frames: poses map the left camera's coordinates to the world's. Errors of keyframes are steps in the world
/// (world_pose.hpp). Deterministic; one thread.
///
/// (H. Strasdat, J. Montiel, A. Davison, "Visual SLAM: why filter?", Image and Vision Computing 30, 2012, for
/// keyframes; R. Smith, M. Self, P. Cheeseman, 1990, for what joint covariances are for; S. Schmidt 1966.)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/filter/joint_gaussian.hpp>
#include <cairn/geometry/rig_correction.hpp>
#include <cairn/geometry/robust_loss.hpp>
#include <cairn/geometry/stereo_rig.hpp>
#include <cairn/geometry/triangulation.hpp>
#include <cairn/manifold/se3.hpp>
#include <cairn/slam/detail/frame_work.hpp>
#include <cairn/slam/detail/keyframe_equations.hpp>
#include <cairn/slam/detail/keyframe_landmark.hpp>
#include <cairn/slam/map_location.hpp>
#include <cairn/slam/world_pose.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

struct KeyframeMapOptions {
  int sightings_a_visit = 3;  ///< recorded of a landmark while it stays in view
  int sightings = 6;          ///< recorded in all; at most 6
  int visit_gap = 20;         ///< frames out of view after which it is another visit
  std::size_t max_keyframes = 300;
  std::size_t min_matches = 10;    ///< fewer: no pose
  double gate_probability = 0.99;  ///< share of good matches that pass the chi-square gate
  RobustLoss loss = RobustLoss::cauchy;
  double loss_scale = 3;  ///< in standard deviations of the whole residual
  /// By how much the rig may be off. Where it is not known exactly, its numbers are part of the joint state
  /// and are learned with the keyframes.
  RigSigmas rig;
  /// Of the first keyframe, which is the gauge [m, rad], about the world's origin: a million metres from it
  /// the default leaves a metre.
  double first_sigma = 1e-6;
  double contradiction = 1 - 1e-6;  ///< a list less likely than this is that of no landmark; it is forgotten
  double much_vaguer =
      9;  ///< a keyframe learns from lists that may grow unless its variance is so much larger
};

/// A sighting that a landmark of the map follows from, with the keyframe that saw it (0 the first of all).
struct KeyframeSighting {
  std::size_t keyframe = 0;
  StereoSighting sighting;  ///< its sigma holds the robust weight it was used with
};

namespace detail {
struct KeyframeMapFile;
}

/// The map. Needs a rig with a baseline. Saved and loaded by keyframe_map_file.hpp.
class KeyframeMap {
public:
  explicit KeyframeMap(const StereoRig& rig, const KeyframeMapOptions& options = {})
      : options_(options),
        rig_(rig),
        correction_(rig),
        estimates_rig_(!options.rig.known()),
        gate_(chi_square_quantile(options.gate_probability, 4)),
        efficiency_(robust_efficiency(options.loss, options.loss_scale, options.gate_probability, gate_, 4)) {
    const char* const fault = fault_of(options, rig);
    CAIRN_EXPECTS(fault == nullptr, fault);
  }

  // What there is.

  [[nodiscard]] bool empty() const noexcept { return keyframes_.empty(); }
  [[nodiscard]] std::size_t keyframe_count() const noexcept {
    return static_cast<std::size_t>(poses_.size()) - (poses_.contains(rig_block_) ? 1 : 0);
  }
  /// Keyframes added so far, those that left included.
  [[nodiscard]] std::size_t keyframes_added() const noexcept { return keyframes_.size(); }
  [[nodiscard]] std::size_t landmark_count() const noexcept { return landmarks_.size(); }
  [[nodiscard]] bool contains(std::uint32_t landmark) const noexcept { return place_.contains(landmark); }
  /// Ascending.
  [[nodiscard]] std::vector<std::uint32_t> landmark_ids() const {
    std::vector<std::uint32_t> ids;
    ids.reserve(landmarks_.size());
    for (const detail::KeyframeLandmark& one : landmarks_) ids.push_back(one.id);
    std::ranges::sort(ids);
    return ids;
  }
  /// As it is believed to be, and as it was given.
  [[nodiscard]] const StereoRig& rig() const noexcept { return rig_; }
  [[nodiscard]] const StereoRig& nominal_rig() const noexcept { return correction_.nominal(); }
  [[nodiscard]] const KeyframeMapOptions& options() const noexcept { return options_; }
  /// Poses of the keyframes that are there, in the order in which they came.
  [[nodiscard]] std::vector<SE3> keyframe_poses() const {
    std::vector<SE3> poses;
    for (const Keyframe& keyframe : keyframes_)
      if (poses_.contains(keyframe.block)) poses.push_back(poses_.mean(keyframe.block).T_world_body);
    return poses;
  }
  /// The pose of the keyframe that was added as number `index`, 0 the first; nothing where it has left.
  [[nodiscard]] std::optional<SE3> keyframe_pose(std::size_t index) const {
    if (index >= keyframes_.size() || !poses_.contains(keyframes_[index].block)) return std::nullopt;
    return poses_.mean(keyframes_[index].block).T_world_body;
  }
  /// Their joint covariance, steps in the world.
  [[nodiscard]] Matrix<dynamic, dynamic> covariance() const {
    std::vector<AnyBlockId> ids;
    for (const Keyframe& keyframe : keyframes_)
      if (poses_.contains(keyframe.block)) ids.push_back(keyframe.block);
    return poses_.covariance(ids);
  }
  /// The rig's numbers, where they are estimated and the map has begun.
  [[nodiscard]] std::optional<Gaussian<RigState>> rig_correction() const {
    if (!poses_.contains(rig_block_)) return std::nullopt;
    return Gaussian<RigState>{poses_.mean(rig_block_), pose_factor_ * poses_.covariance(rig_block_)};
  }

  /// Position given the keyframes, with the covariance it had if those were known: what a pose is to be
  /// estimated from. Nothing for a landmark that is not there, or whose sightings contradict each other under
  /// the keyframes as they now stand (it is then forgotten), or is more than numbers hold, which a file's
  /// numbers can make it.
  [[nodiscard]] std::optional<Gaussian<Vector<3>>> landmark(std::uint32_t id) {
    const detail::KeyframeLandmark* const found = fresh(id);
    if (found == nullptr || !all_finite(found->x) || !all_finite(found->S)) return std::nullopt;
    return Gaussian<Vector<3>>{found->x, found->S};
  }
  /// The same with the uncertainty of the keyframes, and of the rig where it is estimated: how well the
  /// landmark is known in the world.
  [[nodiscard]] std::optional<Gaussian<Vector<3>>> landmark_in_world(std::uint32_t id) {
    const auto one = landmarks_in_world({&id, 1});
    if (!one) return std::nullopt;
    return Gaussian<Vector<3>>{one->mean, one->covariance};
  }
  /// Several together, three numbers each in the order of `ids`, with the errors that they share because the
  /// same keyframes saw them: what a test of the whole map needs. Nothing where one of them is not known.
  /// O((18 n + 36 k) k) for n landmarks that k keyframes saw.
  [[nodiscard]] std::optional<Gaussian<Vector<dynamic>>> landmarks_in_world(
      std::span<const std::uint32_t> ids) {
    for (const std::uint32_t id : ids)  // those that contradict themselves leave, and move others
      if (fresh(id) == nullptr) return std::nullopt;
    std::vector<AnyBlockId> blocks;
    std::unordered_map<std::uint32_t, Eigen::Index> column;  // of a keyframe
    for (const std::uint32_t id : ids) {
      const detail::KeyframeLandmark& one = landmarks_[place_.at(id)];
      for (std::size_t i = 0; i < one.count; ++i)
        if (column.try_emplace(one.sightings[i].keyframe, 6 * static_cast<Eigen::Index>(column.size()))
                .second)
          blocks.push_back(block_of(one, i));
    }
    const auto n = static_cast<Eigen::Index>(ids.size());
    const Eigen::Index of_keyframes = 6 * static_cast<Eigen::Index>(column.size());
    const Eigen::Index of_rig = with_rig() && n > 0 ? rig_numbers : 0;
    if (of_rig > 0) blocks.push_back(rig_block_);

    Gaussian<Vector<dynamic>> all{Vector<dynamic>(3 * n), {}};
    Matrix<dynamic, dynamic> J = Matrix<dynamic, dynamic>::Zero(3 * n, of_keyframes + of_rig);
    for (Eigen::Index place = 0; place < n; ++place) {
      const detail::KeyframeLandmark& one = landmarks_[place_.at(ids[static_cast<std::size_t>(place)])];
      all.mean.template segment<3>(3 * place) = one.x;
      Matrix<3, 6> G;  // a step of the world, at the landmark
      G << Matrix<3>::Identity(), -skew(one.x);
      for (std::size_t i = 0; i < one.count; ++i)
        J.template block<3, 6>(3 * place, column.at(one.sightings[i].keyframe)) += one.F[i] * G;
      if (of_rig > 0) J.block(3 * place, of_keyframes, 3, of_rig) = one.B;
    }
    const Matrix<dynamic, dynamic> half = J * poses_.covariance(blocks);
    Matrix<dynamic, dynamic> P = half * J.transpose();
    for (Eigen::Index a = 0; a < n; ++a)  // the noise of its own, which one that is named twice has but once
      for (Eigen::Index b = 0; b < n; ++b)
        if (const std::uint32_t id = ids[static_cast<std::size_t>(a)]; id == ids[static_cast<std::size_t>(b)])
          P.template block<3, 3>(3 * a, 3 * b) += landmarks_[place_.at(id)].S;
    all.covariance = pose_factor_ * symmetrised(P);
    if (!all_finite(all.mean) || !all_finite(all.covariance)) return std::nullopt;
    return all;
  }
  /// All that a landmark follows from, by keyframes: with keyframe_pose(), the data of the joint least
  /// squares problem whose solution the map approximates. Empty for a landmark that is not there.
  [[nodiscard]] std::vector<KeyframeSighting> sightings_of(std::uint32_t landmark) const {
    std::vector<KeyframeSighting> result;
    const auto found = place_.find(landmark);
    if (found == place_.end()) return result;
    const detail::KeyframeLandmark& one = landmarks_[found->second];
    for (std::size_t i = 0; i < one.count; ++i) {
      const detail::RecordedSighting& s = one.sightings[i];
      result.push_back({s.keyframe, {landmark, s.left, s.right, s.sigma}});
    }
    return result;
  }
  /// The landmarks that the keyframes of these landmarks saw: what should be in view as well. Ascending.
  [[nodiscard]] std::vector<std::uint32_t> seen_with(std::span<const std::uint32_t> ids) const {
    std::vector<std::uint8_t> wanted(keyframes_.size(), 0);
    for (const std::uint32_t id : ids)
      if (const auto found = place_.find(id); found != place_.end())
        for (std::size_t i = 0; i < landmarks_[found->second].count; ++i)
          wanted[landmarks_[found->second].sightings[i].keyframe] = 1;
    std::vector<std::uint32_t> result;
    for (std::size_t k = 0; k < keyframes_.size(); ++k)
      if (wanted[k] != 0)
        for (const std::uint32_t id : keyframes_[k].saw)
          if (contains(id)) result.push_back(id);
    std::ranges::sort(result);
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
  }

  // What changes it.

  /// The first keyframe, which says where the world is. Only for an empty map.
  void begin(const SE3& T_world_camera) {
    CAIRN_EXPECTS(empty(), "KeyframeMap::begin: the map has begun already");
    if (!all_finite(T_world_camera.matrix())) raise("KeyframeMap::begin: expected a finite pose");
    const Matrix<6> P = Matrix<6>::Identity() * (options_.first_sigma * options_.first_sigma);
    const auto added = poses_.add(WorldPose{T_world_camera}, P);
    CAIRN_ASSERT(added.accepted(), "a finite pose with a diagonal covariance is a belief");
    if (with_rig()) rig_block_ = poses_.add(RigState(RigState::Zero()), options_.rig.covariance()).id;
    enlist(added.id);
  }

  /// By how much variances are larger than the sigmas say: those of single pixels, which gates count with,
  /// and those of poses, which are larger still where pixels err together. No estimate moves by it but for
  /// what passes the gates.
  void set_variance_factors(double pixels, double poses) {
    CAIRN_EXPECTS(pixels > 0 && std::isfinite(pixels) && poses > 0 && std::isfinite(poses),
                  "KeyframeMap: a variance factor is positive");
    pixel_factor_ = pixels;
    pose_factor_ = poses;
  }
  [[nodiscard]] double pixel_factor() const noexcept { return pixel_factor_; }
  [[nodiscard]] double pose_factor() const noexcept { return pose_factor_; }

  /// Another calibration, from outside: landmarks will be where their lists say under it, all that was seen
  /// so far included. Of a rig that came loose on the way the pixels are to be put back instead, or what was
  /// seen before is wrong. Not where the map estimates the rig itself. O(landmarks).
  void set_rig(const StereoRig& rig) {
    CAIRN_EXPECTS(!with_rig(), "KeyframeMap::set_rig: this map estimates its rig");
    CAIRN_EXPECTS(rig.baseline() > 0, "KeyframeMap: the rig needs a baseline");
    rig_ = rig;
    correction_ = RigCorrection(rig);
    std::vector<std::uint32_t> gone;
    for (detail::KeyframeLandmark& one : landmarks_)
      if (!one.whiten(rig)) gone.push_back(one.id);
    for (const std::uint32_t id : gone) drop(id);
    change();
  }

  /// A landmark that is new to the map, seen from the newest keyframe. False where its pixels make no point,
  /// or it is there already.
  bool add_landmark(const StereoSighting& s) {
    CAIRN_EXPECTS(!empty(), "KeyframeMap::add_landmark: a map begins with begin()");
    check(s);
    if (contains(s.landmark)) return false;
    const Triangulation point = Triangulator(rig_)(s.left, s.right, s.sigma, s.sigma);
    const auto whitened = detail::WhitenedSighting::of(rig_, s.left, s.right, s.sigma);
    if (!point.good() || !whitened) return false;
    const auto newest = static_cast<std::uint32_t>(keyframes_.size() - 1);
    detail::KeyframeLandmark one;
    one.id = s.landmark;
    one.x = pose_of(newest) * point.point;
    one.sightings[0] = {newest, s.sigma, s.left, s.right, *whitened};
    one.count = one.of_visit = 1;
    one.last_seen = frame_;
    if (!solve(one)) return false;
    one.epoch = epoch_;
    ++keyframes_[newest].sightings;
    keyframes_[newest].saw.push_back(s.landmark);
    place_[s.landmark] = landmarks_.size();
    landmarks_.push_back(one);
    return true;
  }

  /// Takes a landmark out. What the keyframes learned by it stays. False where there is none.
  bool forget(std::uint32_t landmark) {
    const auto found = place_.find(landmark);
    if (found == place_.end()) return false;
    const std::size_t place = found->second;
    for (std::size_t i = 0; i < landmarks_[place].count; ++i) {
      Keyframe& keyframe = keyframes_[landmarks_[place].sightings[i].keyframe];
      --keyframe.sightings;
      std::erase(keyframe.saw, landmark);  // its number may become another's
    }
    place_.erase(found);
    if (place + 1 != landmarks_.size()) {
      landmarks_[place] = landmarks_.back();
      place_[landmarks_[place].id] = place;
    }
    landmarks_.pop_back();
    return true;
  }

  /// Numbers the landmarks 0, 1, 2, ... in the ascending order of their ids, as a file does. Those that
  /// take_dropped() would return are forgotten with their numbers. O(landmarks log landmarks).
  void renumber() {
    std::ranges::sort(landmarks_, {}, &detail::KeyframeLandmark::id);
    std::unordered_map<std::uint32_t, std::uint32_t> number;
    for (detail::KeyframeLandmark& one : landmarks_) {
      const auto next = static_cast<std::uint32_t>(number.size());
      number[one.id] = next;
      one.id = next;
    }
    place_.clear();
    for (std::size_t i = 0; i < landmarks_.size(); ++i) place_[landmarks_[i].id] = i;
    for (Keyframe& keyframe : keyframes_) {
      std::erase_if(keyframe.saw, [&](std::uint32_t id) { return !number.contains(id); });
      for (std::uint32_t& id : keyframe.saw) id = number[id];
    }
    dropped_.clear();
  }

  /// The landmarks that the map itself took out since this was last asked: contradicted, spent, or without a
  /// keyframe.
  [[nodiscard]] std::vector<std::uint32_t> take_dropped() { return std::exchange(dropped_, {}); }

  /// Where the camera is, from matches of which some may be wrong, near `start`, which most of the good ones
  /// agree with to within their noise. Uses the keyframes' joint covariance as a prior, so that where old and
  /// drifted landmarks are in view together the old ones decide; changes nothing in the map but when
  /// landmarks were last seen. Of several matches of one landmark the first counts, and the others do not
  /// agree. O(matches m^2 + (6 s)^3) for m sightings a landmark and s keyframes in play. Throws Error for
  /// numbers that are not finite.
  [[nodiscard]] MapLocation locate(const SE3& start, std::span<const StereoSighting> matches) {
    if (!all_finite(start.matrix())) raise("KeyframeMap::locate: expected a finite pose to start from");
    ++frame_;
    MapLocation result;
    result.T_world_camera = start;
    result.inliers.assign(matches.size(), 0);
    result.chi_squared.assign(matches.size(), std::numeric_limits<double>::infinity());
    Work work;
    collect(matches, work);
    constexpr int most_rounds = 5;
    bool settled = false;
    for (int round = 0; round < most_rounds && !settled; ++round) {
      judge(result.T_world_camera, work);
      if (linearise(work) < options_.min_matches)
        return refused(std::move(result), MapLocationStatus::too_few_matches);
      if (!equations_.solve(work.prior, result.T_world_camera.translation(), work.solution))
        return refused(std::move(result), MapLocationStatus::degenerate);
      const Vector<6> d = work.solution.step.tail<6>();
      result.T_world_camera = SE3::exp(d) * result.T_world_camera;
      const Matrix<6> P = work.solution.covariance.bottomRightCorner<6, 6>();
      const Cholesky<6> factor(P);
      settled = round > 0 && factor.good() && factor.whiten(d).squaredNorm() < 1e-3;
      work.has_solution = true;
      result.covariance = pose_factor_ * seen_from_body(P, result.T_world_camera);
    }
    report(work, result);
    return result;
  }

  /// Makes the frame of `here` a keyframe. It learns from those agreeing matches whose lists may still grow,
  /// or, where they do not determine it, from all, and the map loses the landmarks whose lists were full.
  /// `matches` are those that located it. False where nothing determines it: the map is then as before.
  bool add_keyframe(const MapLocation& here, std::span<const StereoSighting> matches) {
    CAIRN_EXPECTS(
        here.good() && here.inliers.size() == matches.size() && here.chi_squared.size() == matches.size(),
        "KeyframeMap::add_keyframe: the matches are those of a location that is good");
    std::vector<std::uint8_t> grows(matches.size(), 0), all = here.inliers;
    for (std::size_t i = 0; i < matches.size(); ++i)
      if (here.inliers[i] != 0)
        if (const auto found = place_.find(matches[i].landmark); found != place_.end())
          grows[i] = may_grow(landmarks_[found->second]) ? 1 : 0;
    Work work;
    if (!learn(here, matches, grows, work) && !learn(here, matches, all, work)) return false;
    if (!commit(here, work)) return false;
    record(work);
    make_room();
    return true;
  }

private:
  friend struct detail::KeyframeMapFile;

  struct Keyframe {
    BlockId<WorldPose> block;
    std::size_t sightings = 0;       // in lists
    std::vector<std::uint32_t> saw;  // landmarks
    std::optional<detail::RigView> view;
    std::uint64_t epoch = 0;
  };
  using Entry = detail::FrameEntry;
  using Work = detail::FrameWork;

  /// What a map cannot be made with, as a sentence, or null.
  [[nodiscard]] static const char* fault_of(const KeyframeMapOptions& options,
                                            const StereoRig& rig) noexcept {
    if (!(rig.baseline() > 0)) return "KeyframeMap: the rig needs a baseline";
    if (options.sightings < 1 || options.sightings > static_cast<int>(detail::most_sightings) ||
        options.sightings_a_visit < 1)
      return "KeyframeMap: a list has one to six sightings, and one a visit at least";
    if (options.max_keyframes < 4) return "KeyframeMap: expected room for four keyframes";
    constexpr double most_sigma = 1e9, least_sigma = 1e-150;  // their squares are numbers
    if (!(options.rig.each().minCoeff() >= 0) || !(options.rig.each().maxCoeff() <= most_sigma))
      return "KeyframeMap: a rig's sigmas are not negative, and within 1e9";
    if (!(options.loss_scale > 0) || options.min_matches < 3)
      return "KeyframeMap: the loss has a scale, and a pose needs three matches";
    if (!(options.first_sigma >= least_sigma && options.first_sigma <= most_sigma))
      return "KeyframeMap: the first keyframe's sigma is positive, and within 1e9";
    const auto is_share = [](double p) { return p > 0 && p < 1; };
    if (!is_share(options.gate_probability) || !is_share(options.contradiction))
      return "KeyframeMap: probabilities lie between 0 and 1";
    return nullptr;
  }

  static void check(const StereoSighting& s) {
    if (all_finite(s.left) && all_finite(s.right) && s.sigma > 0 && std::isfinite(s.sigma)) return;
    raise("KeyframeMap: expected finite pixels and a positive finite sigma, landmark " +
          std::to_string(s.landmark) + " has others");
  }

  [[nodiscard]] const SE3& pose_of(std::uint32_t keyframe) const {
    return poses_.mean(keyframes_[keyframe].block).T_world_body;
  }
  [[nodiscard]] BlockId<WorldPose> block_of(const detail::KeyframeLandmark& one, std::size_t i) const {
    return keyframes_[one.sightings[i].keyframe].block;
  }
  /// Whether the rig is estimated.
  [[nodiscard]] bool with_rig() const { return estimates_rig_; }
  void change() { ++epoch_; }
  void enlist(BlockId<WorldPose> block) {
    keyframes_.push_back({block, 0, {}, std::nullopt, 0});
    change();
  }

  /// The rig where a keyframe stands, made once a change.
  [[nodiscard]] const detail::RigView& view_of(std::uint32_t keyframe) {
    Keyframe& k = keyframes_[keyframe];
    if (!k.view || k.epoch != epoch_) {
      k.view.emplace(view_from(pose_of(keyframe)));
      k.epoch = epoch_;
    }
    return *k.view;
  }
  [[nodiscard]] bool solve(detail::KeyframeLandmark& one) {
    return one.solve([this](std::uint32_t keyframe) -> const detail::RigView& { return view_of(keyframe); },
                     with_rig());
  }
  [[nodiscard]] detail::RigView view_from(const SE3& T_world_camera) const {
    detail::RigView view(T_world_camera, rig_);
    if (with_rig()) view.derive(correction_);
    return view;
  }

  /// The landmark where the keyframes now put it, or null.
  [[nodiscard]] detail::KeyframeLandmark* fresh(std::uint32_t id) {
    const auto found = place_.find(id);
    if (found == place_.end()) return nullptr;
    detail::KeyframeLandmark& one = landmarks_[found->second];
    if (one.epoch == epoch_) return &one;
    one.epoch = epoch_;
    const bool seen = !with_rig() || one.whiten(rig_);
    if (seen && solve(one) && one.chi_squared <= pixel_factor_ * contradiction(one.count)) return &one;
    drop(id);
    return nullptr;
  }
  void drop(std::uint32_t id) {
    forget(id);
    dropped_.push_back(id);
  }
  [[nodiscard]] double contradiction(std::size_t count) {
    if (contradiction_.empty())
      for (std::size_t n = 0; n <= detail::most_sightings; ++n)
        contradiction_.push_back(
            chi_square_quantile(options_.contradiction, n == 0 ? 1.0 : 4.0 * static_cast<double>(n) - 3.0));
    return contradiction_[count];
  }

  [[nodiscard]] bool may_grow(const detail::KeyframeLandmark& one) const noexcept {
    return !one.barred && one.count < static_cast<std::size_t>(options_.sightings) &&
           one.of_visit < static_cast<std::size_t>(options_.sightings_a_visit);
  }

  /// The matches whose landmarks are there, and the keyframes those rest on, with their prior.
  void collect(std::span<const StereoSighting> matches, Work& work,
               std::span<const std::uint8_t> chosen = {}) {
    work = {};
    work.matches = matches;
    for (const StereoSighting& s : matches) {  // first all: a landmark that is dropped moves others
      check(s);
      static_cast<void>(fresh(s.landmark));
    }
    constexpr auto nowhere = static_cast<std::uint32_t>(-1);
    std::vector<std::uint32_t> place(keyframes_.size(), nowhere);
    std::vector<std::uint8_t> taken(landmarks_.size(), 0);
    work.entries.reserve(matches.size());
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (!chosen.empty() && chosen[i] == 0) continue;
      const auto found = place_.find(matches[i].landmark);
      if (found == place_.end() || taken[found->second] != 0) continue;
      const auto seen =
          detail::WhitenedSighting::of(rig_, matches[i].left, matches[i].right, matches[i].sigma);
      if (!seen) continue;
      taken[found->second] = 1;
      Entry& entry = work.entries.emplace_back();
      entry.match = i;
      entry.landmark = found->second;
      entry.seen = *seen;
      const detail::KeyframeLandmark& one = landmarks_[found->second];
      entry.geometry = one;
      for (std::size_t k = 0; k < one.count; ++k) {
        std::uint32_t& at = place[one.sightings[k].keyframe];
        if (at == nowhere) {
          at = static_cast<std::uint32_t>(work.keyframes.size());
          work.keyframes.push_back(one.sightings[k].keyframe);
          work.blocks.push_back(keyframes_[one.sightings[k].keyframe].block);
        }
        entry.place[k] = at;
      }
    }
    if (poses_.contains(rig_block_)) work.blocks.push_back(rig_block_);
    work.prior = poses_.covariance(work.blocks);
  }

  /// What each match says at a pose, and how likely that is: the first time under the keyframes as they are,
  /// then under their solution and with what that leaves uncertain. The first time also chooses where each
  /// landmark is linearised: where its list and this sighting together put it. At the list's own place, one
  /// that noise makes too near would weigh more than one it makes too far, and all motions would come out
  /// short.
  void judge(const SE3& T, Work& work) {
    const detail::RigView view = view_from(T);
    const bool first = !work.has_solution;  // asks for nothing of the rig before the landmark has moved
    for (Entry& entry : work.entries) {
      const bool seen = look(view, entry, !first && with_rig());
      entry.chi_squared =
          seen ? chi_squared(entry, work) / pixel_factor_ : std::numeric_limits<double>::infinity();
      if (!first) continue;
      if (entry.chi_squared < gate_)
        move_to_posterior(view, entry);
      else if (with_rig())
        static_cast<void>(look(view, entry, true));
    }
  }

  /// The statistics of a match, and where asked those of the rig, brought to where the list puts the
  /// landmark. False where the view cannot see it.
  [[nodiscard]] bool look(const detail::RigView& view, Entry& entry, bool of_rig) const {
    detail::PointStatistics& s = entry.statistics;
    s = {};
    const Vector<3>& x = entry.geometry.x;
    const Vector<3>& d = entry.from_list;
    if (of_rig) {
      entry.rig = {};
      if (!entry.seen.add(view, x, s, entry.rig)) return false;
      entry.rig.u -= transposed_product(entry.rig.E, d);
    } else if (!entry.seen.add(view, x, s)) {
      return false;
    }
    const Vector<3> Ad = product(s.A, d);
    s.squares += d.dot(Ad) - 2 * s.b.dot(d);
    s.b -= Ad;
    return true;
  }

  void move_to_posterior(const detail::RigView& view, Entry& entry) {
    const detail::KeyframeLandmark& one = landmarks_[entry.landmark];
    const Vector<3> at = one.x + product(one.S, detail::WeighedSighting(entry.statistics, one.S).g);
    const auto keyframes = [this](std::uint32_t k) -> const detail::RigView& { return view_of(k); };
    const auto from_list = one.linearise(keyframes, at, with_rig(), entry.geometry);
    if (from_list) entry.from_list = *from_list;
    if (from_list && look(view, entry, with_rig())) return;
    entry.geometry = one;
    entry.from_list.setZero();
    static_cast<void>(look(view, entry, with_rig()));
  }

  [[nodiscard]] double chi_squared(Entry& entry, const Work& work) const {
    const detail::PointStatistics& s = entry.statistics;
    const detail::LandmarkGeometry& one = entry.geometry;
    entry.at_solution = s;
    if (!work.has_solution) return detail::WeighedSighting(s, one.S).chi_squared;
    Vector<3> moved = Vector<3>::Zero();
    for (std::size_t i = 0; i < one.count; ++i)
      moved += product(one.F[i], moved_with_world(one.x, work.solution.step.data() + 6 * entry.place[i]));
    if (with_rig()) return chi_squared_with_rig(entry, work, moved);
    const Vector<3> Am = product(s.A, moved);
    entry.at_solution = {s.A, s.b - Am, s.squares - 2 * s.b.dot(moved) + moved.dot(Am)};
    const Matrix<3> uncertain =
        detail::displacement_covariance(one, entry.places(), work.solution.covariance);
    return detail::WeighedSighting(entry.at_solution, one.S + (pose_factor_ / pixel_factor_) * uncertain)
        .chi_squared;
  }

  [[nodiscard]] double chi_squared_with_rig(Entry& entry, const Work& work, Vector<3> moved) const {
    const detail::PointStatistics& s = entry.statistics;
    const detail::LandmarkGeometry& one = entry.geometry;
    const detail::RigStatistics& rig = entry.rig;
    const RigState c = work.solution.step.segment<rig_numbers>(work.solution.step.size() - 6 - rig_numbers);
    moved += product(one.B, c);
    const Vector<3> Am = product(s.A, moved), Ec = product(rig.E, c);
    const RigState Dc = product(rig.D, c);
    entry.at_solution = {
        s.A, s.b - Am - Ec,
        s.squares - 2 * (s.b.dot(moved) + rig.u.dot(c)) + moved.dot(Am) + 2 * moved.dot(Ec) + c.dot(Dc)};
    const Matrix<3> uncertain =
        detail::displacement_covariance(one, entry.places(), work.solution.covariance);
    return detail::WeighedSighting(entry.at_solution, one.S + (pose_factor_ / pixel_factor_) * uncertain)
        .chi_squared;
  }

  /// The equations of the matches within the gate, weighted so that together they are worth what the loss and
  /// the gate leave of them. Returns how many those are.
  std::size_t linearise(Work& work) {
    const bool with_rig = this->with_rig();
    equations_.open(work.keyframes.size(), with_rig);
    double weights = 0;
    std::size_t agree = 0;
    for (Entry& entry : work.entries) {
      entry.weight = 0;
      if (!(entry.chi_squared < gate_)) continue;
      const detail::LandmarkGeometry& one = entry.geometry;
      entry.weight = robust_weight(options_.loss, options_.loss_scale, entry.chi_squared);
      const detail::WeighedSighting weighed(entry.statistics, one.S);
      equations_.add(one, entry.places(), weighed.N, weighed.g, entry.weight);
      if (with_rig) equations_.add_rig(one, entry.places(), weighed, entry.rig, entry.weight);
      weights += entry.weight;
      ++agree;
    }
    if (agree == 0) return 0;
    const double worth = efficiency_ * static_cast<double>(agree) / weights;
    equations_.scale(worth);
    for (Entry& entry : work.entries) entry.weight *= worth;
    return agree;
  }

  [[nodiscard]] static MapLocation refused(MapLocation result, MapLocationStatus status) {
    result.status = status;
    result.covariance = Matrix<6>::Zero();
    return result;
  }

  void report(const Work& work, MapLocation& result) {
    result.status = MapLocationStatus::good;
    std::vector<double> sizes, changes;
    for (const Entry& entry : work.entries) {
      result.chi_squared[entry.match] = entry.chi_squared * pixel_factor_;
      if (!(entry.weight > 0)) continue;
      result.inliers[entry.match] = 1;
      sizes.push_back(result.chi_squared[entry.match]);
      detail::KeyframeLandmark& one = landmarks_[entry.landmark];
      const Vector<3> from = pose_of(one.sightings[one.count - 1].keyframe).translation();
      changes.push_back((result.T_world_camera.translation() - from).norm() / (one.x - from).norm());
      if (frame_ - one.last_seen > static_cast<std::uint64_t>(options_.visit_gap)) one.of_visit = 0;
      one.last_seen = frame_;
    }
    result.score_variance = detail::score_variance(work, equations_.camera(), rig_.left);
    result.inlier_count = sizes.size();
    result.median_chi_squared = median(std::move(sizes));
    result.viewpoint_change = median(std::move(changes));
  }

  /// The joint posterior of a new keyframe and of those in play by the chosen matches; false where these do
  /// not determine it about as well as all did.
  bool learn(const MapLocation& here, std::span<const StereoSighting> matches,
             std::span<const std::uint8_t> chosen, Work& work) {
    collect(matches, work, chosen);
    judge(here.T_world_camera, work);
    for (Entry& entry : work.entries)  // judged by all that located it
      if (std::isfinite(entry.chi_squared)) entry.chi_squared = here.chi_squared[entry.match] / pixel_factor_;
    if (linearise(work) < options_.min_matches ||
        !equations_.solve(work.prior, here.T_world_camera.translation(), work.solution))
      return false;
    const Matrix<6> P = pose_factor_ * seen_from_body(work.solution.covariance.bottomRightCorner<6, 6>(),
                                                      here.T_world_camera);
    for (int i = 0; i < 6; ++i)
      if (!(P(i, i) <= options_.much_vaguer * here.covariance(i, i))) return false;
    return true;
  }

  bool commit(const MapLocation& here, const Work& work) {
    const Eigen::Index n = work.prior.rows();
    const Vector<6> own = work.solution.step.tail<6>();
    const auto added =
        poses_.commit(work.blocks, Vector<dynamic>(work.solution.step.head(n)), work.solution.covariance,
                      WorldPose{SE3::exp(own) * here.T_world_camera});
    if (!added.accepted()) return false;
    if (poses_.contains(rig_block_)) rig_ = correction_.rig(poses_.mean(rig_block_));
    enlist(added.id);
    return true;
  }

  /// Writes what the newest keyframe learned from into the lists; a landmark whose list is full is spent.
  void record(const Work& work) {
    const auto newest = static_cast<std::uint32_t>(keyframes_.size() - 1);
    std::vector<std::uint32_t> spent;
    for (const Entry& entry : work.entries) {
      if (!(entry.weight > 0)) continue;
      detail::KeyframeLandmark& one = landmarks_[entry.landmark];
      if (one.barred || one.count == static_cast<std::size_t>(options_.sightings)) {
        spent.push_back(one.id);
        continue;
      }
      const StereoSighting& s = work.matches[entry.match];
      const double sigma = s.sigma / std::sqrt(entry.weight);
      const auto whitened = detail::WhitenedSighting::of(rig_, s.left, s.right, sigma);
      if (!whitened) {  // pixels of no ray of the rig that was learned: P knows of them, the list cannot
        spent.push_back(one.id);
        continue;
      }
      one.sightings[one.count++] = {newest, sigma, s.left, s.right, *whitened};
      ++one.of_visit;
      ++keyframes_[newest].sightings;
      keyframes_[newest].saw.push_back(one.id);
    }
    for (const std::uint32_t id : spent) drop(id);
  }

  /// Keyframes without a landmark leave, and over the cap the one of the newer half that fewest rest on.
  void make_room() {
    std::vector<std::uint32_t> there;
    for (std::uint32_t k = 0; k + 1 < keyframes_.size(); ++k) {
      if (!poses_.contains(keyframes_[k].block)) continue;
      if (keyframes_[k].sightings == 0)
        leave(keyframes_[k]);
      else
        there.push_back(k);
    }
    if (there.size() < options_.max_keyframes) return;
    const auto newer = there.begin() + static_cast<std::ptrdiff_t>(there.size() / 2);
    strike(*std::min_element(newer, there.end() - 1, [&](std::uint32_t a, std::uint32_t b) {
      return keyframes_[a].sightings < keyframes_[b].sightings;
    }));
  }

  /// A keyframe leaves, and its entries in all lists. What it learned lives on in P while these landmarks
  /// forget it: they may not teach another keyframe the same again.
  void strike(std::uint32_t keyframe) {
    std::vector<std::uint32_t> empty;
    for (detail::KeyframeLandmark& one : landmarks_)
      for (std::size_t i = 0; i < one.count; ++i) {
        if (one.sightings[i].keyframe != keyframe) continue;
        one.strike(i);
        one.barred = true;
        if (one.count == 0) empty.push_back(one.id);
        break;
      }
    keyframes_[keyframe].sightings = 0;
    for (const std::uint32_t id : empty) drop(id);
    leave(keyframes_[keyframe]);
    change();
  }

  /// Nothing of it stays but its number, so that a map that lives for days does not grow.
  void leave(Keyframe& keyframe) {
    static_cast<void>(poses_.marginalise(keyframe.block));
    keyframe.saw = {};
    keyframe.view.reset();
  }

  KeyframeMapOptions options_;
  StereoRig rig_;  // as it is believed to be
  RigCorrection correction_;
  bool estimates_rig_ = false;
  double gate_, efficiency_;
  JointGaussian<WorldPose, RigState> poses_;
  BlockId<RigState> rig_block_;      // where the rig is estimated
  std::vector<Keyframe> keyframes_;  // all that ever were
  std::vector<detail::KeyframeLandmark> landmarks_;
  std::unordered_map<std::uint32_t, std::size_t> place_;
  std::vector<std::uint32_t> dropped_;
  std::vector<double> contradiction_;
  detail::KeyframeEquations equations_;
  double pixel_factor_ = 1, pose_factor_ = 1;
  std::uint64_t epoch_ = 1, frame_ = 0;
};

}}  // namespace cairn::CAIRN_ABI
