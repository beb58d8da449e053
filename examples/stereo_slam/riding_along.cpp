// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "riding_along.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

#include <cairn/core/statistics.hpp>

namespace stereo_slam {
namespace {

using Pixels = std::vector<cairn::Vector<2>>;
constexpr int doubtful_frames = 8;  // after the last frame that was in doubt

using Indices = std::vector<std::size_t>;

/// How far a point may wander that stands still: what shakes by half a pixel, and the noise of its keypoint.
double stillness(const cairn::StereoMatch& match) {
  return 1 + 3 * match.sigma_left;
}

/// Whether both images show a match's landmark where they showed it first.
bool stands_still(const MatchesOfFrame& seen, std::size_t i) {
  return (seen.apparent[i].now - seen.apparent[i].first).cwiseAbs().maxCoeff() < stillness(seen.matches[i]);
}

/// Matches that stand still though the camera, were it there, would see them elsewhere than at first, by more
/// than twice what stillness allows.
Indices still_against(const cairn::SE3& T_world_camera, const cairn::PinholeCamera& left,
                      const MatchesOfFrame& seen) {
  Indices result;
  const cairn::SE3 T_camera_world = T_world_camera.inverse();
  for (std::size_t i = 0; i < seen.matches.size(); ++i) {
    if (!stands_still(seen, i)) continue;
    const auto due = left.project(T_camera_world * seen.matches[i].landmark);
    if (!due || (*due - seen.apparent[i].first.head<2>()).norm() > 2 * stillness(seen.matches[i]))
      result.push_back(i);
  }
  return result;
}

/// How far those of them reach that count.
template <class Counts>
double reach_of(const Indices& some, const MatchesOfFrame& seen, const Counts& counts) {
  Pixels pixels;
  for (const std::size_t i : some)
    if (counts(i)) pixels.push_back(seen.matches[i].left);
  return pixels.empty() ? 0 : reach(pixels);
}

/// What a reach counts beside another's: more, where the one's points are farther, since what is nearer
/// covers the rest. By disparities, which in rigs whose cameras look one way fall with the depth.
double weight_of(const Indices& some, const Indices& others, const MatchesOfFrame& seen) {
  constexpr double most = 4;  // a vehicle far ahead is a part of no world
  const auto nearness = [&](const Indices& of) {
    std::vector<double> disparities;
    for (const std::size_t i : of)
      disparities.push_back((seen.matches[i].left - seen.matches[i].right).norm());
    return disparities.empty() ? 0 : cairn::median(std::move(disparities));
  };
  const double one = nearness(some), other = nearness(others);
  return one > 0 && other > 0 ? std::clamp(other / one, 1 / most, most) : 1;
}

/// The motion of some of the matches, where enough agree on one; its inliers are of all matches.
std::optional<cairn::StereoPose> motion_of(const Indices& some, const MatchesOfFrame& seen,
                                           const RidingAlong::Estimate& estimate, std::size_t enough) {
  std::vector<cairn::StereoMatch> part;
  for (const std::size_t i : some) part.push_back(seen.matches[i]);
  cairn::StereoPose result = estimate(part);
  if (!result.good() || result.inlier_count < enough) return std::nullopt;
  std::vector<std::uint8_t> inliers(seen.matches.size(), 0);
  for (std::size_t k = 0; k < some.size(); ++k) inliers[some[k]] = result.inliers[k];
  result.inliers = std::move(inliers);
  return result;
}

}  // namespace

RidingAlong::RidingAlong(cairn::ImageView left, cairn::ImageView right, const RidingAlongOptions& options)
    : options_(options),
      cells_{RidingCells(left.width(), left.height()), RidingCells(right.width(), right.height())} {}

void RidingAlong::watch(const cairn::Features& left, const cairn::Features& right) {
  cells_[0].watch(left);
  cells_[1].watch(right);
}

bool RidingAlong::hides(const cairn::Vector<2>& left, const cairn::Vector<2>& right) const noexcept {
  return cells_[0].hidden().hides(left(0), left(1)) || cells_[1].hidden().hides(right(0), right(1));
}

RidingAlong::Decision RidingAlong::decide(cairn::StereoPose pose, const cairn::PinholeCamera& left,
                                          const MatchesOfFrame& seen, const Estimate& estimate) {
  Decision decision = weigh(std::move(pose), left, seen, estimate);
  if (decision.riding.size() < options_.fewest)
    decision.riding.clear();
  else
    judge(decision, seen);
  return decision;
}

/// The other motion, where it reaches farther over the image: that of those that moved, where most that agree
/// on `pose`, or all that could, stand still; otherwise that of those that stand still, where it reaches
/// twice as far and nothing is known to ride along, or half as far where that was the rig's motion against
/// others before.
RidingAlong::Decision RidingAlong::weigh(cairn::StereoPose pose, const cairn::PinholeCamera& left,
                                         const MatchesOfFrame& seen, const Estimate& estimate) {
  Indices still, moved;
  std::size_t still_agree = 0, moved_agree = 0;
  const auto agrees = [&](std::size_t i) { return pose.good() && pose.inliers[i] != 0; };
  const auto all = [](std::size_t) { return true; };
  const auto trusted = [&](std::size_t i) { return !cells_[0].suspects(seen.matches[i].left); };
  for (std::size_t i = 0; i < seen.matches.size(); ++i) {
    const bool stands = stands_still(seen, i);
    (stands ? still : moved).push_back(i);
    (stands ? still_agree : moved_agree) += agrees(i) ? 1 : 0;
  }
  const bool stood = !pose.good() || still_agree > moved_agree;
  const bool stood_before = std::exchange(stands_against_others_, false);
  doubtful_ = std::max(0, doubtful_ - 1);
  if (stood && moved.size() - moved_agree >= options_.fewest && still.size() >= options_.fewest) {
    if (auto other = motion_of(moved, seen, estimate, options_.fewest)) {
      Indices against = still_against(other->T_world_camera, left, seen);
      std::erase_if(moved, [&](std::size_t i) { return other->inliers[i] == 0; });
      const double farther = weight_of(moved, against, seen) * reach_of(moved, seen, all);
      const double reached = reach_of(against, seen, trusted);
      if (moved.size() >= options_.fewest_sure && farther >= reached)
        return {std::move(*other), std::move(against)};
      if (against.size() >= options_.fewest) doubtful_ = doubtful_frames;
      stands_against_others_ = reached >= 2 * farther;
    }
  }
  if (!pose.good()) return {std::move(pose), {}};
  Indices against = still_against(pose.T_world_camera, left, seen);
  if (!stood && against.size() >= options_.fewest && cells_[0].hidden().count() == 0) {
    const double farther = weight_of(against, moved, seen) * reach_of(against, seen, trusted);
    const double reached = reach_of(moved, seen, agrees);
    if (against.size() >= options_.fewest_sure && farther >= (stood_before ? 0.5 : 2) * reached)
      if (auto other = motion_of(against, seen, estimate, options_.fewest_sure)) {
        stands_against_others_ = true;
        against = still_against(other->T_world_camera, left, seen);
        return {std::move(*other), std::move(against)};
      }
    if (farther >= reached) doubtful_ = doubtful_frames;
  }
  return {std::move(pose), std::move(against)};
}

void RidingAlong::judge(const Decision& decision, const MatchesOfFrame& seen) {
  std::array<Pixels, 2> still, moved;
  const auto add = [&](std::array<Pixels, 2>& to, std::size_t i) {
    to[0].push_back(seen.apparent[i].now.head<2>());
    to[1].push_back(seen.apparent[i].now.tail<2>());
  };
  for (const std::size_t i : decision.riding) add(still, i);
  for (std::size_t i = 0; i < seen.matches.size(); ++i)
    if (decision.pose.inliers[i] != 0 && !stands_still(seen, i)) add(moved, i);
  for (const std::size_t side : {std::size_t{0}, std::size_t{1}})
    cells_[side].judge(still[side], moved[side]);
}

std::optional<std::string> RidingAlong::close_frame(std::size_t index) {
  const HiddenCells &left = cells_[0].hidden(), &right = cells_[1].hidden();
  const std::size_t count = left.count() + right.count();
  if (count == 0 && doubtful_ == 0) {
    left_alone_.reset();
  } else if (count == 0) {
    if (!left_alone_ || !left_alone_->evenly)
      left_alone_ = std::make_shared<const HiddenParts>(HiddenParts{{left, right}, true});
  } else {
    const auto unlike = [&](const HiddenParts& other) {
      return left.unlike(other.cells[0]) + right.unlike(other.cells[1]);
    };
    if (!left_alone_ ||
        8 * unlike(*left_alone_) > left_alone_->cells[0].count() + left_alone_->cells[1].count())
      left_alone_ = std::make_shared<const HiddenParts>(HiddenParts{{left, right}, false});
  }
  record_.share = cells_[0].share();
  record_.largest_share = std::max(record_.largest_share, record_.share);
  if (record_.since || !(record_.share > 0)) return std::nullopt;
  record_.since = index;
  return "from frame " + std::to_string(index) +
         " on a part of the image is left out: what is seen there stands still while the "
         "camera moves, as its own vehicle or mount, dirt on the lenses, or what drives ahead";
}

double reach(std::span<const cairn::Vector<2>> pixels) {
  double result = 1;
  for (const int axis : {0, 1}) {
    std::vector<double> values;
    for (const cairn::Vector<2>& pixel : pixels) values.push_back(pixel(axis));
    result *= cairn::quantile(values, 0.95) - cairn::quantile(values, 0.05);
  }
  return result;
}

}  // namespace stereo_slam
