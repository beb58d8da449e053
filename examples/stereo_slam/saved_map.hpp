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
#include <optional>
#include <string>
#include <vector>

#include <cairn/manifold/se3.hpp>
#include <cairn/slam/keyframe_map.hpp>

#include "feature_choice.hpp"
#include "landmarks.hpp"

namespace stereo_slam {

/// Where a map lies in the world of a truth: what is found in the map can be compared with that as it is.
struct TruthWorld {
  std::string name;  ///< StereoFrame::truth_world
  cairn::SE3 T_truth_map;
};

struct SavedMap {
  FeatureKind features = FeatureKind::surf;
  bool oriented = false;  ///< SURF with orientation
  int steps = 0;          ///< frames that made it
  cairn::KeyframeMap map;
  std::vector<Landmark> landmarks;  ///< ids 0, 1, 2, ..., those of the map
  std::optional<TruthWorld> truth = std::nullopt;
};

/// Of the file: 1 had five numbers of the rig, 2 no patches, 3 no world of the truth.
inline constexpr std::uint64_t saved_map_version = 4;

/// Writes the map; in the file landmarks are numbered in their order, whatever their ids are. Throws
/// cairn::Error naming the path.
void save_map(const std::filesystem::path& path, const SavedMap& saved);

/// Throws cairn::Error naming the path for what is no map, one that is damaged, cut or of a newer version.
[[nodiscard]] SavedMap load_map(const std::filesystem::path& path);

/// Throws cairn::Error, with `name` of the map, where it was not made with this rig (as its file says it is,
/// not as it was corrected), or with it and its right camera pitched by as much as levelled_rig.hpp turns
/// one.
void expect_same_rig(const cairn::StereoRig& of_map, const cairn::StereoRig& rig, const std::string& name);

}  // namespace stereo_slam
