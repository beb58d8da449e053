// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The landmarks of the map: what each looks like, and how often it was seen.
///
/// Where they are is in the map of keyframes (cairn/slam/keyframe_map.hpp), which of them looks like what is
/// seen in a landmark store (cairn/index/landmark_store.hpp); all three go by the same id.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>

#include "surface_patch.hpp"

namespace stereo_slam {

using LandmarkId = std::uint32_t;

struct Landmark {
  LandmarkId id = 0;
  std::vector<float> descriptor;
  std::int8_t sign = 0;  ///< of the Laplacian: -1 bright, +1 dark
  std::uint8_t grey = 0;
  std::shared_ptr<const SurfacePatch> patch;  ///< what it looked like when it was first seen
  int first_seen = 0;                         ///< step
  int last_seen = 0;                          ///< step
  /// Where the left and the right image showed it first; of a map that was loaded that is not known.
  cairn::Vector<4, float> first_pixels =
      cairn::Vector<4, float>::Constant(std::numeric_limits<float>::quiet_NaN());
  int sightings = 1;
  int expected = 1;  ///< frames in which it was seen or should have been
};

/// Landmarks in no particular but deterministic order, found by id in O(1).
class Landmarks {
public:
  void add(Landmark landmark) {
    place_[landmark.id] = landmarks_.size();
    landmarks_.push_back(std::move(landmark));
  }

  void remove(LandmarkId id) {
    const auto found = place_.find(id);
    CAIRN_EXPECTS(found != place_.end(), "landmarks: no landmark has this id");
    const std::size_t place = found->second;
    place_.erase(found);
    if (place + 1 != landmarks_.size()) {
      landmarks_[place] = std::move(landmarks_.back());
      place_[landmarks_[place].id] = place;
    }
    landmarks_.pop_back();
  }

  [[nodiscard]] Landmark& operator[](LandmarkId id) { return landmarks_[place_.at(id)]; }
  [[nodiscard]] const Landmark& operator[](LandmarkId id) const { return landmarks_[place_.at(id)]; }
  [[nodiscard]] const std::vector<Landmark>& all() const noexcept { return landmarks_; }
  [[nodiscard]] std::vector<Landmark>& all() noexcept { return landmarks_; }
  [[nodiscard]] std::size_t size() const noexcept { return landmarks_.size(); }

private:
  std::vector<Landmark> landmarks_;
  std::unordered_map<LandmarkId, std::size_t> place_;
};

}  // namespace stereo_slam
