// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "self_calibration.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace stereo_slam {
namespace {

constexpr std::size_t enough_points = 40;
constexpr int longest_motion = 15;  // frames; over it the correction itself may have wandered

/// Both lists are in the order of their landmarks.
std::vector<cairn::MovedPair> seen_in_both(const std::vector<Sighting>& before,
                                           const std::vector<Sighting>& after) {
  std::vector<cairn::MovedPair> pairs;
  for (auto a = before.begin(), b = after.begin(); a != before.end() && b != after.end();) {
    if (a->landmark == b->landmark)
      pairs.push_back({a->left, a->right, b->left, b->right, std::max(a->sigma, b->sigma)});
    const bool advance_after = b->landmark <= a->landmark;
    if (a->landmark <= b->landmark) ++a;
    if (advance_after) ++b;
  }
  return pairs;
}

}  // namespace

bool SelfCalibration::observe(int frame, const cairn::SE3& T_world_camera, std::vector<Sighting> sightings) {
  std::ranges::sort(sightings, {}, &Sighting::landmark);
  now_ = frame;
  const int frames = now_ - begun_;
  const std::vector<cairn::MovedPair> pairs = seen_in_both(before_, sightings);
  if (2 * pairs.size() > before_.size() && frames < longest_motion) return false;
  bool corrected = false;
  if (pairs.size() >= enough_points) {
    const cairn::SE3 motion = T_world_before_.inverse() * T_world_camera;
    corrected = drift_.update_moved(pairs, motion, frames).good();
  } else if (!before_.empty()) {
    drift_ = drift_.ahead(frames);  // unseen, it goes on turning
  }
  before_ = std::move(sightings);
  T_world_before_ = T_world_camera;
  begun_ = now_;
  return corrected;
}

}  // namespace stereo_slam
