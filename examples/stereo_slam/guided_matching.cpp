// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "guided_matching.hpp"

#include <algorithm>
#include <compare>
#include <cstddef>
#include <unordered_set>
#include <utility>

#include "descriptor_distance.hpp"

namespace stereo_slam {
namespace {

struct Candidate {
  float distance;  // squared
  std::uint32_t point;
  LandmarkId landmark;
  std::size_t place;  // of the point in its row
  auto operator<=>(const Candidate&) const = default;
};

/// The pairs that are near each other and look alike; `by_row` is sorted by the left row.
std::vector<Candidate> candidates(const cairn::StereoRig& rig, const cairn::SE3& T_world_camera,
                                  const std::vector<FreePoint>& by_row,
                                  std::span<const ExpectedLandmark> landmarks,
                                  const GuidedMatchingOptions& options) {
  const cairn::SE3 T_camera_world = T_world_camera.inverse();
  const cairn::Matrix<3> R = T_camera_world.rotation().matrix();
  const double radius = options.radius, square = radius * radius;
  const float most = static_cast<float>(options.max_distance * options.max_distance);
  const auto row = [](const FreePoint& point) { return point.left_pixel(1); };
  std::vector<Candidate> result;
  for (const ExpectedLandmark& landmark : landmarks) {
    const cairn::Vector<3> p = cairn::product(R, landmark.position) + T_camera_world.translation();
    if (p(2) < rig.baseline()) continue;
    const auto pixels = rig.project(p);
    if (!pixels || !rig.left.contains(pixels->head<2>())) continue;
    auto near = std::ranges::lower_bound(by_row, (*pixels)(1) - radius, {}, row);
    for (; near != by_row.end() && row(*near) <= (*pixels)(1) + radius; ++near) {
      if ((near->left_pixel - pixels->head<2>()).squaredNorm() > square) continue;
      if ((near->right_pixel - pixels->tail<2>()).squaredNorm() > square) continue;
      if (near->look.sign != landmark.look.sign) continue;
      const float distance = squared_distance(near->look.descriptor, landmark.look.descriptor);
      if (distance <= most)
        result.push_back(
            {distance, near->point, landmark.id, static_cast<std::size_t>(near - by_row.begin())});
    }
  }
  std::ranges::sort(result);
  return result;
}

}  // namespace

std::vector<GuidedMatch> match_guided(const cairn::StereoRig& rig, const cairn::SE3& T_world_camera,
                                      std::vector<FreePoint> points,
                                      std::span<const ExpectedLandmark> landmarks,
                                      const GuidedMatchingOptions& options) {
  std::ranges::sort(points, {}, [](const FreePoint& p) { return std::pair(p.left_pixel(1), p.point); });
  std::vector<GuidedMatch> matches;
  std::vector<std::uint8_t> taken(points.size(), 0);
  std::unordered_set<LandmarkId> given;
  for (const Candidate& one : candidates(rig, T_world_camera, points, landmarks, options)) {
    if (taken[one.place] != 0 || !given.insert(one.landmark).second) continue;
    taken[one.place] = 1;
    matches.push_back({one.point, one.landmark});
  }
  return matches;
}

}  // namespace stereo_slam
