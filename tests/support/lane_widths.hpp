// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The same for vectors of every width that the processor has.
#pragma once

#include <cairn/index/detail/block_lanes.hpp>

namespace cairn_test {

/// Calls check() once for each width, the widest last, or once where there is no choice.
template <class Check>
void for_each_lane_width(const Check& check) {
#if defined(__x86_64__)
  using cairn::detail::LaneWidth;
  struct Restored {
    LaneWidth widest = cairn::detail::lane_width();
    ~Restored() { cairn::detail::lane_width() = widest; }
  };
  const Restored restored;
  for (int width = 0; width <= static_cast<int>(restored.widest); ++width) {
    cairn::detail::lane_width() = static_cast<LaneWidth>(width);
    check();
  }
#else
  check();
#endif
}

}  // namespace cairn_test
