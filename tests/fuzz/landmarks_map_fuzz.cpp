// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Maps of landmarks and way points: what is read can be driven through, or is refused.
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>

#include "fuzz/landmark_checks.hpp"
#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  try {
    const fastslam::PointMap map =
        fastslam::read_point_map(scratch.put("a.mat", cairn_fuzz::text_of(data, size)));
    cairn_fuzz::expect(!map.landmarks.empty() && !map.way.empty(), "a map has landmarks and a way");
    cairn_fuzz::check_landmark_log(fastslam::simulated(map, 1, 3), -2);
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
