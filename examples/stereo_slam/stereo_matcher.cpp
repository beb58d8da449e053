// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "stereo_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <utility>

#include <cairn/core/check.hpp>
#include <cairn/core/parallel.hpp>

#include "descriptor_distance.hpp"
#include "patch_alignment.hpp"

namespace stereo_slam {

/// A point after the rotation; those that see nothing in front of the cameras are left out.
struct StereoMatcher::RowPoint {
  float row;
  float column;
  float scale;
  std::int8_t sign;
  std::uint32_t index;
};

namespace {

constexpr float unmatched = std::numeric_limits<float>::max();
constexpr std::uint32_t nobody = std::numeric_limits<std::uint32_t>::max();

}  // namespace

struct StereoMatcher::Best {
  float distance = unmatched;
  std::uint32_t index = nobody;

  /// Ties go to the smaller index so that the answer does not depend on the order of work.
  void offer(float candidate, std::uint32_t candidate_index) {
    if (candidate < distance || (candidate == distance && candidate_index < index))
      *this = {candidate, candidate_index};
  }
};

/// Who is nearest to whom by descriptor, among those that may match; distances are squared.
struct StereoMatcher::Nearest {
  std::vector<Best> of_left;
  std::vector<float> second_of_left;
  std::vector<Best> of_right;
};

StereoMatcher::StereoMatcher(const cairn::StereoRig& rig, const StereoMatcherOptions& options)
    : rig_(rig), options_(options), focal_(rig.left.fy()) {
  const cairn::Matrix<3> R_left_right = rig.T_left_right.rotation().matrix();
  const cairn::Vector<3> x = rig.T_left_right.translation().normalized();
  const cairn::Vector<3> view = (cairn::Vector<3>::UnitZ() + R_left_right.col(2)).normalized();
  constexpr double least_angle_sine = 0.5;  // between the view and the baseline: 30 degrees
  if (!(rig.baseline() > 0) || (cairn::skew(view) * x).norm() < least_angle_sine)
    cairn::raise("stereo matcher: expected two cameras side by side, found a baseline along the view");
  const cairn::Vector<3> y = (cairn::skew(view) * x).normalized();
  R_rows_left_ << x.transpose(), y.transpose(), (cairn::skew(x) * y).transpose();
  R_rows_right_ = R_rows_left_ * R_left_right;
  least_disparity_ = static_cast<float>(focal_ * rig.baseline() / options.farthest);
  most_disparity_ = static_cast<float>(focal_ * rig.baseline() / options.nearest);
}

std::vector<StereoMatcher::RowPoint> StereoMatcher::to_rows(const cairn::Features& features,
                                                            const cairn::PinholeCamera& camera,
                                                            const cairn::Matrix<3>& rotation) const {
  std::vector<RowPoint> points;
  points.reserve(features.size());
  for (std::size_t i = 0; i < features.size(); ++i) {
    const cairn::Keypoint& point = features.keypoints[i];
    const auto ray = camera.unproject({point.x, point.y});
    if (!ray) continue;
    const cairn::Vector<3> turned = rotation * *ray;
    if (turned(2) <= 0) continue;
    points.push_back({static_cast<float>(focal_ * turned(1) / turned(2)),
                      static_cast<float>(focal_ * turned(0) / turned(2)), point.scale, point.laplacian,
                      static_cast<std::uint32_t>(i)});
  }
  return points;
}

/// The right points by row, so that those near a row are found by bisection.
class StereoMatcher::Rows {
public:
  explicit Rows(std::vector<RowPoint> points) : points_(std::move(points)) {
    std::ranges::sort(points_, [](const RowPoint& a, const RowPoint& b) {
      return a.row != b.row ? a.row < b.row : a.index < b.index;
    });
  }
  /// All that are at most `band` away from a row.
  [[nodiscard]] auto near(float row, float band) const {
    const auto first = std::ranges::lower_bound(points_, row - band, {}, &RowPoint::row);
    return std::ranges::subrange(
        first, std::ranges::upper_bound(first, points_.end(), row + band, {}, &RowPoint::row));
  }

private:
  std::vector<RowPoint> points_;
};

/// Whether two points can be of one place, before their descriptors are looked at.
bool StereoMatcher::may_match(const RowPoint& left, const RowPoint& right) const {
  const float disparity = left.column - right.column;
  const float ratio = right.scale / left.scale;
  return disparity >= least_disparity_ && disparity <= most_disparity_ && right.sign == left.sign &&
         ratio <= options_.scale_ratio && ratio * options_.scale_ratio >= 1;
}

StereoMatcher::Nearest StereoMatcher::nearest(const cairn::Features& left, const cairn::Features& right,
                                              unsigned threads) const {
  const std::vector<RowPoint> points = to_rows(left, rig_.left, R_rows_left_);
  const Rows rows(to_rows(right, rig_.right, R_rows_right_));
  const std::size_t blocks = std::max(threads, 1U);
  Nearest result{std::vector<Best>(left.size()), std::vector<float>(left.size(), unmatched), {}};
  std::vector<std::vector<Best>> of_right(blocks, std::vector<Best>(right.size()));
  const auto match_left = [&](const RowPoint& point, std::vector<Best>& backward) {
    Best& best = result.of_left[point.index];
    float& second = result.second_of_left[point.index];
    const float band = static_cast<float>(options_.band) * std::max(1.0F, 0.5F * point.scale);
    for (const RowPoint& candidate : rows.near(point.row, band)) {
      if (!may_match(point, candidate)) continue;
      const float distance =
          squared_distance(left.descriptor(point.index), right.descriptor(candidate.index));
      second = std::min(second, std::max(distance, best.distance));
      best.offer(distance, candidate.index);
      backward[candidate.index].offer(distance, point.index);
    }
  };
  cairn::parallel_for(blocks, threads, [&](std::size_t first, std::size_t last) {
    for (std::size_t block = first; block < last; ++block) {
      const std::size_t end = points.size() * (block + 1) / blocks;
      for (std::size_t i = points.size() * block / blocks; i < end; ++i)
        match_left(points[i], of_right[block]);
    }
  });
  for (std::size_t block = 1; block < blocks; ++block)
    for (std::size_t i = 0; i < right.size(); ++i)
      of_right[0][i].offer(of_right[block][i].distance, of_right[block][i].index);
  result.of_right = std::move(of_right[0]);
  return result;
}

std::vector<PointPair> StereoMatcher::operator()(cairn::ImageView left_image, const cairn::Features& left,
                                                 cairn::ImageView right_image, const cairn::Features& right,
                                                 unsigned threads) const {
  CAIRN_EXPECTS(left.dimension == right.dimension, "stereo matcher: descriptors of two kinds");
  const Nearest nearest_ones = nearest(left, right, threads);
  std::vector<PointPair> matches;
  const float ratio_squared = options_.distance_ratio * options_.distance_ratio;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const Best& best = nearest_ones.of_left[i];
    if (best.index == nobody || nearest_ones.of_right[best.index].index != i) continue;
    if (best.distance > options_.max_distance * options_.max_distance) continue;
    if (best.distance > ratio_squared * nearest_ones.second_of_left[i]) continue;
    const cairn::Keypoint& l = left.keypoints[i];
    const cairn::Keypoint& r = right.keypoints[best.index];
    matches.push_back({static_cast<std::uint32_t>(i), best.index, {l.x, l.y}, {r.x, r.y}, false});
  }
  if (!options_.refine) return matches;
  cairn::parallel_for(matches.size(), threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) refine(matches[i], left_image, right_image);
  });
  return matches;
}

