// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A drive forwards, then its frames in reverse order: it ends where it began, and needs no truth to show by
/// how much the system misses that.
#pragma once

#include <memory>

#include "dataset.hpp"

namespace stereo_slam {

/// The frames 0, 1, ..., n - 1, n - 2, ..., 0 of a data set; time goes on at the pace at which it came.
[[nodiscard]] std::unique_ptr<Dataset> there_and_back(std::unique_ptr<Dataset> there);

}  // namespace stereo_slam
