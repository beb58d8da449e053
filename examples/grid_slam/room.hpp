// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Whether a map can take a scan at all, asked before anything is changed: odometry that jumps by a thousand
/// kilometres leads to where no cells are.
#pragma once

#include <limits>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/filter/conditional.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/io/text.hpp>
#include <cairn/manifold/se2.hpp>

namespace grid_slam {

/// Whether these cells can hold all within `reach` [m] of the pose.
template <class Cells>
[[nodiscard]] bool has_room(const cairn::GridGeometry& geometry, const Cells& cells, const cairn::SE2& pose,
                            double reach) {
  const double left = pose.x() - reach, right = pose.x() + reach, bottom = pose.y() - reach,
               top = pose.y() + reach;
  return geometry.contains(left, bottom) && geometry.contains(right, top) &&
         cells.has_room(cairn::tile_of(geometry.cell_of(left, bottom)),
                        cairn::tile_of(geometry.cell_of(right, top)));
}

/// What a proposal is worth whose scan the map cannot take: nothing. Such a particle dies, unmapped; where
/// all do the filter refuses the step, and the belief stays as it was.
inline void forbid(cairn::Proposed<cairn::SE2>& proposed) {
  proposed.log_weight = -std::numeric_limits<double>::infinity();
}

/// Ends a step that the filter refused.
[[noreturn]] inline void refuse_step(cairn::Status status, bool has_room, double cell_size) {
  if (has_room) cairn::raise(cairn::explain(status));
  cairn::raise("it lies outside of the " + cairn::shortest(65536.0 * cairn::tile_side * cell_size) +
               " m that a map with cells of " + cairn::shortest(cell_size) +
               " m may reach: is the odometry right?");
}

}  // namespace grid_slam