void StereoMatcher::refine(PointPair& match, cairn::ImageView left, cairn::ImageView right) const {
  const auto aligned =
      align_patch(left, static_cast<float>(match.left_pixel(0)), static_cast<float>(match.left_pixel(1)),
                  right, static_cast<float>(match.right_pixel(0)), static_cast<float>(match.right_pixel(1)));
  if (!aligned || aligned->correlation < options_.min_correlation) return;
  match.right_pixel = {aligned->x, aligned->y};
  match.refined = true;
  match.stretch = aligned->stretch;
  match.shear = aligned->shear;
}

cairn::Vector<2> StereoMatcher::slope_of_inverse_depth(const PointPair& match) const {
  // A disparity is over the depth along the view of the rows; the left camera's own view may be another.
  const auto inverse_depth = [&](const cairn::Vector<2>& step) {
    const auto left_ray = rig_.left.unproject(match.left_pixel + step);
    const auto right_ray = rig_.right.unproject(match.right_pixel + match.right_step(step));
    if (!left_ray || !right_ray) return 0.0;
    const cairn::Vector<3> l = cairn::product(R_rows_left_, *left_ray),
                           r = cairn::product(R_rows_right_, *right_ray);
    return (l(0) / l(2) - r(0) / r(2)) * l(2);
  };
  const double here = inverse_depth({0, 0}), right = inverse_depth({1, 0}), below = inverse_depth({0, 1});
  if (!(here > 0 && right > 0 && below > 0)) return {0, 0};
  return {right / here - 1, below / here - 1};
}

}  // namespace stereo_slam
