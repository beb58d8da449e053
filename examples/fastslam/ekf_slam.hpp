// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The rival: one Gaussian over the pose and all landmarks (R. Smith, M. Self, P. Cheeseman, 1990).
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/gaussian.hpp>
#include <cairn/manifold/se2.hpp>

#include "landmark_log.hpp"

namespace fastslam {

struct EkfSlamRun {
  std::vector<cairn::Gaussian<cairn::SE2>> poses;  ///< after each frame: of what was seen until then
  std::map<std::uint32_t, cairn::Vector<2>> landmarks;
  double cpu_seconds = 0;
};

/// Runs over the log by its identities, gated like FastSLAM's. Sightings without one do not count. Throws
/// cairn::Error where the filter refuses a motion.
[[nodiscard]] EkfSlamRun ekf_slam(const LandmarkLog& log, double gate = 1);

}  // namespace fastslam
