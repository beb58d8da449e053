// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A drive forwards, then its frames in reverse order: it ends where it began, and needs no truth to show by
/// how much the system misses that.
#pragma once

#include <memory>
#include <vector>

#include "dataset.hpp"
#include "run_record.hpp"

namespace stereo_slam {

/// The frames 0, 1, ..., n - 1, n - 2, ..., 0 of a data set; time goes on at the pace at which it came.
[[nodiscard]] std::unique_ptr<Dataset> there_and_back(std::unique_ptr<Dataset> there);

/// How far the last pose is from the first.
struct ReturnError {
  double path = 0;      ///< [m], of the estimate
  double distance = 0;  ///< [m]
  double angle = 0;     ///< [rad]

  [[nodiscard]] double percent() const noexcept { return path > 0 ? 100 * distance / path : 0; }
};

/// Needs a frame.
[[nodiscard]] ReturnError return_error(const std::vector<FrameRecord>& frames);

}  // namespace stereo_slam
