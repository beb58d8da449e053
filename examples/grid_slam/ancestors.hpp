// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The particles' ancestors at some time: DP-SLAM's tree, for a picture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <cairn/filter/conditional.hpp>
#include <cairn/manifold/se2.hpp>

namespace grid_slam {

/// A stretch of path that some particles have in common and no others: a node of the tree of ancestors.
struct Ancestor {
  std::optional<std::size_t> parent;  ///< an earlier one of the list
  std::uint64_t born = 0;             ///< step after which this one's path is its own
  std::uint64_t end = 0;              ///< its last step, where it splits or is a particle now
  double place = 0;           ///< particles count up from 0 so that no two lines cross; others stand between
  std::size_t particles = 0;  ///< that end with it, of one path
};

/// All whose paths a particle has, parents before children. Paths that begin apart are taken for one until
/// the first step, which is where their maps were copied. O(poses of all paths).
[[nodiscard]] std::vector<Ancestor> ancestors_of(const cairn::PathsRecord<cairn::SE2>& record);

}  // namespace grid_slam
