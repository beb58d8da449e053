// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "stereo_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

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

struct Best {
  float distance = unmatched;
  std::uint32_t index = nobody;

  /// Ties go to the smaller index so that the answer does not depend on the order of work.
  void offer(float candidate, std::uint32_t candidate_index) {
    if (candidate < distance || (candidate == distance && candidate_index < index))
      *this = {candidate, candidate_index};
  }
};

}  // namespace

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

std::vector<PointPair> StereoMatcher::operator()(cairn::ImageView left_image, const cairn::Features& left,
                                                 cairn::ImageView right_image, const cairn::Features& right,
                                                 unsigned threads) const {
  CAIRN_EXPECTS(left.dimension == right.dimension, "stereo matcher: descriptors of two kinds");
  const std::vector<RowPoint> left_points = to_rows(left, rig_.left, R_rows_left_);
  std::vector<RowPoint> right_points = to_rows(right, rig_.right, R_rows_right_);
  std::ranges::sort(right_points, [](const RowPoint& a, const RowPoint& b) {
    return a.row != b.row ? a.row < b.row : a.index < b.index;
  });

  std::vector<Best> best_of_left(left.size());
  std::vector<float> second_of_left(left.size(), unmatched);
  std::vector<std::vector<Best>> best_of_right(std::max(threads, 1U), std::vector<Best>(right.size()));
  const auto match_left = [&](const RowPoint& point, std::vector<Best>& backward) {
    Best& best = best_of_left[point.index];
    float& second = second_of_left[point.index];
    const float band = static_cast<float>(options_.band) * std::max(1.0F, 0.5F * point.scale);
    auto candidate = std::ranges::lower_bound(right_points, point.row - band, {}, &RowPoint::row);
    for (; candidate != right_points.end() && candidate->row <= point.row + band; ++candidate) {
      const float disparity = point.column - candidate->column;
      if (disparity < least_disparity_ || disparity > most_disparity_ || candidate->sign != point.sign)
        continue;
      const float ratio = candidate->scale / point.scale;
      if (ratio > options_.scale_ratio || ratio * options_.scale_ratio < 1) continue;
      const float distance =
          squared_distance(left.descriptor(point.index), right.descriptor(candidate->index));
      second = std::min(second, std::max(distance, best.distance));
      best.offer(distance, candidate->index);
      backward[candidate->index].offer(distance, point.index);
    }
  };
  cairn::parallel_for(best_of_right.size(), threads, [&](std::size_t first, std::size_t last) {
    for (std::size_t block = first; block < last; ++block) {
      const std::size_t begin = left_points.size() * block / best_of_right.size();
      const std::size_t end = left_points.size() * (block + 1) / best_of_right.size();
      for (std::size_t i = begin; i < end; ++i) match_left(left_points[i], best_of_right[block]);
    }
  });
  for (std::size_t block = 1; block < best_of_right.size(); ++block)
    for (std::size_t i = 0; i < right.size(); ++i)
      best_of_right[0][i].offer(best_of_right[block][i].distance, best_of_right[block][i].index);

  std::vector<PointPair> matches;
  const float ratio_squared = options_.distance_ratio * options_.distance_ratio;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const Best& best = best_of_left[i];
    if (best.index == nobody || best_of_right[0][best.index].index != i) continue;
    if (best.distance > options_.max_distance * options_.max_distance) continue;
    if (best.distance > ratio_squared * second_of_left[i]) continue;
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
}

}  // namespace stereo_slam
