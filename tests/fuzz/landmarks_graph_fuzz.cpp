// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Graphs of odometry and landmarks.
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>

#include "fuzz/landmark_checks.hpp"
#include "fuzz/scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  try {
    const fastslam::LandmarkLog log = fastslam::read_graph(scratch.put("a", cairn_fuzz::text_of(data, size)));
    cairn_fuzz::check_landmark_log(log);
    cairn_fuzz::expect(log.sensor.range_sigma > 0 && log.sensor.across_sigma > 0, "sightings are uncertain");
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
