// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A map that outlives its run: the keyframes with their joint covariance and what every landmark looks like,
/// in one file with a version and a checksum. A file is the old map or the new one, whenever the writer was
/// killed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <cairn/slam/keyframe_map.hpp>

#include "feature_choice.hpp"
#include "landmarks.hpp"

namespace stereo_slam {

struct SavedMap {
  FeatureKind features = FeatureKind::surf;
  bool oriented = false;  ///< SURF with orientation
  int steps = 0;          ///< frames that made it
  cairn::KeyframeMap map;
  std::vector<Landmark> landmarks;  ///< ascending ids, those of the map
};

/// Of the file: 1 had five numbers of the rig, 2 no patches.
inline constexpr std::uint64_t saved_map_version = 3;

/// Writes the map; landmarks are numbered 0, 1, 2, ... in the file. Throws cairn::Error naming the path.
void save_map(const std::filesystem::path& path, const SavedMap& saved);

/// Throws cairn::Error naming the path for what is no map, one that is damaged, cut or of a newer version.
[[nodiscard]] SavedMap load_map(const std::filesystem::path& path);

/// Throws cairn::Error, with `name` of the map, where it was not made with this rig (as its file says it is,
/// not as it was corrected), or with it and its right camera pitched by as much as levelled_rig.hpp turns
/// one.
void expect_same_rig(const cairn::StereoRig& of_map, const cairn::StereoRig& rig, const std::string& name);

}  // namespace stereo_slam
